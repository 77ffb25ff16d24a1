//! Lists that are long beyond the others: cut into parts, they come to the same picture.

use contract::grid::Grid;
use contract::job::{Mode, RenderJob};
use render::frame_context::{FrameContext, SceneBuffers};
use render::gpu::{Gpu, Slot, Workspace};
use render::passes;
use render::passes::scatter::{self, Scatter};
use render::passes::splat::{self, Splats};
use render::plan::Plan;
use render::playback::Playback;
use render::stages::bin::{self, Bin};
use render::stages::eye::{self, Eye};
use render::stages::layout::{Entry, MOST_HOT_PARTS, MOST_PART_ENTRIES, NEVER_LONG, NO_LIST};
use render::stages::light::Light;
use render::stages::sizes::list_count;
use render::{Field, Interval, Scene};

use crate::device::{checked_gpu, gpu};
use crate::scenes::{GRAM_A_YEAR, globe, job, tile};

/// Pictures as small as these have no list that holds others up: here lists are long beforehand.
const LONG: u32 = MOST_PART_ENTRIES;

/// Cells of a quarter of a degree all over the world: round a pole they crowd.
const QUARTER_DEGREE: Grid = Grid {
    rows: 720,
    cols: 1440,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.25,
    dlon_deg: 0.25,
};

/// A sea without land.
fn world(grid: &Grid) -> Scene {
    let field = |shift: usize| {
        let cells = 0..grid.cell_count();
        let value = |cell: usize| ((cell * 7 + shift) % 61) as f32 - 30.0;
        std::sync::Arc::new(Field::new(
            cells.map(|cell| value(cell) * GRAM_A_YEAR as f32).collect(),
        ))
    };
    Scene {
        grid: *grid,
        domain: Scene::domain_of(std::iter::repeat_n(true, grid.cell_count())),
        value: Interval {
            before: field(0),
            after: field(9),
            weight: 0.4,
        },
        accumulated: None,
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    }
}

struct Drawn {
    pixels: Vec<u8>,
    longest: u32,
    parts: Vec<u32>,
}

fn draw(
    gpu: &Gpu,
    plan: &Plan,
    scene: &SceneBuffers,
    long_list: u32,
    sources: [&str; 2],
    entry: &'static str,
) -> Drawn {
    let mut workspace = Workspace::default();
    let mut params = plan.params_of(plan.whole());
    params.lists.entry_capacity = params.cells.splat_count * 8;
    params.lists.long_list = long_list;
    let mut frame = FrameContext::new(gpu, &mut workspace, plan, params, scene.clone()).unwrap();
    let entry_bytes = u64::from(params.lists.entry_capacity) * size_of::<Entry>() as u64;
    frame.room(Slot::Entries, entry_bytes).unwrap();
    let part_bytes = u64::from(1 + MOST_HOT_PARTS) * 4;
    frame.room(Slot::HotParts, part_bytes).unwrap();
    Splats::new(gpu, splat::SOURCE, passes::probes(gpu))
        .record(&mut frame)
        .unwrap();
    if params.lighting.mode == 1 {
        Light::new(gpu).record(&mut frame).unwrap();
    }
    Bin::new(gpu, sources[0]).record(&mut frame).unwrap();
    Scatter::new(gpu, scatter::SOURCE, passes::probes(gpu))
        .record(&mut frame)
        .unwrap();
    let eye = Eye::of(gpu, sources[1], entry);
    eye.record(&mut frame).unwrap();
    let [image, counts, parts] =
        [Slot::Image, Slot::Counts, Slot::HotParts].map(|slot| frame.room(slot, 4).unwrap());
    let lists = u64::from(list_count(&params)) * 4;
    let image_bytes = frame.pixel_count() * 4;
    let read = [
        (&image, 0, image_bytes),
        (&counts, 0, lists),
        (&parts, 0, part_bytes),
    ];
    let [pixels, ends, parts] = frame.recorder.download_parts(read).unwrap();
    let ends: Vec<u32> = bytemuck::pod_collect_to_vec(&ends);
    let lengths = ends.windows(2).map(|pair| pair[1] - pair[0]);
    Drawn {
        longest: lengths.max().unwrap(),
        parts: bytemuck::pod_collect_to_vec(&parts),
        pixels,
    }
}

fn pole(mode: Mode) -> RenderJob {
    let mut job = job(mode, globe(10.0, 88.0, 9.0e6, 192));
    job.style.particles_per_cell = 1;
    job
}

#[test]
fn a_list_in_parts_is_a_list_as_a_whole() {
    let Some(gpu) = gpu("long lists") else { return };
    let scene = world(&QUARTER_DEGREE);
    let buffers = Playback::upload(gpu, &scene).unwrap();
    for mode in [Mode::Volume, Mode::Sprites] {
        let plan = Plan::for_device(&pole(mode), &scene, gpu.most_buffer_bytes()).unwrap();
        assert!(plan.is_crowded);
        let draw =
            |long_list, sources, entry| draw(gpu, &plan, &buffers, long_list, sources, entry);
        let sources = [bin::SOURCE, eye::SOURCE];
        let whole = draw(NEVER_LONG, sources, eye::SHARED);
        assert_eq!(whole.parts[0], 0);
        assert!(whole.longest > 3 * MOST_PART_ENTRIES, "{}", whole.longest);
        let cut = draw(LONG, sources, eye::SHARED);
        let taken = cut.parts[0] as usize;
        assert!(
            taken >= 8 && taken < MOST_HOT_PARTS as usize,
            "{taken} parts"
        );
        assert!(cut.parts[1..=taken].iter().all(|list| *list != NO_LIST));
        assert!(cut.pixels == whole.pixels, "{mode}");
        // Without room for parts, lists are summed up whole.
        let narrow = |source: &str| {
            source.replace("MOST_HOT_PARTS: u32 = 8192u", "MOST_HOT_PARTS: u32 = 5u")
        };
        let [few, few_eye] = [narrow(bin::SOURCE), narrow(eye::SOURCE)];
        assert!(few != bin::SOURCE);
        let short = draw(LONG, [&few, &few_eye], eye::SHARED);
        assert!(short.parts[0] as usize >= taken && short.pixels == whole.pixels);
        let alone = draw(LONG, sources, eye::ALONE);
        let mut apart = alone.pixels.iter().zip(&whole.pixels);
        assert!(apart.all(|(a, b)| a.abs_diff(*b) <= 1), "{mode}");
    }
}

#[test]
fn only_views_of_poles_and_limbs_look_for_long_lists() {
    let scene = world(&QUARTER_DEGREE);
    let is_crowded = |view| {
        let plan = Plan::for_device(&job(Mode::Volume, view), &scene, u64::MAX).unwrap();
        assert_eq!(
            plan.params_of(plan.whole()).lists.long_list == NEVER_LONG,
            !plan.is_crowded
        );
        plan.is_crowded
    };
    assert!(!is_crowded(globe(10.0, 20.0, 2.0e6, 64)));
    assert!(is_crowded(globe(10.0, -80.0, 2.0e6, 64)), "a pole");
    assert!(is_crowded(globe(10.0, 20.0, 2.0e7, 64)), "the limb");
    assert!(!is_crowded(tile(3, 2, 1, 256)));
}

#[test]
fn a_part_that_is_left_out_is_seen() {
    let Some(gpu) = checked_gpu("long lists, a fault") else {
        return;
    };
    let scene = world(&QUARTER_DEGREE);
    let buffers = Playback::upload(gpu, &scene).unwrap();
    let plan = Plan::for_device(&pole(Mode::Volume), &scene, gpu.most_buffer_bytes()).unwrap();
    let draw = |sources: [&str; 2]| draw(gpu, &plan, &buffers, LONG, sources, eye::SHARED);
    let right = [bin::SOURCE, eye::SOURCE];
    let expected = draw(right);
    for (stage, from, to) in [
        (1, "part < end; part++", "part + 1u < end; part++"),
        (
            1,
            "(part + 1u - hot_lists[list]) * part_entries()",
            "(part + 1u - hot_lists[list]) * 0u",
        ),
        (
            0,
            "select(0u, first + 1u, fits)",
            "select(0u, first + 2u, fits)",
        ),
    ] {
        let faulty = right[stage].replace(from, to);
        assert!(faulty != right[stage], "{from}");
        let mut sources = right;
        sources[stage] = &faulty;
        let wrong = draw(sources);
        assert!(wrong.pixels != expected.pixels, "{to}");
    }
}
