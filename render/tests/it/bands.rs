//! Fields that are too large to be held whole: the device holds the rows that a picture shows, and draws the same bytes.

use std::ops::Range;

use contract::grid::Grid;
use contract::job::{Mode, RenderJob};
use render::Scene;
use render::frame::Stages;
use render::frame_context::SceneBuffers;
use render::gpu::{Gpu, Workspace};
use render::plan::Plan;
use render::scene::Cells;

use crate::device::gpu;
use crate::scenes::{globe, job, ocean, tile};

const TALL: Grid = Grid {
    rows: 1024,
    cols: 300,
    north_deg: 60.0,
    west_deg: -150.0,
    dlat_deg: 0.1,
    dlon_deg: 0.1,
};

fn held(gpu: &Gpu, scene: &Scene, cells: Range<usize>) -> SceneBuffers {
    let send = |cells: &Cells<f32>, part| gpu.storage("field", &cells.content()[part]);
    let domain = &scene.domain.content()[cells.clone()];
    let domain = gpu.storage("domain", domain).unwrap();
    SceneBuffers::of(scene, &cells, false, domain, send).unwrap()
}

fn drawn(gpu: &Gpu, stages: &Stages, plan: &Plan, buffers: &SceneBuffers) -> Vec<u8> {
    let part = plan.whole();
    stages
        .draw(gpu, &mut Workspace::default(), plan, part, buffers)
        .unwrap()
}

#[test]
fn a_field_that_is_not_held_whole_is_drawn_from_the_rows_that_are_shown() {
    let Some(gpu) = gpu("fields in bands") else {
        return;
    };
    let stages = Stages::new(gpu);
    let scene = ocean(TALL);
    let views = [
        tile(5, 3, 15, 256),
        globe(-135.0, 5.0, 1.2e6, 160),
        globe(-135.0, 59.0, 1.2e6, 160),
    ];
    for view in views {
        for mode in Mode::SCALAR {
            let mut job: RenderJob = job(mode, view);
            job.style.globe_surface = true;
            let plan = |most| Plan::holding(&job, &scene, gpu.most_buffer_bytes(), most).unwrap();
            let (whole, banded) = (plan(u64::MAX), plan(0));
            assert_eq!(whole.held_cells(), 0..TALL.cell_count());
            let cells = banded.held_cells();
            assert!(cells.len() < TALL.cell_count() && !cells.is_empty());
            assert_eq!(cells.start % (256 * 300), 0, "neighbours share bands");
            let expected = drawn(gpu, &stages, &whole, &held(gpu, &scene, whole.held_cells()));
            assert!(expected.iter().any(|byte| *byte != 0));
            let buffers = held(gpu, &scene, cells.clone());
            assert!(
                drawn(gpu, &stages, &banded, &buffers) == expected,
                "{mode} {view:?}"
            );
            // Cells that are off by a row are seen.
            let end = (cells.end + 300).min(TALL.cell_count());
            let shifted = held(gpu, &scene, end - cells.len()..end);
            if end != cells.end {
                assert!(drawn(gpu, &stages, &banded, &shifted) != expected, "{mode}");
            }
        }
    }
}

#[test]
fn a_band_that_no_buffer_holds_is_refused_with_the_reason() {
    let scene = ocean(TALL);
    let job = job(Mode::Map, tile(5, 3, 15, 256));
    let refused = Plan::holding(&job, &scene, 1 << 16, 0).unwrap_err();
    assert!(refused.to_string().contains("rows of a field"), "{refused}");
}
