//! Light made once for all parts of a picture: the bytes that light of their own gives.

use contract::job::Mode;
use render::frame::Stages;
use render::gpu::Workspace;
use render::plan::Plan;
use render::playback::Playback;
use render::{Backend, Renderer};

use crate::device::gpu;
use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

/// A renderer that has drawn nothing; none without a device.
fn fresh(test: &str) -> Option<Renderer> {
    gpu(test).map(|_gpu| Renderer::new(Backend::Gpu).unwrap())
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
fn light_that_is_not_the_pictures_is_seen() {
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
    plan.params.lighting.mode = render::stages::layout::LIGHT_GIVEN;
    assert!(draw(&plan, Some(&light)) == own);
    assert!(draw(&plan, Some(&dark)) != own, "no shadows at all");
    plan.params.projection.light_origin.x += plan.params.lighting.unit;
    assert!(draw(&plan, Some(&light)) != own, "a texel off");
}
