//! What is drawn on: which adapter, how much at once, how much memory.

use contract::job::Mode;
use render::{Backend, Renderer};

use crate::device::{gpu, gpu_renderer, renderers};
use crate::scenes::{FIVE_DEGREES, job, ocean, tile};

#[test]
fn as_many_pictures_are_drawn_at_once_as_suit_an_adapter() {
    for renderer in renderers("draws at once") {
        let adapter = renderer.adapter();
        let suited = adapter.draws_at_once().get();
        let cores = std::thread::available_parallelism().unwrap().get();
        let expected = match (adapter.backend(), adapter.is_software()) {
            ("none", true) => cores,
            (_, true) => 2,
            (_, false) => 4,
        };
        assert_eq!(suited, expected, "{adapter:?}");
    }
}

#[test]
fn where_a_graphics_card_is_required_a_software_adapter_is_refused_by_name() {
    let Some(any) = gpu_renderer("a required card") else {
        return;
    };
    match Renderer::new(Backend::HardwareGpu) {
        Ok(renderer) => assert!(!renderer.adapter().is_software() && !any.adapter().is_software()),
        Err(error) => {
            assert!(any.adapter().is_software(), "{error}");
            let text = error.to_string();
            assert!(
                text.contains(any.name()) && text.contains("--require-gpu"),
                "{text}"
            );
            assert!(!error.is_retryable());
        }
    }
}

#[test]
fn a_device_says_what_memory_is_its_own_and_a_program_has_none() {
    let Some(gpu) = gpu("memory of the device") else {
        return;
    };
    let own_bytes = gpu.own_bytes();
    assert_eq!(own_bytes.is_none(), gpu.is_software(), "{own_bytes:?}");
    assert!(own_bytes.is_none_or(|own| own > 1 << 28));
}

#[test]
fn frames_on_the_device_stay_within_their_limit() {
    if gpu_renderer("limit of the device").is_none() {
        return;
    }
    let scene = ocean(FIVE_DEGREES);
    let frame_bytes = FIVE_DEGREES.cell_count() as u64 * 4;
    for (limit, held) in [(3 * frame_bytes, 3), (1, 0), (64 << 20, 5)] {
        let renderer = Renderer::keeping(Backend::Gpu, Some(limit)).unwrap();
        let job = job(Mode::Volume, tile(1, 0, 0, 256));
        renderer.render(&job, &scene).unwrap();
        assert_eq!(renderer.resident_bytes(), held * frame_bytes, "{limit}");
    }
}
