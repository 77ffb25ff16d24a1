//! Pictures in their surroundings: seams, twins and truths of terrain, sea, coast lines, day and night.

use std::sync::Arc;

use contract::base_map::BaseMap;
use contract::context::{Context, Relief};
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::sun::Subsolar;
use glam::Vec3;
use render::plan::Plan;
use render::scene::{Field, Terrain};
use render::stages::colour::{linear_of, srgb_of};
use render::stages::compose::terrain::tint;
use render::stages::layout::{WATER_BLUE, WATER_GREEN, WATER_RED};
use render::stages::params::Params;
use render::stages::particles::cpu::through_water;
use render::{Image, Scene};

use crate::compare::{assert_images_differ, distance};
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, ocean, tile};

/// A terrain from a formula of longitude and latitude, degrees.
fn terrain(grid: Grid, height_m: impl Fn(f64, f64) -> f64) -> Terrain {
    let cells = (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
    let heights = cells.map(|(row, col)| {
        let place = grid.cell_center(row, col);
        height_m(place.lon, place.lat) as f32
    });
    Terrain {
        grid,
        elevation: Arc::new(Field::new(heights.collect())),
    }
}

/// Mountains and deep sea in waves, with a gap.
fn waves(lon: f64, lat: f64) -> f64 {
    if (lon - 60.0).hypot(lat - 20.0) < 8.0 {
        return f64::NAN;
    }
    let (x, y) = (lon.to_radians(), lat.to_radians());
    2500.0 * (6.0 * x).sin() * (5.0 * y).cos() + 900.0 * (23.0 * x + 17.0 * y).sin() - 1200.0
}

/// The made-up ocean over a terrain of 1 degree.
pub(crate) fn with_terrain(grid: Grid) -> Scene {
    Scene {
        terrain: Some(terrain(ONE_DEGREE, waves)),
        ..ocean(grid)
    }
}

fn over_relief(mut job: RenderJob, exaggeration: f64) -> RenderJob {
    job.relief = Some(Relief {
        grid: ONE_DEGREE,
        field: "frames/made-up-relief/0".parse().unwrap(),
        exaggeration,
    });
    job.style.globe_surface = true;
    job
}

/// A job with all surroundings at once.
pub(crate) fn everything(mode: Mode, view: View) -> RenderJob {
    // Steep enough that every slope is seen in the bytes.
    let mut job = over_relief(job(mode, view), 150.0);
    job.style.context.coastlines = true;
    job.style.context.sea_opacity = 0.3;
    job.style.sun.subsolar = Some(Subsolar {
        lon_deg: -100.0,
        lat_deg: 20.0,
    });
    job
}

#[test]
fn surroundings_have_no_seams() {
    let scene = with_terrain(ONE_DEGREE);
    for renderer in renderers("seams of surroundings") {
        for mode in [Mode::Map, Mode::Volume] {
            for [z, x, y] in [[0, 0, 0], [3, 0, 3]] {
                let draw = |view| renderer.render(&everything(mode, view), &scene).unwrap();
                let large = draw(tile(z as u8, x, y, 512));
                for (east, south) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let small = draw(tile(z as u8 + 1, 2 * x + east, 2 * y + south, 256));
                    let differing = (0..256)
                        .flat_map(|y| (0..256).map(move |x| (x, y)))
                        .filter(|(x, y)| {
                            small.pixel(*x, *y) != large.pixel(x + 256 * east, y + 256 * south)
                        })
                        .count();
                    let name = renderer.name();
                    assert_eq!(differing, 0, "{name} {mode} {z}/{x}/{y} {east} {south}");
                }
            }
        }
    }
}

#[test]
fn surroundings_are_whole_where_the_parts_of_a_globe_picture_meet() {
    let scene = with_terrain(FIVE_DEGREES);
    for renderer in renderers("parts") {
        let draw = |width_px| {
            let view = View::Globe {
                lon_deg: -150.0,
                lat_deg: 10.0,
                height_m: 1.5e7,
                width_px,
                height_px: 64,
                angles: contract::camera::CameraAngles::NADIR,
            };
            renderer
                .render(&everything(Mode::Map, view), &scene)
                .unwrap()
        };
        // The shorter side sets the focal length, so both show the same globe; the wide one is drawn in two parts that
        // meet in the globe's middle.
        let (wide, narrow) = (draw(4096), draw(64));
        let pixels = (0..64).flat_map(|y| (0..64).map(move |x| (2048 - 32 + x, y)));
        let middle = Image {
            width: 64,
            height: 64,
            rgba8: pixels.flat_map(|(x, y)| wide.pixel(x, y)).collect(),
        };
        // The same to a subpixel: an edge of land may fall to the other side of a pixel.
        let (most, pixels) = distance(&middle, &narrow);
        assert!(pixels <= 20, "{most} {pixels}");
    }
}

type Change = fn(&mut RenderJob);

#[test]
fn every_part_of_the_surroundings_is_seen_and_drawn_alike_by_both_back_ends() {
    let scene = with_terrain(FIVE_DEGREES);
    let parts: [(&str, Change); 5] = [
        ("terrain", |j| {
            j.style.context = Context::default();
            j.style.sun.subsolar = None;
        }),
        ("coast", |j| {
            j.relief = None;
            j.style.context.sea_opacity = 0.0;
            j.style.sun.subsolar = None;
        }),
        ("sea", |j| {
            j.relief = None;
            j.style.context.coastlines = false;
            j.style.sun.subsolar = None;
        }),
        ("night", |j| {
            j.relief = None;
            j.style.context = Context::default();
        }),
        ("everything", |_| ()),
    ];
    for view in [tile(1, 0, 0, 256), globe(-150.0, 10.0, 1.5e7, 200)] {
        for mode in [Mode::Map, Mode::Volume] {
            let renderers = renderers("surroundings");
            let mut plain = job(mode, view);
            plain.style.globe_surface = true;
            let plain = renderers[0].render(&plain, &scene).unwrap();
            for (what, reduce) in parts {
                let mut job = everything(mode, view);
                reduce(&mut job);
                let pictures: Vec<Image> = renderers
                    .iter()
                    .map(|renderer| renderer.render(&job, &scene).unwrap())
                    .collect();
                let (most, pixels) = distance(&plain, &pictures[0]);
                // A map has nothing that sinks.
                let is_seen = most >= 16 && pixels > 200 || (what == "sea" && mode == Mode::Map);
                assert!(is_seen, "{what} {mode}: {most} {pixels}");
                for picture in &pictures[1..] {
                    let (most, pixels) = distance(&pictures[0], picture);
                    let all = (picture.width * picture.height) as usize;
                    // An edge of terrain or of a cloud may fall to the other side of a pixel.
                    assert!(
                        most <= 24 && pixels <= all / 200,
                        "{what} {mode}: {most} {pixels}"
                    );
                }
            }
        }
    }
}

/// Red, green and blue of a pixel, 0 to 1.
fn colour(image: &Image, [x, y]: [u32; 2]) -> Vec3 {
    let [r, g, b, a] = image.pixel(x, y);
    assert_eq!(a, 255, "the ground is opaque");
    Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0
}

/// A tile of land alone: no particle covers the ground.
fn bare(height_m: impl Fn(f64, f64) -> f64) -> Scene {
    let nothing = vec![f32::NAN; FIVE_DEGREES.cell_count()];
    let field = Arc::new(Field::new(nothing));
    let mut scene = ocean(FIVE_DEGREES);
    (scene.value.before, scene.value.after) = (Arc::clone(&field), field);
    scene.terrain = Some(terrain(ONE_DEGREE, height_m));
    scene
}

const WATER: Vec3 = Vec3::new(WATER_RED, WATER_GREEN, WATER_BLUE);
/// Sun of the default style: 40 degrees above the horizon in the north-west.
fn default_sun() -> Vec3 {
    let (sin, cos) = 40f32.to_radians().sin_cos();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    Vec3::new(-half * cos, half * cos, sin)
}

fn sunlight(sun: f32) -> f32 {
    0.25 + sun.clamp(0.0, 1.0)
}

#[test]
fn slopes_are_as_light_as_their_angle_to_the_sun_makes_them() {
    // 50 m up for each degree east: 50 m over 111.195 km, times 200.
    let scene = bare(|lon, _| 2000.0 + 50.0 * lon);
    // The tile's southern edge is the equator.
    let job = over_relief(job(Mode::Volume, tile(4, 9, 7, 256)), 200.0);
    for renderer in renderers("slopes") {
        let image = renderer.render(&job, &scene).unwrap();
        for pixel in [[20, 250], [128, 250], [200, 250]] {
            let lon = (9.0 + (f64::from(pixel[0]) + 0.5) / 256.0) / 16.0 * 360.0 - 180.0;
            let slope = (50.0 / 111_194.93 * 200.0) as f32;
            let facing = Vec3::new(-slope, 0.0, 1.0).normalize_or_zero();
            let height_m = (2000.0 + 50.0 * lon) as f32;
            let lit = linear_of(tint(height_m)) * sunlight(facing.dot(default_sun()));
            let expected = srgb_of(lit);
            let found = colour(&image, pixel);
            assert!(
                (found - expected).abs().max_element() < 0.006,
                "{found} {expected}"
            );
        }
    }
}

#[test]
fn the_sea_floor_is_seen_through_as_much_water_as_lies_above_it() {
    let scene = bare(|_, _| -4000.0);
    let mut job = over_relief(job(Mode::Volume, tile(4, 9, 7, 256)), 15.0);
    job.style.context.sea_opacity = 0.5;
    // Half over 100 km: 4 km fifteen times deeper keep the 0.6th power of a half.
    let kept = 0.5f32.powf(0.6);
    let flat = sunlight(default_sun().z);
    let lit = (linear_of(tint(-4000.0)) * kept + WATER * (1.0 - kept)) * flat;
    let expected = srgb_of(lit);
    for renderer in renderers("sea floor") {
        let image = renderer.render(&job, &scene).unwrap();
        let found = colour(&image, [100, 100]);
        assert!(
            (found - expected).abs().max_element() < 0.005,
            "{found} {expected}"
        );
    }
}

/// Share of land in every pixel of a globe view, 0 to 255.
fn land_shares(job: &RenderJob, scene: &Scene) -> Vec<u32> {
    let plan = Plan::for_device(job, scene, u64::MAX).unwrap();
    plan.coast.iter().map(|word| word & 255).collect()
}

#[test]
fn sea_without_data_is_hatched_under_a_relief_too_and_nothing_else_is() {
    const SIDE: u32 = 200;
    let sampled = bare(|lon, _| if lon > -120.0 { 800.0 } else { -3000.0 });
    let mut unsampled = sampled.clone();
    unsampled.domain = Scene::domain_of(sampled.domain.content().iter().map(|_| false));
    let mut all_sampled = sampled;
    all_sampled.domain = Scene::domain_of(unsampled.domain.content().iter().map(|_| true));
    for base_map in [BaseMap::Dark, BaseMap::Light] {
        let mut job = over_relief(job(Mode::Map, globe(-110.0, 25.0, 4e6, SIDE)), 15.0);
        job.accumulated = None;
        job.style.context.base_map = base_map;
        let land = land_shares(&job, &unsampled);
        for renderer in renderers("hatch") {
            let [with, without] =
                [&unsampled, &all_sampled].map(|scene| renderer.render(&job, scene).unwrap());
            let (mut hatched, mut bare_land) = (0, 0);
            for (at, land) in (0..SIDE * SIDE).zip(&land) {
                let (x, y) = (at % SIDE, at / SIDE);
                let levels = |image: &Image| -> i32 {
                    image.pixel(x, y)[..3]
                        .iter()
                        .map(|level| i32::from(*level))
                        .sum()
                };
                let lighter = levels(&with) - levels(&without);
                let is_on_line = (x + y) % 8 < 2;
                match (is_on_line, land) {
                    // All sea, whatever heights the relief has there: its coasts are not those that are drawn.
                    (true, 0) => {
                        assert!(lighter > 12, "{x} {y}: {lighter}");
                        hatched += 1;
                    }
                    (true, 1..=254) => assert!(lighter >= 0, "{x} {y}: {lighter}"),
                    _ => assert_eq!(lighter, 0, "{x} {y} {land}"),
                }
                bare_land += u32::from(*land == 255);
            }
            assert!(hatched > 2000 && bare_land > 5000, "{hatched} {bare_land}");
        }
    }
}

#[test]
fn masked_land_has_no_values_and_the_sea_has_all_of_them() {
    const SIDE: u32 = 200;
    let mut scene = ocean(FIVE_DEGREES);
    // Values everywhere, on land too.
    let values = vec![1e-9; FIVE_DEGREES.cell_count()];
    let field = Arc::new(Field::new(values));
    (scene.value.before, scene.value.after) = (Arc::clone(&field), field);
    scene.domain = Scene::domain_of((0..FIVE_DEGREES.cell_count()).map(|_| true));
    let mut masked = job(Mode::Map, globe(-95.0, 30.0, 4e6, SIDE));
    masked.style.globe_surface = true;
    masked.style.context.mask_land = true;
    let mut whole = masked.clone();
    whole.style.context.mask_land = false;
    // What is seen where nothing is drawn.
    let nothing = vec![f32::NAN; FIVE_DEGREES.cell_count()];
    let nothing = Arc::new(Field::new(nothing));
    let mut empty = scene.clone();
    (empty.value.before, empty.value.after) = (Arc::clone(&nothing), nothing);
    let land = land_shares(&masked, &scene);
    for renderer in renderers("masked land") {
        let [masked, whole, ground] = [(&masked, &scene), (&whole, &scene), (&whole, &empty)]
            .map(|(job, scene)| renderer.render(job, scene).unwrap());
        let mut counts = [0; 3];
        for (at, land) in (0..SIDE * SIDE).zip(&land) {
            let at = |image: &Image| image.pixel(at % SIDE, at / SIDE);
            let kind = match land {
                0 => 0,
                255 => 1,
                _ => 2,
            };
            counts[kind] += 1;
            if kind < 2 {
                let expected = [at(&whole), at(&ground)][kind];
                assert_eq!(at(&masked), expected, "{land}");
            }
        }
        assert!(counts.iter().all(|count| *count > 300), "{counts:?}");
        // Without a globe nothing is left of it there.
        let mut bare = job(Mode::Map, globe(-95.0, 30.0, 4e6, SIDE));
        bare.style.context.mask_land = true;
        let bare = renderer.render(&bare, &scene).unwrap();
        for (at, land) in (0..SIDE * SIDE).zip(&land) {
            let [.., alpha] = bare.pixel(at % SIDE, at / SIDE);
            assert!(
                (*land < 255 || alpha == 0) && (*land > 0 || alpha > 0),
                "{land} {alpha}"
            );
        }
    }
}

#[test]
fn what_sinks_takes_the_colour_of_the_sea_by_its_depth() {
    let mut params = Params::default();
    params.particles.sea_per_m = std::f32::consts::LN_2 / 100_000.0;
    let white = 0x7fff_ffff;
    let water = [WATER_RED, WATER_GREEN, WATER_BLUE];
    for (depth_m, kept) in [(0.0, 1.0), (100_000.0, 0.5), (200_000.0, 0.25), (1e7, 0.0)] {
        let seen = through_water(&params, white, depth_m).to_le_bytes();
        for channel in 0..3 {
            // Coded by the square root of the light.
            let expected = (water[channel] + (1.0 - water[channel]) * kept).sqrt() * 255.0;
            assert!(
                (f32::from(seen[channel]) - expected).abs() <= 0.51,
                "{depth_m} {seen:?}"
            );
        }
        assert_eq!(seen[3], 0x7f, "strength stays");
    }
}

#[test]
fn sinks_fade_into_the_sea_and_sources_do_not() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("sinks") {
        let drawn = |sea_opacity| {
            let mut job = job(Mode::Points, tile(1, 0, 0, 256));
            job.style.context.sea_opacity = sea_opacity;
            renderer.render(&job, &scene).unwrap()
        };
        let (clear, murky) = (drawn(0.0), drawn(0.9));
        assert_images_differ(&clear, &murky);
        // Red dots are sources, high up; blue ones are sinks.
        let lightness = |image: &Image, is_source: bool| {
            let pixels = (0..256).flat_map(|y| (0..256).map(move |x| (x, y)));
            let chosen = pixels.filter(|(x, y)| {
                let [r, _, b, a] = clear.pixel(*x, *y);
                a > 200
                    && if is_source {
                        r > b.saturating_add(90)
                    } else {
                        b > r.saturating_add(90)
                    }
            });
            let levels: Vec<f64> = chosen
                .map(|(x, y)| image.pixel(x, y)[..3].iter().map(|c| f64::from(*c)).sum())
                .collect();
            assert!(levels.len() > 100);
            levels.iter().sum::<f64>() / levels.len() as f64
        };
        let [sources, sinks] =
            [true, false].map(|kind| lightness(&murky, kind) / lightness(&clear, kind));
        assert!(sources > 0.85 && sinks < 0.6, "{sources} {sinks}");
    }
}

#[test]
fn it_is_day_below_the_sun_and_night_on_the_other_side() {
    let scene = ocean(FIVE_DEGREES);
    let lit = |image: &Image, pixel: [u32; 2]| {
        let [r, g, b, a] = image.pixel(pixel[0], pixel[1]);
        (a > 100).then(|| [r, g, b].map(f32::from).iter().sum::<f32>())
    };
    for renderer in renderers("night") {
        for (mode, least, most) in [(Mode::Map, 0.35, 0.39), (Mode::Volume, 0.3, 0.65)] {
            let drawn = |lon_deg: f64| {
                let mut job = job(mode, tile(0, 0, 0, 256));
                let lat_deg = 0.0;
                job.style.sun.subsolar = Some(Subsolar { lon_deg, lat_deg });
                renderer.render(&job, &scene).unwrap()
            };
            let (west, east) = (drawn(-120.0), drawn(60.0));
            // The Pacific at 120 W: day under the one sun, night under the other.
            let ratios: Vec<f32> = (30..55)
                .flat_map(|x| (110..146).map(move |y| [x, y]))
                .filter_map(|at| Some(lit(&east, at)? / lit(&west, at)?))
                .collect();
            let mean = ratios.iter().sum::<f32>() / ratios.len() as f32;
            assert!(
                ratios.len() > 500 && mean > least && mean < most,
                "{mode}: {mean}"
            );
        }
    }
}

#[test]
fn a_globe_is_lit_from_where_the_sun_stands_whatever_the_camera_looks_at() {
    let scene = with_terrain(FIVE_DEGREES);
    let brightness = |image: &Image, x: std::ops::Range<u32>| {
        let pixels = x.flat_map(|x| (80..120).map(move |y| image.pixel(x, y)));
        pixels
            .map(|p| p[..3].iter().map(|c| u64::from(*c)).sum::<u64>())
            .sum::<u64>()
    };
    for renderer in renderers("sun") {
        let drawn = |lon_deg: f64| {
            let mut job = job(Mode::Volume, globe(lon_deg, 0.0, 2.5e7, 200));
            job.style.globe_surface = true;
            let sun = Subsolar {
                lon_deg: 0.0,
                lat_deg: 0.0,
            };
            job.style.sun.subsolar = Some(sun);
            renderer.render(&job, &scene).unwrap()
        };
        // The sun stands over 0: from 90 west its light comes from the right, from 90 east from the left.
        let (west, east) = (drawn(-90.0), drawn(90.0));
        assert!(brightness(&west, 130..150) as f64 > 1.3 * brightness(&west, 50..70) as f64);
        assert!(brightness(&east, 50..70) as f64 > 1.3 * brightness(&east, 130..150) as f64);
    }
}

#[test]
fn a_large_terrain_is_drawn_in_cells_as_large_as_pixels() {
    // Ripples of two cells vanish in the mean instead of making patterns: the ground looks flat.
    let fine = Grid {
        rows: 1440,
        cols: 2880,
        dlat_deg: 0.125,
        dlon_deg: 0.125,
        ..ONE_DEGREE
    };
    let ripple = |lon: f64, _: f64| 1000.0 + 400.0 * (lon * 8.0 * std::f64::consts::PI).sin();
    let mut scene = bare(|_, _| 0.0);
    scene.terrain = Some(terrain(fine, ripple));
    let job = over_relief(job(Mode::Volume, tile(0, 0, 0, 256)), 15.0);
    for renderer in renderers("fine terrain") {
        let image = renderer.render(&job, &scene).unwrap();
        let expected = colour(&image, [10, 128]);
        for x in 0..256 {
            let found = colour(&image, [x, 128]);
            assert!(
                (found - expected).abs().max_element() < 0.01,
                "{x}: {found} {expected}"
            );
        }
    }
}
