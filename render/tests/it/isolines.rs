//! Isolines: at the right places, as wide as they should be, without seams, and nothing where the field is level.

use contract::isolines::Isolines;
use contract::job::{Mode, RenderJob, View};
use contract::tile::mercator_lat_deg;
use render::plan::Plan;
use render::scene::{Field, Interval};
use render::stages::isolines::cpu::{Inputs, draw_lines};
use render::stages::sphere::{ground_below, line_share};
use render::{Image, Scene};

use crate::compare::distance;
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, looking_at, ocean, tile};
use crate::seams::children_of;

/// A field from a formula of longitude and latitude, degrees, everywhere.
pub(crate) fn field(value: impl Fn(f64, f64) -> f64) -> Scene {
    let grid = ONE_DEGREE;
    let cells = (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
    let values = cells.map(|(row, col)| {
        let place = grid.cell_center(row, col);
        value(place.lon, place.lat) as f32
    });
    let field = std::sync::Arc::new(Field::new(values.collect()));
    Scene {
        domain: Scene::domain_of((0..grid.cell_count()).map(|_| true)),
        value: Interval {
            before: std::sync::Arc::clone(&field),
            after: field,
            weight: 0.0,
        },
        accumulated: None,
        ..ocean(grid)
    }
}

/// Colours from -40 to 40 and lines at the multiples of a step.
fn lined(view: View, step: f64) -> RenderJob {
    let mut job = job(Mode::Map, view);
    job.accumulated = None;
    (job.style.transfer.low, job.style.transfer.high) = (-40.0, 40.0);
    job.style.context.isolines = Some(Isolines::Every { zero: 0.0, step });
    job
}

/// Share of every pixel that lines cover, row by row.
fn covers(job: &RenderJob, scene: &Scene) -> (Plan, Vec<f64>) {
    let plan = Plan::new(job, scene, u64::MAX).unwrap();
    let params = plan.params_of(plan.whole());
    let value = scene.value.before.cells.content();
    let mut lines = vec![0; params.view.size_px.element_product() as usize];
    draw_lines(&params, &Inputs::of(&plan, scene, value), &mut lines);
    let share = |word: &u32| f64::from(word & 4095) / 4095.0;
    (plan, lines.iter().map(share).collect())
}

/// Middles and widths of the lines along a row of pixels.
fn crossings(row: &[f64], most: f64) -> Vec<(f64, f64)> {
    let mut found = vec![];
    let (mut sum, mut moment) = (0.0, 0.0);
    for (x, cover) in row.iter().chain([&0.0]).enumerate() {
        if *cover > 0.0 {
            sum += cover;
            moment += cover * (x as f64 + 0.5);
        } else if sum > 0.0 {
            found.push((moment / sum, sum / most));
            (sum, moment) = (0.0, 0.0);
        }
    }
    found
}

#[test]
fn lines_of_a_ramp_are_where_its_values_are_to_half_a_pixel() {
    // A value that is the longitude: its lines are meridians.
    let east = field(|lon, _| lon);
    let (_, cover) = covers(&lined(tile(3, 4, 3, 256), 5.0), &east);
    let px_per_deg = 256.0 * 8.0 / 360.0;
    for row in cover.chunks_exact(256) {
        let found = crossings(row, 0.72);
        let expected: Vec<f64> = (0..=8).map(|i| 5.0 * f64::from(i) * px_per_deg).collect();
        assert_eq!(found.len(), expected.len(), "{found:?}");
        // The first lies on the tile's edge.
        for ((at, width), expected) in found.iter().zip(&expected).skip(1) {
            assert!((at - expected).abs() < 0.5, "{at} is not {expected}");
            assert!((1.0..1.45).contains(width), "{width} pixels wide");
        }
    }
    // One that is the latitude: parallels, on a map that stretches.
    let north = field(|_, lat| lat);
    let (_, cover) = covers(&lined(tile(2, 1, 1, 256), 10.0), &north);
    let column: Vec<f64> = (0..256).map(|y| cover[y * 256 + 100]).collect();
    for (at, width) in crossings(&column, 0.72) {
        let lat = mercator_lat_deg((256.0 + at) / 1024.0);
        let nearest = (lat / 10.0).round() * 10.0;
        let px_per_deg = 1024.0 / 360.0 / lat.to_radians().cos();
        if !(2.0..=254.0).contains(&at) {
            continue;
        }
        assert!((lat - nearest).abs() * px_per_deg < 0.5, "{lat}");
        assert!((1.0..1.5).contains(&width), "{width} pixels wide at {lat}");
    }
}

#[test]
fn the_line_of_zero_is_wider_than_others() {
    let north = field(|_, lat| lat);
    let (_, cover) = covers(&lined(tile(1, 0, 0, 512), 10.0), &north);
    let column: Vec<f64> = (0..512).map(|y| cover[y * 512 + 100]).collect();
    let (equator, cover) = (511, &column);
    assert!(cover[equator] > 0.85, "{}", cover[equator]);
    let others = crossings(&column[..500], 0.72);
    assert!(others.len() >= 3, "{others:?}");
    assert!(others.iter().all(|(_, width)| *width < 1.45), "{others:?}");
}

#[test]
fn lines_are_as_wide_on_a_tilted_globe_as_on_a_map() {
    // Any slanting plane of longitude and latitude.
    let slanted = field(|lon, lat| 0.7 * (lon + 30.0) + 0.5 * lat);
    for view in [
        globe(-30.0, 20.0, 4e6, 200),
        looking_at([-30.0, 10.0], 3e6, [50.0, 55.0], 200),
    ] {
        let (plan, cover) = covers(&lined(view, 5.0), &slanted);
        let params = plan.params_of(plan.whole());
        let value_at = |x: usize, y: usize| {
            let ground = ground_below(&params, [x as u32, y as u32]);
            let [lon, lat] =
                [ground.lon_rad, ground.lat_rad].map(|angle| f64::from(angle).to_degrees());
            // Where sight grazes the ground lines fade.
            let is_clear = ground.rim_px > 30.0 && line_share(&ground) >= 1.0;
            (ground.on_ground && is_clear).then_some(0.7 * (lon + 30.0) + 0.5 * lat)
        };
        let mut seen = 0;
        for y in 1..199 {
            for x in 1..199 {
                let around = [(x, y), (x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)];
                let around: Option<Vec<f64>> =
                    around.iter().map(|(x, y)| value_at(*x, *y)).collect();
                let Some(around) = around else { continue };
                if around[0].abs() > 35.0 || around[0].abs() < 4.0 {
                    continue;
                }
                // By differences of neighbours, which the stage does not take.
                let slope = (0.5 * (around[1] - around[2])).hypot(0.5 * (around[3] - around[4]));
                let off_px = (around[0] - (around[0] / 5.0).round() * 5.0).abs() / slope;
                let expected = (0.6_f64 + 0.5 - off_px).clamp(0.0, 1.0) * 0.72;
                if 5.0 / slope < 6.0 {
                    continue;
                }
                let found = cover[y * 200 + x];
                assert!(
                    (found - expected).abs() < 0.04,
                    "{x} {y}: {found} {expected}"
                );
                seen += usize::from(expected > 0.5);
            }
        }
        assert!(seen > 150, "{seen}");
    }
}

#[test]
fn a_level_field_has_no_line_though_it_lies_on_one() {
    let level = field(|_, _| 10.0);
    for view in [tile(3, 4, 3, 256), globe(0.0, 0.0, 4e6, 100)] {
        let (_, cover) = covers(&lined(view, 10.0), &level);
        assert!(cover.iter().all(|cover| *cover <= 0.0), "{view:?}");
    }
    // One so steep that all would be lines is left free of them.
    let steep = field(|lon, _| 20.0 * (8.0 * lon).sin());
    let (_, cover) = covers(&lined(tile(0, 0, 0, 256), 2.0), &steep);
    assert!(cover.iter().sum::<f64>() < 0.25 * cover.len() as f64);
}

/// A sea at 8 in which cells stand out: every sixth row every fourth, and between these rows three side by side, the middle one more.
pub(crate) fn with_lone_cells(peak: f64) -> Scene {
    field(move |lon, lat| {
        let [col, row] = [lon + 180.0, lat + 90.0].map(|angle| angle.floor() as i64);
        match (row % 6, col % 12) {
            (0, 0 | 4 | 8) | (3, 5 | 7) => peak,
            (3, 6) => peak + 1.0,
            _ => 8.0,
        }
    })
}

#[test]
fn a_line_round_a_single_cell_is_left_out_where_it_is_a_dot() {
    // Lines of 10 round peaks of 11 are a third of a cell away from their middles, each way.
    let covered = |tile_view: View, peak: f64| {
        let scene = with_lone_cells(peak);
        let (plan, cover) = covers(&lined(tile_view, 10.0), &scene);
        let width = plan.size_px()[0] as usize;
        // Rows of pixels beside lone cells, and beside three in a row.
        let most = |first_row: i64| -> f64 {
            let rows = (0..width).filter(|y| {
                let axis = plan.axes[width + y];
                let from_south = 179 - i64::from(axis.index);
                // Farther north a map makes dots large.
                from_south < 130 && (from_south - first_row).rem_euclid(6) < 2
            });
            let pixels = rows.flat_map(|y| &cover[y * width..(y + 1) * width]);
            pixels.copied().fold(0.0, f64::max)
        };
        [most(0), most(3)]
    };
    // A cell of 1.4 pixels: the line would be a pixel wide. Round three cells it is four wide, and stays.
    let [lone, row] = covered(tile(1, 0, 0, 256), 11.0);
    assert!(lone <= 0.0, "{lone}");
    assert!(row > 0.2, "{row}");
    // Of 23 pixels: it is fifteen wide.
    let [lone, row] = covered(tile(5, 16, 15, 256), 11.0);
    assert!(lone > 0.6 && row > 0.6, "{lone} {row}");
    // Between these it comes evenly: where it is widest, at 40 degrees north, it is 4.5 pixels wide and half there.
    let cells = 4.5 / (2048.0 / 360.0) * 40f64.to_radians().cos();
    let peak = 8.0 + 2.0 / (1.0 - cells / 2.0);
    let [lone, _] = covered(tile(3, 4, 3, 256), peak);
    assert!((0.3 * 0.72..=0.52 * 0.72).contains(&lone), "{lone}");
}

#[test]
fn lines_fade_where_sight_grazes_the_sea() {
    let slanted = field(|lon, lat| 0.7 * lon + 0.5 * lat);
    for view in [
        globe(-30.0, 20.0, 2e7, 400),
        looking_at([-30.0, 10.0], 3e6, [50.0, 70.0], 400),
    ] {
        let mut job = lined(view, 10.0);
        job.annotations = Some(contract::annotation::Annotations {
            graticule: contract::annotation::Graticule::every(10.0).ok(),
            ..contract::annotation::Annotations::none()
        });
        let plan = Plan::new(&job, &slanted, u64::MAX).unwrap();
        let params = plan.params_of(plan.whole());
        let mut lines = vec![0; 400 * 400];
        let value = slanted.value.before.cells.content();
        draw_lines(&params, &Inputs::of(&plan, &slanted, value), &mut lines);
        let (mut grazed, mut clear) = (0, [0; 2]);
        for (at, word) in (0..).zip(&lines) {
            let ground = ground_below(&params, [at % 400, at / 400]);
            let cosine = -ground.sight.dot(ground.normal);
            let covers = [word & 4095, word >> 20];
            if ground.on_ground && cosine < 0.1 {
                grazed += 1;
                assert_eq!(covers, [0; 2], "{view:?} {at} {cosine}");
            }
            for (clear, cover) in clear.iter_mut().zip(covers) {
                *clear += usize::from(cosine > 0.3 && cover > 1000);
            }
        }
        assert!(
            grazed > 200 && clear.iter().all(|count| *count > 300),
            "{grazed} {clear:?}"
        );
    }
}

#[test]
fn isolines_have_no_seams() {
    let scene = ocean(ONE_DEGREE);
    let lined = |mode, view| {
        let mut job = job(mode, view);
        job.style.context.isolines = Some(Isolines::Every {
            zero: 0.0,
            step: 10.0 * crate::scenes::GRAM_A_YEAR,
        });
        job
    };
    for renderer in renderers("seams of isolines") {
        for mode in [Mode::Map, Mode::Volume, Mode::Points] {
            for [z, x, y] in [[0, 0, 0], [3, 0, 3]] {
                let draw = |view| renderer.render(&lined(mode, view), &scene).unwrap();
                let large = draw(tile(z as u8, x, y, 512));
                let small = children_of(renderer, &scene, &|view| lined(mode, view), [z, x, y]);
                let pairs = large.rgba8.iter().zip(&small.rgba8);
                let differing = pairs.filter(|(a, b)| a != b).count();
                assert_eq!(differing, 0, "{} {mode} {z}/{x}/{y}", renderer.name());
                let plain = renderer.render(&job(mode, tile(z as u8, x, y, 512)), &scene);
                let (most, pixels) = distance(&large, &plain.unwrap());
                assert!(most > 60 && pixels > 3000, "{mode}: {most} {pixels}");
            }
        }
    }
}

#[test]
fn isolines_are_seen_through_particles_and_on_bare_sea() {
    let scene = ocean(FIVE_DEGREES);
    let draw = |mode: Mode, has_lines: bool| -> Image {
        let mut job = job(mode, globe(-150.0, 0.0, 6e6, 200));
        job.style.globe_surface = true;
        if has_lines {
            job.style.context.isolines = Some(Isolines::Every {
                zero: 0.0,
                step: 10.0 * crate::scenes::GRAM_A_YEAR,
            });
        }
        renderers("isolines")[0].render(&job, &scene).unwrap()
    };
    for mode in Mode::SCALAR {
        let (most, pixels) = distance(&draw(mode, true), &draw(mode, false));
        assert!(most > 60 && pixels > 1000, "{mode}: {most} {pixels}");
    }
}
