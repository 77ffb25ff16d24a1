//! Isolines and their twin, alone and in the picture.

use contract::annotation::{Annotations, Graticule};
use contract::isolines::Isolines;
use contract::job::{Mode, RenderJob, View};
use render::gpu::{Gpu, Slot};
use render::stages::compose::{self, Compose};
use render::stages::isolines::{self, Isolines as Stage};
use render::stages::layout::VIEW_TILE;

use super::{Twins, bytes, far_apart, prove};
use crate::isolines::with_lone_cells;
use crate::scenes::{FIVE_DEGREES, GRAM_A_YEAR, globe, job, looking_at, ocean, tile};

/// Lines every 10 g C a year.
fn lined(mode: Mode, view: View) -> RenderJob {
    let mut job = job(mode, view);
    job.style.globe_surface = matches!(view, View::Globe { .. });
    job.style.context.isolines = Some(Isolines::Every {
        zero: 0.0,
        step: 10.0 * GRAM_A_YEAR,
    });
    if let View::Globe { .. } = view {
        job.annotations = Some(Annotations {
            graticule: Graticule::every(15.0).ok(),
            ..Annotations::none()
        });
    }
    job
}

/// Cover and grey of isolines and cover of the graticule in every pixel, 0 to 1.
fn shares(lines: &[u32]) -> Vec<f32> {
    let parts = |word: &u32| {
        let [cover, grey, graticule] = [word & 4095, word >> 12 & 255, word >> 20];
        [
            cover as f32 / 4095.0,
            grey as f32 / 255.0,
            graticule as f32 / 4095.0,
        ]
    };
    lines.iter().flat_map(parts).collect()
}

#[test]
fn isolines_match_their_twin_on_tiles_and_on_the_globe() {
    let blocks = render::pyramid::coarser(&ocean(FIVE_DEGREES)).unwrap();
    let views = [
        (tile(2, 0, 1, 256), "per_rad.y * cos_lat)", "per_rad.y)"),
        (tile(2, 0, 1, 256), "mix(north, south", "mix(south, north"),
        (
            globe(-120.0, 10.0, 1.5e7, 160),
            "dot(view.right, normal) * along",
            "0.0 * along",
        ),
        (
            looking_at([-122.0, 25.0], 2.5e6, [60.0, 70.0], 192),
            "-field.per_row * grid.rows",
            "field.per_row * grid.rows",
        ),
        (
            globe(-120.0, 10.0, 1.5e7, 160),
            "level.half_px + 0.5",
            "level.half_px + 0.2",
        ),
        (
            globe(-120.0, 10.0, 1.5e7, 160),
            "graticule_of(hit.lat, slope",
            "graticule_of(hit.lon, slope",
        ),
    ];
    for (view, right, wrong) in views {
        for scene in [ocean(FIVE_DEGREES), blocks.clone()] {
            let twins = Twins::of_job(&lined(Mode::Map, view), scene);
            let expected = shares(&twins.lines);
            assert!(expected.iter().any(|share| *share > 0.7));
            prove("isolines", isolines::SOURCE, right, wrong, |gpu, source| {
                let stage = Stage::new(source);
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    |_nothing| (),
                    |f| stage.record(f).unwrap(),
                    Slot::Isolines,
                    twins.lines.len(),
                );
                far_apart(&shares(&drawn), &expected, 0.02)
            });
        }
    }
}

#[test]
fn lines_round_single_cells_match_their_twin() {
    let faults = [
        ("(above == 1)", "(above == 2)"),
        ("size_px / LEAST_LOOP_PX - 1.0", "size_px / LEAST_LOOP_PX"),
        ("i == 1 || i == 7", "i == 1"),
        (
            "inside = clamp(hit.rim_px * RIM_PER_PX - 0.5, 0.0, 1.0) * line_share(hit)",
            "inside = 1.0",
        ),
        ("(other > level) == (own > level)", "false"),
    ];
    let views = [tile(3, 4, 3, 256), globe(-30.0, 10.0, 1.2e7, 400)];
    for (view, count) in views.into_iter().zip([3, 5]) {
        let mut job = lined(Mode::Map, view);
        job.accumulated = None;
        (job.style.transfer.low, job.style.transfer.high) = (-40.0, 40.0);
        job.style.context.isolines = Some(Isolines::Every {
            zero: 0.0,
            step: 10.0,
        });
        // Loops of some five pixels, which fade.
        let twins = Twins::of_job(&job, with_lone_cells(11.3));
        let expected = shares(&twins.lines);
        let fading = expected
            .iter()
            .step_by(3)
            .filter(|share| (0.1..0.5).contains(*share));
        assert!(fading.count() > 100);
        for (right, wrong) in faults.into_iter().take(count) {
            prove("isolines", isolines::SOURCE, right, wrong, |gpu, source| {
                let stage = Stage::new(source);
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    |_nothing| (),
                    |f| stage.record(f).unwrap(),
                    Slot::Isolines,
                    twins.lines.len(),
                );
                far_apart(&shares(&drawn), &expected, 0.02)
            });
        }
    }
}

#[test]
fn isolines_are_composed_as_their_twin_does() {
    for view in [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 160)] {
        let twins = Twins::of_job(&lined(Mode::Volume, view), ocean(FIVE_DEGREES));
        let expected = bytes(twins.image.iter().copied());
        let distance = |gpu: &Gpu, source: &str| {
            let stage = Compose::new(gpu, source);
            let drawn: Vec<u32> = twins.run(
                gpu,
                |f| {
                    f.upload(Slot::Picture, &twins.picture).unwrap();
                    f.upload(Slot::Isolines, &twins.lines).unwrap();
                },
                |f| stage.record(f).unwrap(),
                Slot::Image,
                twins.image.len(),
            );
            far_apart(&bytes(drawn), &expected, 1.01)
        };
        let faults = [
            ("isoline * context.isolines_through", "isoline * 0.1"),
            ("(word >> 12u) & 255u", "(word >> 10u) & 255u"),
            ("f32(word >> 20u)", "f32(word & 4095u)"),
        ];
        // Tiles have no graticule.
        let seen = if twins.params.view.kind == VIEW_TILE {
            2
        } else {
            3
        };
        for (right, wrong) in faults.into_iter().take(seen) {
            prove("isolines", compose::SOURCE, right, wrong, distance);
        }
    }
}

#[test]
fn masked_land_matches_its_twin() {
    let mut job = lined(Mode::Map, globe(-100.0, 20.0, 1.2e7, 160));
    job.style.context.mask_land = true;
    let twins = Twins::of_job(&job, ocean(FIVE_DEGREES));
    let expected = bytes(twins.image.iter().copied());
    for (right, wrong) in [
        ("blended * unmasked_share(pixel)", "blended"),
        (" / 4095.0 * unmasked_share(pixel)", " / 4095.0"),
        ("f32(255u - land_share(pixel))", "f32(land_share(pixel))"),
    ] {
        prove(
            "masked land",
            compose::SOURCE,
            right,
            wrong,
            |gpu, source| {
                let stage = Compose::new(gpu, source);
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    |f| {
                        f.upload(Slot::Picture, &twins.picture).unwrap();
                        f.upload(Slot::Isolines, &twins.lines).unwrap();
                    },
                    |f| stage.record(f).unwrap(),
                    Slot::Image,
                    twins.image.len(),
                );
                far_apart(&bytes(drawn), &expected, 1.01)
            },
        );
    }
}
