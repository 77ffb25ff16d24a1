//! Trails of a vector over another layer: on the sea, under what rises from it, over what does not; the same whoever draws.

use std::sync::Arc;

use contract::job::{Mode, RenderJob, View};
use render::plan::Plan;
use render::stages::sphere::ground_below;
use render::{Backend, Image, RenderError, Renderer, Scene};
use render_proof::currents::{self, gyres};

use crate::compare::distance;
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, ocean, tile};
use crate::seams::children_of;

const CLOCK_S: f64 = 1e8;

/// A job and the made-up ocean under trails along its gyres, on a finer grid.
pub(crate) fn with_trails(job: RenderJob) -> (Scene, RenderJob) {
    let scene = Scene {
        trails: Some(Arc::new(gyres(ONE_DEGREE))),
        ..ocean(FIVE_DEGREES)
    };
    (scene, currents::under_trails(job, ONE_DEGREE, CLOCK_S))
}

/// The same under a current that knows no land.
fn with_trails_everywhere(job: RenderJob) -> (Scene, RenderJob) {
    let everywhere = |lon: f64, lat: f64| Some([(0.1 * lat).sin(), (0.1 * lon).cos()]);
    let (scene, job) = with_trails(job);
    let vector = currents::scene(ONE_DEGREE, everywhere, everywhere);
    let trails = Some(Arc::new(vector));
    (Scene { trails, ..scene }, job)
}

fn on_globe(mode: Mode) -> RenderJob {
    let mut job = job(mode, globe(-30.0, 25.0, 9e6, 200));
    job.style.globe_surface = true;
    job
}

fn without(job: &RenderJob) -> RenderJob {
    RenderJob {
        trails: None,
        ..job.clone()
    }
}

fn twins() -> Renderer {
    Renderer::new(Backend::Cpu).unwrap()
}

/// How much lighter each pixel is with trails than without.
fn lightened(renderer: &Renderer, scene: &Scene, job: &RenderJob) -> Vec<i32> {
    let drawn = renderer.render(job, scene).unwrap();
    let plain = renderer.render(&without(job), scene).unwrap();
    let light = |image: &Image| -> Vec<i32> {
        let sum = |pixel: &[u8]| pixel[..3].iter().map(|&part| i32::from(part)).sum::<i32>();
        let opaque = |pixel: &[u8]| sum(pixel) * i32::from(pixel[3]) / 255;
        image.rgba8.chunks_exact(4).map(opaque).collect()
    };
    let pairs = light(&drawn).into_iter().zip(light(&plain));
    pairs.map(|(drawn, plain)| drawn - plain).collect()
}

#[test]
fn every_renderer_draws_the_same_trails_in_every_mode_and_they_are_seen() {
    for mode in Mode::SCALAR {
        for own in [on_globe(mode), job(mode, tile(2, 1, 1, 256))] {
            let (scene, job) = with_trails(own);
            let twin = twins().render(&job, &scene).unwrap();
            let (_, seen) = distance(&twin, &twins().render(&without(&job), &scene).unwrap());
            let all = twin.rgba8.len() / 4;
            assert!(seen > all / 50, "{mode}: {seen} of {all}");
            for renderer in renderers("trails") {
                let (most, apart) = distance(&twin, &renderer.render(&job, &scene).unwrap());
                assert!(
                    most <= 6 && apart <= all / 200,
                    "{mode} by {}: {most}, {apart} of {all}",
                    renderer.name()
                );
            }
        }
    }
}

#[test]
fn trails_lie_on_the_sea_and_neither_over_land_nor_beside_the_globe() {
    let (scene, job) = with_trails_everywhere(on_globe(Mode::Map));
    let plan = Plan::new(&job, &scene, u64::MAX).unwrap();
    let params = plan.params_of(plan.whole());
    let renderer = twins();
    let plain = renderer.render(&without(&job), &scene).unwrap();
    let drawn = renderer.render(&job, &scene).unwrap();
    let alone = renderer.render(&job.trails_alone().unwrap(), scene.trails.as_ref().unwrap());
    let alone = alone.unwrap();
    let (mut over_land, mut seen) = (0, 0);
    for y in 0..drawn.height {
        for x in 0..drawn.width {
            let at = (y * drawn.width + x) as usize;
            let is_changed = drawn.pixel(x, y) != plain.pixel(x, y);
            let is_beside = ground_below(&params, [x, y]).rim_px < -0.5;
            let is_land = plan.coast[at] & 255 == 255;
            let has_trail = alone.pixel(x, y)[3] > 60;
            if is_land || is_beside {
                over_land += u32::from(has_trail);
                assert!(!is_changed, "{x}, {y}: land {is_land}, beside {is_beside}");
            }
            seen += u32::from(is_changed);
        }
    }
    assert!(over_land > 100 && seen > 2000, "{over_land}, {seen}");
}

/// Every cell of the ocean has given off, or taken up, as much carbon.
fn lifted(scene: Scene, kg_m2: f32) -> Scene {
    let carbon = vec![kg_m2; scene.grid.cell_count()];
    let field = Arc::new(render::Field::new(carbon));
    let accumulated = Some(render::Interval {
        before: Arc::clone(&field),
        after: field,
        weight: 0.0,
    });
    Scene {
        accumulated,
        ..scene
    }
}

#[test]
fn what_rises_above_the_sea_covers_trails_and_what_sinks_into_it_does_not() {
    for view in [globe(-140.0, 0.0, 6e6, 160), tile(3, 0, 3, 256)] {
        let light = |kg_m2: f32| {
            let mut own = job(Mode::Volume, view);
            own.accumulated = Some(own.value.clone());
            own.style.optical_depth = 12.0;
            own.style.globe_surface = matches!(view, View::Globe { .. });
            let (scene, job) = with_trails_everywhere(own);
            let light = lightened(&twins(), &lifted(scene, kg_m2), &job);
            light.into_iter().map(i32::abs).sum::<i32>()
        };
        let [risen, sunk] = [0.05, -0.05].map(light);
        assert!(sunk > 10 * risen, "{risen} against {sunk} in {view:?}");
    }
}

#[test]
fn a_large_tile_with_trails_is_its_four_children_to_the_byte() {
    for mode in [Mode::Map, Mode::Volume] {
        for renderer in renderers("trails") {
            let (scene, large) = with_trails(job(mode, tile(2, 1, 1, 512)));
            let large = renderer.render(&large, &scene).unwrap();
            let own = |view| with_trails(job(mode, view)).1;
            let small = children_of(renderer, &scene, &own, [2, 1, 1]);
            assert!(large == small, "{mode} by {}", renderer.name());
        }
    }
}

#[test]
fn trails_go_on_where_a_picture_is_drawn_in_parts() {
    let View::Globe { angles, .. } = globe(0.0, 0.0, 1e7, 1) else {
        panic!("it is a globe");
    };
    let view = View::Globe {
        lon_deg: -30.0,
        lat_deg: 25.0,
        height_m: 3e5,
        width_px: 2100,
        height_px: 600,
        angles,
    };
    let (scene, job) = with_trails_everywhere(job(Mode::Map, view));
    for renderer in renderers("trails") {
        let light = lightened(renderer, &scene, &job);
        let seen = |first: usize| {
            let rows = light.chunks_exact(2100);
            rows.flat_map(|row| &row[first..first + 48])
                .filter(|light| light.abs() > 9)
                .count()
        };
        // As much of the second part as of the first.
        let [before, after] = [2000, 2048].map(seen);
        assert!(after > 100 && before > 100, "{before}, {after}");
        let alone = job.trails_alone().unwrap();
        let alone = renderer.render(&alone, scene.trails.as_ref().unwrap());
        let alone = alone.unwrap();
        let (mut missed, mut clear) = (0, 0);
        for (at, light) in light.iter().enumerate() {
            let alpha = alone.rgba8[at * 4 + 3];
            missed += u32::from(alpha == 0 && *light != 0);
            clear += u32::from(alpha == 0);
        }
        assert!(missed == 0 && clear > 1000, "{missed} of {clear}");
    }
}

#[test]
fn trails_without_a_vector_are_refused() {
    let (scene, job) = with_trails(on_globe(Mode::Map));
    let bare = Scene {
        trails: None,
        ..scene
    };
    let refused = twins().render(&job, &bare).unwrap_err();
    assert!(matches!(refused, RenderError::NoTrails), "{refused}");
}
