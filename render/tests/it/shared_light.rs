//! Light made once for a block of tiles, and for the parts of a picture: the bytes that light of one's own gives.

use std::thread;

use contract::job::{Mode, RenderJob};
use render::frame::Stages;
use render::gpu::Workspace;
use render::plan::Plan;
use render::playback::Playback;
use render::{Backend, Image, LightCounts, Renderer, Scene};

use crate::device::gpu;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, clouded, globe, job, ocean, tile};

/// A renderer that has drawn nothing; none without a device.
fn fresh(test: &str) -> Option<Renderer> {
    gpu(test).map(|_gpu| Renderer::new(Backend::Gpu).unwrap())
}

fn jobs(size_px: u32, tiles: &[[u32; 3]], change: &dyn Fn(&mut RenderJob)) -> Vec<RenderJob> {
    let one = |&[z, x, y]: &[u32; 3]| {
        let mut job = job(Mode::Volume, tile(z as u8, x, y, size_px));
        change(&mut job);
        job
    };
    tiles.iter().map(one).collect()
}

/// Every tile in light of its own.
fn alone(test: &str, jobs: &[RenderJob], scene: &Scene) -> Option<Vec<Image>> {
    let draw = |job: &RenderJob| {
        let renderer = fresh(test)?;
        let image = renderer.render(job, scene).unwrap();
        assert_eq!(renderer.light_counts(), LightCounts::default());
        Some(image)
    };
    jobs.iter().map(draw).collect()
}

#[test]
fn tiles_in_the_light_of_their_block_are_those_in_light_of_their_own() {
    let test = "shared light";
    let scene = ocean(ONE_DEGREE);
    let low_sun = |job: &mut RenderJob| {
        job.style.sun.azimuth_deg = 250.0;
        job.style.sun.elevation_deg = 21.0;
    };
    let shaped = |job: &mut RenderJob| {
        job.style.transfer.size = "-1e-9:1,0:0.5,1e-9:0.9".parse().unwrap();
        job.style.transfer.opacity = "-1e-9:1,0:0.2,1e-9:1".parse().unwrap();
    };
    // Within a block; at the date line; at the edge of the map; large tiles; the whole world.
    let inner = [[4, 4, 7], [4, 5, 7], [4, 7, 4], [4, 6, 6]];
    for (size_px, tiles, change) in [
        (
            256,
            &inner[..],
            &(|_: &mut RenderJob| {}) as &dyn Fn(&mut RenderJob),
        ),
        (256, &inner[..2], &low_sun),
        (256, &inner[..2], &shaped),
        (256, &[[3, 0, 3], [3, 3, 2]], &low_sun),
        (256, &[[2, 3, 0], [2, 0, 3]], &|_| {}),
        (512, &[[3, 2, 3], [3, 3, 3]], &|_| {}),
        (256, &[[1, 0, 0], [1, 1, 1]], &|_| {}),
    ] {
        let jobs = jobs(size_px, tiles, change);
        let Some(alone) = alone(test, &jobs, &scene) else {
            return;
        };
        let renderer = fresh(test).unwrap();
        for (i, (job, alone)) in jobs.iter().zip(&alone).enumerate() {
            assert!(alone.alpha().any(|alpha| alpha > 100));
            assert!(
                renderer.render(job, &scene).unwrap() == *alone,
                "{:?}",
                job.view
            );
            let counts = renderer.light_counts();
            assert_eq!((counts.made, counts.used), (u64::from(i > 0), i as u64));
            assert_eq!(counts.bytes > 0, i > 0);
        }
        // The first one again, in what others have made.
        assert!(renderer.render(&jobs[0], &scene).unwrap() == alone[0]);
        assert_eq!(renderer.light_counts().used, jobs.len() as u64);
    }
}

#[test]
fn another_instant_sun_style_or_product_has_light_of_its_own() {
    let test = "kinds of light";
    let Some(renderer) = fresh(test) else { return };
    let scene = ocean(FIVE_DEGREES);
    let jobs = jobs(256, &[[3, 1, 3], [3, 2, 3]], &|_| {});
    let draw = |job: &RenderJob, scene: &Scene| renderer.render(job, scene).unwrap();
    let first = draw(&jobs[0], &scene);
    draw(&jobs[1], &scene);
    assert_eq!(renderer.light_counts().made, 1);
    let mut other_sun = jobs[0].clone();
    other_sun.style.sun.azimuth_deg += 90.0;
    let mut thinner = jobs[0].clone();
    thinner.style.optical_depth *= 0.5;
    let mut later = scene.clone();
    later.value.weight = 0.31;
    let mut heavier = scene.clone();
    heavier.accumulated.as_mut().unwrap().weight = 0.61;
    let other_product = clouded(FIVE_DEGREES);
    for (job, scene) in [
        (&other_sun, &scene),
        (&thinner, &scene),
        (&jobs[0], &later),
        (&jobs[0], &heavier),
        (&jobs[0], &other_product),
    ] {
        let picture = draw(job, scene);
        assert!(picture != first, "something else is seen");
        assert_eq!(
            renderer.light_counts().made,
            1,
            "a first tile makes its own"
        );
        let alone = fresh(test).unwrap().render(job, scene).unwrap();
        assert!(picture == alone);
    }
    let (made, used) = (renderer.light_counts().made, renderer.light_counts().used);
    assert_eq!((made, used), (1, 1));
}

#[test]
fn many_threads_make_the_light_of_a_block_once() {
    let test = "light on threads";
    let scene = ocean(FIVE_DEGREES);
    let tiles: Vec<[u32; 3]> = (0..16).map(|i| [4, 4 + i % 4, 4 + i / 4]).collect();
    let jobs = jobs(256, &tiles, &|_| {});
    let Some(renderer) = fresh(test) else { return };
    let pictures: Vec<Image> = thread::scope(|scope| {
        let draw = |job| {
            let (renderer, scene) = (&renderer, &scene);
            scope.spawn(move || renderer.render(job, scene).unwrap())
        };
        let threads: Vec<_> = jobs.iter().map(draw).collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    let counts = renderer.light_counts();
    assert_eq!((counts.made, counts.used), (1, 15));
    for (job, picture) in jobs.iter().zip(&pictures).step_by(5) {
        assert!(fresh(test).unwrap().render(job, &scene).unwrap() == *picture);
    }
}

#[test]
fn parts_of_a_picture_lie_in_one_light() {
    let test = "light of parts";
    let Some(gpu) = gpu(test) else { return };
    let scene = ocean(FIVE_DEGREES);
    let mut job = job(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 96));
    if let contract::job::View::Globe { width_px, .. } = &mut job.view {
        *width_px = 2200;
    }
    let renderer = fresh(test).unwrap();
    let shared = renderer.render(&job, &scene).unwrap();
    // Every part with light of its own.
    let stages = Stages::new(gpu);
    let plan = Plan::for_device(&job, &scene, gpu.most_buffer_bytes()).unwrap();
    let buffers = Playback::upload(gpu, &scene).unwrap();
    let parts = plan.parts();
    assert_eq!(parts.len(), 2);
    for part in parts {
        let mut workspace = Workspace::default();
        let own = stages
            .draw(gpu, &mut workspace, &plan, part, &buffers)
            .unwrap();
        let [left, top] = part.origin_px;
        for (y, row) in (0..).zip(own.chunks_exact(part.size_px[0] as usize * 4)) {
            let at = ((top + y) * shared.width + left) as usize * 4;
            assert!(
                shared.rgba8[at..at + row.len()] == *row,
                "row {y} of {part:?}"
            );
        }
    }
}

#[test]
fn light_that_is_not_the_blocks_is_seen() {
    let test = "wrong light";
    let Some(gpu) = gpu(test) else { return };
    let scene = ocean(FIVE_DEGREES);
    let stages = Stages::new(gpu);
    let job = job(Mode::Volume, tile(3, 2, 3, 256));
    let mut plan = Plan::for_device(&job, &scene, gpu.most_buffer_bytes()).unwrap();
    let buffers = Playback::upload(gpu, &scene).unwrap();
    let draw = |plan: &Plan, light: Option<&wgpu::Buffer>| {
        let part = plan.whole();
        let mut workspace = Workspace::default();
        let mut buffers = buffers.clone();
        buffers.light = light.cloned();
        stages
            .draw(gpu, &mut workspace, plan, part, &buffers)
            .unwrap()
    };
    let own = draw(&plan, None);
    let light = stages
        .shared_light(gpu, &mut Workspace::default(), &plan, &buffers)
        .unwrap();
    let dark = gpu.room("no light", light.size()).unwrap();
    plan.params.light_on = render::stages::layout::LIGHT_GIVEN;
    assert!(draw(&plan, Some(&light)) == own);
    assert!(draw(&plan, Some(&dark)) != own, "no shadows at all");
    plan.params.light_origin_x += plan.params.light_unit;
    assert!(draw(&plan, Some(&light)) != own, "a texel off");
}
