//! Globe views from below the sea surface: what hangs there, what hides it, and what water and surface look like.

use std::sync::Arc;

use contract::camera::{CORE_DEPTH_M, CameraAngles};
use contract::earth::SPHERE_RADIUS_M;
use contract::job::{Mode, RenderJob, View};
use glam::Vec3;
use render::scene::{Field, Interval};
use render::stages::colour::{linear_of, srgb_of};
use render::stages::layout::{Col, Particle, Row, Splat, VIEW_GLOBE};
use render::stages::params::{Params, ViewParams};
use render::stages::project;
use render::{Image, Scene};

use crate::compare::distance;
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, GRAM_A_YEAR, ONE_DEGREE, job, ocean};

/// A camera in the sea at a depth, with a heading and a tilt.
pub(crate) fn below(
    [lon_deg, lat_deg]: [f64; 2],
    depth_m: f64,
    [heading_deg, tilt_deg]: [f64; 2],
    [width_px, height_px]: [u32; 2],
) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m: -depth_m,
        width_px,
        height_px,
        angles: CameraAngles {
            heading_deg,
            tilt_deg,
            ..CameraAngles::NADIR
        },
    }
}

/// An ocean whose only data are one column of five degrees, that lies so much deeper than the surface or above it.
fn column(lon: f64, lat: f64, kg_m2: f32) -> Scene {
    let cell = ((90.0 - lat) / 5.0).floor() * 72.0 + ((lon + 180.0) / 5.0).floor();
    let alone = |value: f32| {
        let mut cells = vec![f32::NAN; FIVE_DEGREES.cell_count()];
        cells[cell as usize] = value;
        let field = Arc::new(Field::new(cells));
        Interval {
            before: Arc::clone(&field),
            after: field,
            weight: 0.5,
        }
    };
    Scene {
        value: alone((-40.0 * GRAM_A_YEAR) as f32),
        accumulated: Some(alone(kg_m2)),
        ..ocean(FIVE_DEGREES)
    }
}

fn covered(image: &Image) -> usize {
    image.alpha().filter(|alpha| *alpha > 30).count()
}

const SIZE: [u32; 2] = [120, 80];
/// 80 g C m⁻², drawn 640 km deep.
const SUNK: f32 = -0.08;

#[test]
fn a_plume_before_the_camera_is_in_the_picture_and_one_behind_it_is_not() {
    let scene = column(-137.5, 22.5, SUNK);
    for renderer in renderers("before and behind") {
        let drawn = |heading, tilt| {
            let view = below([-137.5, 7.0], 4e5, [heading, tilt], SIZE);
            let image = renderer.render(&job(Mode::Volume, view), &scene).unwrap();
            covered(&image)
        };
        // Fifteen degrees ahead and as deep as the camera.
        let ahead = drawn(0.0, 90.0);
        assert!(ahead > 300, "{}: {ahead}", renderer.name());
        assert_eq!(drawn(180.0, 90.0), 0, "behind");
        assert_eq!(drawn(0.0, 0.0), 0, "straight down");
        assert!(drawn(0.0, 180.0) < ahead / 4, "straight up");
    }
}

#[test]
fn what_stands_above_the_sea_is_seen_from_below_and_paler_through_the_surface() {
    let scene = column(-137.5, 22.5, -SUNK);
    let view = below([-137.5, 7.0], 2e5, [0.0, 100.0], SIZE);
    for renderer in renderers("through the surface") {
        let bare = renderer.render(&job(Mode::Volume, view), &scene).unwrap();
        assert!(covered(&bare) > 300, "{}", covered(&bare));
        let globe = |scene: &Scene| {
            let mut job = job(Mode::Volume, view);
            job.style.globe_surface = true;
            renderer.render(&job, scene).unwrap()
        };
        let (with, without) = (globe(&scene), globe(&column(-137.5, -52.5, -SUNK)));
        let (most, pixels) = distance(&with, &without);
        assert!(pixels > 200 && most > 8, "{most} {pixels}");
        // The surface leaves a third of what is above it, the water less.
        assert!(most < 110, "{most}");
    }
}

/// One particle in a picture from inside the globe, whose camera stands at a distance from its middle over 0 N 0 E and looks
/// at the particle.
fn seen(eye: f32, place: Vec3, hides: f32) -> bool {
    let eye = Vec3::Y * eye;
    let forward = (place - eye).normalize_or_zero();
    let right = forward.cross(Vec3::Z).normalize_or_zero();
    let mut params = Params {
        view: ViewParams {
            kind: VIEW_GLOBE,
            focal_px: 100.0,
            eye,
            right,
            up: right.cross(forward),
            forward,
            slices: 64,
            hides,
            ..ViewParams::default()
        },
        ..Params::default()
    };
    params.lighting.unit = 256;
    params.particles.sheet_m = 1.0;
    params.projection.max_radius_px = 1e4;
    params.projection.per_earth_radius_m = 1.0 / SPHERE_RADIUS_M as f32;
    let distance = place.length();
    let row = Row {
        sin_lat: place.z / distance,
        cos_lat: place.truncate().length() / distance,
        radius: 0.01,
        depth_gain: 1.0,
        ..Row::default()
    };
    let col = Col {
        sin_lon: place.x / place.truncate().length(),
        cos_lon: place.y / place.truncate().length(),
        ..Col::default()
    };
    let particle = Particle {
        east: 0.5,
        south: 0.5,
        height_m: (distance - 1.0) * SPHERE_RADIUS_M as f32,
        depth: 1.0,
        ..Particle::default()
    };
    let mut splats = [Splat::default()];
    project::cpu::project(&params, &[row], &[col], &[particle], &mut splats);
    splats[0].tau > 0.0
}

#[test]
fn the_core_and_nothing_else_hides_what_lies_beyond_it() {
    let core = (1.0 - CORE_DEPTH_M / SPHERE_RADIUS_M) as f32;
    let at = |degrees: f32, radius: f32| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Vec3::new(sin, cos, 0.0) * radius
    };
    let eye = 0.937;
    for radius in [0.82, 0.95, 1.0, 1.15] {
        // Both lie so far from where the line between them touches the core.
        let limb = (core / eye).acos() + (core / radius).acos();
        let limb = limb.to_degrees();
        assert!(seen(eye, at(limb - 1.0, radius), core), "{radius}");
        assert!(!seen(eye, at(limb + 1.0, radius), core), "{radius}");
        assert!(!seen(eye, at(179.0, radius), core), "{radius}");
        // A smaller core hides less; the sea surface would hide all of it.
        assert!(seen(eye, at(limb + 1.0, radius), core - 0.1), "{radius}");
    }
    // From above, the sea surface hides as before.
    assert!(seen(1.1, at(24.0, 1.0), 1.0) && !seen(1.1, at(25.0, 1.0), 1.0));
}

fn colour(image: &Image, [x, y]: [u32; 2]) -> Vec3 {
    let [r, g, b, a] = image.pixel(x, y);
    assert_eq!(a, 255, "water is all round");
    Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0
}

#[test]
fn the_surface_is_seen_through_as_much_water_as_lies_before_it() {
    // No data anywhere, and the open Pacific above.
    let scene = column(-137.5, 22.5, SUNK);
    let drawn = |renderer: &render::Renderer, depth_m: f64, tilt: f64, sea_opacity: f64| {
        let view = below([-140.0, -10.0], depth_m, [0.0, tilt], [17, 17]);
        let mut job = job(Mode::Volume, view);
        job.style.globe_surface = true;
        job.style.context.sea_opacity = sea_opacity;
        (colour(&renderer.render(&job, &scene).unwrap(), [8, 8]), job)
    };
    for renderer in renderers("water") {
        let (near, job) = drawn(renderer, 1e3, 180.0, 0.0);
        let plan = render::plan::Plan::new(&job, &scene, u64::MAX).unwrap();
        let view = &plan.params.view;
        // A kilometre of water takes nothing that is seen: this is the surface, hatched or not as 8 pixels have it.
        let surface = linear_of(near);
        for (depth_m, sea_opacity, kept) in [
            (4e5, 0.0, (-0.1f32).exp()),
            (1e5, 0.3, 0.7),
            (3e5, 0.3, 0.7 * 0.7 * 0.7),
        ] {
            let (found, _) = drawn(renderer, depth_m, 180.0, sea_opacity);
            let expected = srgb_of(view.water * (1.0 - kept) + surface * kept);
            assert!(
                (found - expected).abs().max_element() < 0.012,
                "{depth_m} {sea_opacity}: {found} {expected}"
            );
        }
        // The deep is darker than what is level, and that than the surface above.
        let light = |tilt| drawn(renderer, 4e5, tilt, 0.2).0.element_sum();
        let [deep, level, up] = [0.0, 90.0, 180.0].map(light);
        assert!(
            deep < 0.5 * level && level < 0.8 * up,
            "{deep} {level} {up}"
        );
    }
}

#[test]
fn every_tilt_and_mode_gives_a_picture_that_both_back_ends_draw_alike() {
    let scene = ocean(FIVE_DEGREES);
    let renderers = renderers("from below");
    for (depth_m, heading, tilt) in [
        (1e3, 0.0, 180.0),
        (1e3, 120.0, 90.0),
        (4e5, 30.0, 110.0),
        (4e5, 200.0, 60.0),
        (1e6, 0.0, 0.0),
        (1e6, 300.0, 130.0),
    ] {
        for mode in Mode::SCALAR {
            let view = below([-128.0, 36.0], depth_m, [heading, tilt], [96, 64]);
            let mut job = job(mode, view);
            job.style.globe_surface = true;
            job.style.context.coastlines = true;
            job.style.context.borders = true;
            let pictures: Vec<Image> = renderers
                .iter()
                .map(|renderer| renderer.render(&job, &scene).unwrap())
                .collect();
            assert!(pictures[0].alpha().all(|alpha| alpha == 255));
            for picture in &pictures[1..] {
                let (most, pixels) = distance(&pictures[0], picture);
                assert!(
                    most <= 24 && pixels <= 96 * 64 / 200,
                    "{depth_m} {tilt} {mode}: {most} {pixels}"
                );
            }
        }
    }
}

#[test]
fn a_map_from_below_is_the_map_from_above_turned_over() {
    let scene = ocean(ONE_DEGREE);
    let map = |view: View| -> RenderJob { job(Mode::Map, view) };
    for renderer in renderers("map from below") {
        // Straight up and straight down at the same place: what is in the east from above is in the west from below. From
        // far enough above, and with as much less in view, both see the same ground.
        let angles = |tilt_deg, field_of_view_deg| CameraAngles {
            tilt_deg,
            field_of_view_deg,
            ..CameraAngles::NADIR
        };
        let view = |height_m, angles| View::Globe {
            lon_deg: -100.0,
            lat_deg: 12.0,
            height_m,
            width_px: 65,
            height_px: 65,
            angles,
        };
        let above = renderer.render(&map(view(1e5, angles(0.0, 40.0))), &scene);
        let beneath = renderer.render(&map(view(-1e5, angles(180.0, 40.0))), &scene);
        let (above, beneath) = (above.unwrap(), beneath.unwrap());
        let mut rgba8 = vec![];
        for y in 0..65 {
            for x in 0..65 {
                // A camera that looks up with its heading north has north at the lower edge.
                rgba8.extend(beneath.pixel(x, 64 - y));
            }
        }
        let turned = Image { rgba8, ..beneath };
        let (most, pixels) = distance(&above, &turned);
        assert!(most <= 12 && pixels < 65 * 65 / 4, "{most} {pixels}");
        let mirrored = |x: u32, y: u32| turned.pixel(64 - x, y);
        let other: usize = (0..65)
            .flat_map(|y| (0..65).map(move |x| (x, y)))
            .filter(|(x, y)| above.pixel(*x, *y) != mirrored(*x, *y))
            .count();
        assert!(other > 65 * 65 / 2, "the picture has a left and a right");
    }
}
