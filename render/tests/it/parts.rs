//! Pictures drawn in parts, by several who share them: every pixel is that of the whole.

use std::sync::Mutex;

use contract::job::{Mode, RenderJob, View};
use render::plan::Part;
use render::{Image, Renderer, Scene};
use render_proof::currents;

use crate::context::{everything, with_terrain};
use crate::device::{gpu_renderer, renderers};
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, ocean, tile};
use crate::trails::with_trails;

/// Strips, a piece from the middle, one pixel: where screen tiles begin and where they do not.
fn parts([width, height]: [u32; 2]) -> [Part; 4] {
    let part = |origin_px, size_px| Part { origin_px, size_px };
    [
        part([0, 0], [width / 2 / 16 * 16, height]),
        part(
            [width / 2 / 16 * 16, 0],
            [width - width / 2 / 16 * 16, height],
        ),
        part([37, 21], [50, 43]),
        part([width - 1, height - 1], [1, 1]),
    ]
}

fn cut(image: &Image, part: Part) -> Vec<u8> {
    let [left, top] = part.origin_px;
    let [width, height] = part.size_px;
    let row = |y: u32| {
        let at = (y * image.width + left) as usize * 4;
        &image.rgba8[at..at + width as usize * 4]
    };
    (top..top + height).flat_map(row).copied().collect()
}

fn whole_and_parts(renderer: &Renderer, job: &RenderJob, scene: &Scene, what: &str) {
    let whole = renderer.render(job, scene).unwrap();
    assert!(
        whole.alpha().any(|alpha| alpha > 0),
        "{what}: nothing there"
    );
    for part in parts(job.view.size_px()) {
        let drawn = renderer
            .render_part(job, scene, Some(part), &|| true)
            .unwrap();
        assert_eq!([drawn.width, drawn.height], part.size_px);
        let name = renderer.name();
        assert!(
            drawn.rgba8 == cut(&whole, part),
            "{what}: {part:?} by {name}"
        );
    }
}

#[test]
fn a_part_of_a_picture_has_the_bytes_of_the_whole() {
    let near = globe(-30.0, 25.0, 4e6, 150);
    let scene = with_terrain(ONE_DEGREE);
    let gyres = currents::gyres(ONE_DEGREE);
    for renderer in renderers("parts of pictures") {
        for mode in Mode::SCALAR {
            let job = everything(mode, near);
            whole_and_parts(renderer, &job, &scene, &format!("{mode}"));
        }
        whole_and_parts(renderer, &currents::job(near, 1e8), &gyres, "flow");
        let (scene, under) = with_trails(job(Mode::Volume, near));
        whole_and_parts(renderer, &under, &scene, "trails");
    }
}

#[test]
fn what_is_no_part_of_a_picture_is_refused() {
    let scene = ocean(FIVE_DEGREES);
    let in_view = job(Mode::Map, globe(0.0, 0.0, 1e7, 256));
    let in_tile = job(Mode::Map, tile(1, 0, 0, 256));
    for (job, origin_px, size_px) in [
        (&in_view, [0, 0], [257, 1]),
        (&in_view, [256, 0], [1, 1]),
        (&in_view, [0, 0], [0, 4]),
        (&in_view, [u32::MAX, 0], [2, 1]),
        (&in_tile, [0, 0], [128, 256]),
    ] {
        for renderer in renderers("no parts") {
            let part = Part { origin_px, size_px };
            let refused = renderer
                .render_part(job, &scene, Some(part), &|| true)
                .unwrap_err();
            assert!(refused.is_bad_request(), "{part:?}: {refused}");
        }
    }
}

#[test]
fn idle_devices_share_a_large_picture() {
    let test = "a large picture on two devices";
    let Some(one) = gpu_renderer(test) else {
        return;
    };
    let two = Renderer::doubled().unwrap();
    let scene = ocean(FIVE_DEGREES);
    let mut job = job(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 64));
    if let View::Globe { width_px, .. } = &mut job.view {
        *width_px = 2200;
    }
    let seen = Mutex::new(vec![]);
    let look = || {
        seen.lock().unwrap().push(two.in_flight());
        true
    };
    let shared = two.render_while(&job, &scene, &look).unwrap();
    assert!(shared == one.render(&job, &scene).unwrap());
    let seen = seen.into_inner().unwrap();
    assert!(
        seen.contains(&vec![1, 1]),
        "one device drew alone: {seen:?}"
    );
    assert_eq!(two.in_flight(), [0, 0]);
}
