//! Thematic maps, composition and their twins.

use contract::colour::Scale;
use contract::job::Mode;
use glam::Vec4;
use render::frame_context::FrameContext;
use render::gpu::{Gpu, Slot};
use render::stages::compose::{self, Compose};
use render::stages::eye::{self, Eye};
use render::stages::layout::VIEW_TILE;
use render::stages::map::{self, Map, plain};

use super::seeing::eye_image;
use super::{Twins, bytes, channels, far_apart, prove};
use crate::below::below;
use crate::context::{everything, with_terrain};
use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};
use crate::trails::with_trails;

#[test]
fn map_matches_its_twin_on_tiles_and_on_the_globe() {
    let views = [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 160)];
    let plain = views.map(|view| {
        (
            Twins::of(Mode::Map, view),
            "mix(north, south",
            "mix(south, north",
        )
    });
    let [on_tile, on_globe] = views.map(|view| Twins::uncertain(Mode::Map, view));
    let uncertain = [
        (on_tile, "* uncertainty * line_at(pixel)", "* uncertainty"),
        (
            on_globe,
            "palette[256u + at] & 0xffffu",
            "palette[256u + at] & 0x7fffu",
        ),
    ];
    let joined = views.map(|view| {
        (
            Twins::joined(Mode::Map, view),
            "alpha *= value.z / value.y",
            "alpha *= value.z",
        )
    });
    let nearest = views.map(|view| {
        let of_cells = Twins::styled(Mode::Map, view, ocean(FIVE_DEGREES), |style| {
            style.nearest = true;
        });
        (of_cells, "place.fraction >= 0.5", "place.fraction >= 0.3")
    });
    let all = plain.into_iter().chain(uncertain).chain(joined);
    for (twins, right, wrong) in all.chain(nearest) {
        let expected = channels(&twins.picture);
        prove("map", map::SOURCE, right, wrong, |gpu, source| {
            let stage = Map::new(gpu, source);
            let value =
                |f: &mut FrameContext<'_>| drop(f.upload(Slot::Value, &twins.value).unwrap());
            let drawn: Vec<Vec4> = twins.run(
                gpu,
                value,
                |f| stage.record(f).unwrap(),
                Slot::Picture,
                expected.len() / 4,
            );
            // A colour may be the next of the palette's 256.
            far_apart(&channels(&drawn), &expected, 0.02)
        });
    }
}

#[test]
fn a_tile_drawn_in_one_has_the_bytes_of_its_stages() {
    let shaped = |view| {
        Twins::styled(Mode::Map, view, ocean(FIVE_DEGREES), |style| {
            style.transfer.opacity = "-1e-9:0.9,0:0.1,1e-9:0.7".parse().unwrap();
        })
    };
    let logarithmic = |view| {
        Twins::styled(Mode::Map, view, ocean(FIVE_DEGREES), |style| {
            (style.transfer.low, style.transfer.high) = (1e-11, 1e-8);
            style.transfer.scale = Scale::Log;
        })
    };
    let nearest = |view| {
        Twins::styled(Mode::Map, view, ocean(FIVE_DEGREES), |style| {
            style.nearest = true;
        })
    };
    // The whole world, across the date line, a coast, and fewer cells than pixels; of other sizes too.
    let views = [
        tile(0, 0, 0, 256),
        tile(3, 7, 3, 256),
        tile(2, 0, 1, 512),
        tile(7, 5, 60, 256),
    ];
    for view in views {
        let plain = Twins::of(Mode::Map, view);
        for twins in [
            plain,
            Twins::joined(Mode::Map, view),
            shaped(view),
            logarithmic(view),
            nearest(view),
        ] {
            assert!(plain::suits(&twins.plan));
            let drawn = plain::draw(&twins.plan, &twins.scene);
            let expected = twins.image.iter().flat_map(|word| word.to_le_bytes());
            assert!(drawn.iter().copied().eq(expected), "{view:?}");
            assert!(
                drawn.chunks_exact(4).any(|pixel| pixel[3] > 0),
                "{view:?} is empty"
            );
        }
        // Every other kind of picture needs stages.
        assert!(plain::may_suit(&job(Mode::Map, view)));
        let others = [
            Twins::uncertain(Mode::Map, view).plan,
            Twins::of(Mode::Points, view).plan,
        ];
        assert!(others.iter().all(|plan| !plain::suits(plan)));
    }
    assert!(!plain::suits(
        &Twins::of(Mode::Map, globe(-120.0, 10.0, 1.5e7, 160)).plan
    ));
}

#[test]
fn compose_matches_its_twin() {
    let twins = Twins::on_base_map();
    let expected = bytes(twins.image.iter().copied());
    for (right, wrong) in [
        ("rgb.y << 8u", "rgb.z << 8u"),
        // The air past the globe and before its ground, the share of land, the sea floor, lakes, shores and borders.
        ("2.0 * air_above", "1.0 * air_above"),
        ("air_above(0.0,", "air_above(0.02,"),
        ("mix(sea, land, shares.x)", "mix(land, sea, shares.x)"),
        (
            "-floor.height_m / base_map.deep_m",
            "floor.height_m / base_map.deep_m",
        ),
        (
            "base_map.shading * (slanted",
            "-base_map.shading * (slanted",
        ),
        ("base_map.lake, shares.y)", "base_map.deep, shares.x)"),
        ("mask.z * mix", "mask.y * mix"),
        ("mask.w * mix", "mask.x * mix"),
        ("base_map.sky_alpha *", "0.5 * base_map.sky_alpha *"),
    ] {
        prove("compose", compose::SOURCE, right, wrong, |gpu, source| {
            let stage = Compose::new(gpu, source);
            let picture =
                |f: &mut FrameContext<'_>| drop(f.upload(Slot::Picture, &twins.picture).unwrap());
            let drawn: Vec<u32> = twins.run(
                gpu,
                picture,
                |f| stage.record(f).unwrap(),
                Slot::Image,
                twins.image.len(),
            );
            far_apart(&bytes(drawn), &expected, 1.01)
        });
    }
}

#[test]
fn trails_on_the_sea_match_their_twin() {
    for (mode, right, wrong) in [
        (
            Mode::Map,
            "over(trail, colour, true)",
            "over(trail, colour, false)",
        ),
        (
            Mode::Map,
            "linear_of(codes_of(word) / 255.0)",
            "codes_of(word) / 255.0",
        ),
        (
            Mode::Volume,
            "{ colour = over(trail, colour, false); }",
            "{ }",
        ),
        (
            Mode::Volume,
            "kept * clear * clear + 32512u",
            "65025u * 255u + 0u * clear",
        ),
    ] {
        let mut job = job(mode, globe(-30.0, 25.0, 9e6, 160));
        job.style.globe_surface = true;
        let (scene, job) = with_trails(job);
        let twins = Twins::of_job(&job, scene);
        let expected = bytes(twins.image.iter().copied());
        if mode == Mode::Map {
            prove("trails", compose::SOURCE, right, wrong, |gpu, source| {
                let stage = Compose::new(gpu, source);
                let picture = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Picture, &twins.picture).unwrap());
                };
                let record = |f: &mut FrameContext<'_>| stage.record(f).unwrap();
                let len = twins.image.len();
                let drawn: Vec<u32> = twins.run(gpu, picture, record, Slot::Image, len);
                far_apart(&bytes(drawn), &expected, 1.01)
            });
            continue;
        }
        for entry in [eye::SHARED, eye::ALONE] {
            prove("trails", eye::SOURCE, right, wrong, |gpu, source| {
                far_apart(&eye_image(&twins, gpu, source, entry), &expected, 1.01)
            });
        }
    }
}

#[test]
fn what_is_seen_from_below_the_sea_matches_its_twin() {
    let view = below([-100.0, 20.0], 4e5, [20.0, 80.0], [160, 120]);
    for mode in [Mode::Volume, Mode::Map] {
        let twins = Twins::styled(mode, view, ocean(FIVE_DEGREES), |style| {
            (style.context.coastlines, style.context.borders) = (true, true);
        });
        let expected = bytes(twins.image.iter().copied());
        for (right, wrong) in [
            ("spot.cover < 1.0) { around", "spot.cover < 0.0) { around"),
            (
                "kept_over(spot.ground.way)",
                "kept_over(0.5 * spot.ground.way)",
            ),
            (
                "plain(spot.ground.lon, spot",
                "plain(0.3 + spot.ground.lon, spot",
            ),
            ("nearest_at + half_chord", "nearest_at - half_chord"),
            ("over(coast_colour(spot, pixel, 0.0), seen, true)", "seen"),
        ] {
            prove("compose", compose::SOURCE, right, wrong, |gpu, source| {
                let stage = Compose::new(gpu, source);
                let picture = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Picture, &twins.picture).unwrap());
                };
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    picture,
                    |f| stage.record(f).unwrap(),
                    Slot::Image,
                    twins.image.len(),
                );
                far_apart(&bytes(drawn), &expected, 1.01)
            });
        }
    }
}

#[test]
fn surroundings_match_their_twin_on_tiles_and_on_the_globe() {
    let views = [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 160)];
    let line_of = [
        ("place.x % 4u * 8u", "(3u - place.x % 4u) * 8u"),
        (
            "covered = max(covered, colour.w)",
            "covered = 0.0 * max(covered, colour.w)",
        ),
    ];
    // Hatched sea and fading lines are of globes.
    let of_globe = [
        ("hatch_over_relief *", "hatch_over_relief * 0.0 *"),
        ("(1.0 - shares.x) * (1.0 - shares.y)", "1.0"),
        (
            "ground_mask(pixel) * line_share(spot.ground)",
            "ground_mask(pixel)",
        ),
    ];
    let faults = [
        // The slope of the terrain, its height, the night, the sea above the floor; the coast.
        ("2.0 * z[at + 4]", "2.0 * z[at - 4]"),
        ("if (height_m < 0.0)", "if (height_m < 1000.0)"),
        ("mix(NIGHT, 1.0,", "mix(1.0, NIGHT,"),
        ("exp(context.seabed_per_m", "exp(-context.seabed_per_m"),
    ];
    for (view, line) in views.into_iter().zip(line_of) {
        let twins = Twins::of_job(&everything(Mode::Map, view), with_terrain(FIVE_DEGREES));
        assert!(twins.params.in_context);
        let expected = bytes(twins.image.iter().copied());
        let of_globe = of_globe
            .into_iter()
            .filter(|_| twins.params.view.kind != VIEW_TILE);
        for (right, wrong) in faults.into_iter().chain([line]).chain(of_globe) {
            let distance = |gpu: &Gpu, source: &str| {
                let stage = Compose::new(gpu, source);
                let picture = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Picture, &twins.picture).unwrap());
                };
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    picture,
                    |f| stage.record(f).unwrap(),
                    Slot::Image,
                    twins.image.len(),
                );
                far_apart(&bytes(drawn), &expected, 1.01)
            };
            let source = compose::SOURCE;
            prove("surroundings", source, right, wrong, distance);
        }
    }
}

#[test]
fn the_eye_composes_in_surroundings_as_its_twin_does() {
    for view in [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 160)] {
        let twins = Twins::of_job(&everything(Mode::Volume, view), with_terrain(FIVE_DEGREES));
        let expected = bytes(twins.image.iter().copied());
        let distance = |gpu: &Gpu, source: &str, entry| {
            let stage = Eye::of(gpu, source, entry);
            let lists = |f: &mut FrameContext<'_>| {
                f.upload(Slot::Counts, &twins.list_ends).unwrap();
                f.upload(Slot::Entries, &twins.entries).unwrap();
            };
            let drawn: Vec<u32> = twins.run(
                gpu,
                lists,
                |f| stage.record(f).unwrap(),
                Slot::Image,
                twins.image.len(),
            );
            far_apart(&bytes(drawn), &expected, 1.01)
        };
        let (right, wrong) = ("colour += ground_colour", "colour -= ground_colour");
        for entry in [eye::SHARED, eye::ALONE] {
            prove("eye", eye::SOURCE, right, wrong, |gpu, source| {
                distance(gpu, source, entry)
            });
        }
    }
}
