//! What is drawn on: which adapter, how much at once, how much memory.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Barrier, Mutex};
use std::thread;

use contract::job::Mode;
use render::{Adapter, Backend, Renderer};

use crate::device::{gpu, gpu_renderer, renderers};
use crate::scenes::{FIVE_DEGREES, job, ocean, tile};

#[test]
fn as_many_pictures_are_drawn_at_once_as_suit_an_adapter() {
    for renderer in renderers("draws at once") {
        let adapters = renderer.adapters();
        let adapter = &adapters[0];
        let suited = adapter.draws_at_once().get();
        let cores = thread::available_parallelism().unwrap().get();
        let expected = match (adapter.backend(), adapter.is_software()) {
            ("none", true) => cores,
            (_, true) => 2,
            (_, false) => 8,
        };
        assert_eq!(suited, expected, "{adapter:?}");
    }
}

fn is_software(renderer: &Renderer) -> bool {
    renderer.adapters().iter().any(Adapter::is_software)
}

#[test]
fn where_a_graphics_card_is_required_a_software_adapter_is_refused_by_name() {
    let Some(any) = gpu_renderer("a required card") else {
        return;
    };
    match Renderer::new(Backend::HardwareGpu) {
        Ok(renderer) => assert!(!is_software(&renderer) && !is_software(any)),
        Err(error) => {
            assert!(is_software(any), "{error}");
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
fn fields_on_the_device_stay_within_their_limit() {
    if gpu_renderer("limit of the device").is_none() {
        return;
    }
    let scene = ocean(FIVE_DEGREES);
    let field_bytes = FIVE_DEGREES.cell_count() as u64 * 4;
    for (limit, held) in [(3 * field_bytes, 3), (1, 0), (64 << 20, 5)] {
        let renderer = Renderer::keeping(Backend::Gpu, Some(limit)).unwrap();
        let job = job(Mode::Volume, tile(1, 0, 0, 256));
        renderer.render(&job, &scene).unwrap();
        assert_eq!(renderer.resident_bytes(), held * field_bytes, "{limit}");
    }
}

/// Two devices on the adapter of this machine; none if it is switched off.
fn doubled(test: &str) -> Option<Renderer> {
    gpu_renderer(test).map(|_one| Renderer::doubled().unwrap())
}

#[test]
fn several_devices_share_the_work_and_draw_the_same_bytes() {
    let Some(two) = doubled("several devices") else {
        return;
    };
    let one = gpu_renderer("several devices").unwrap();
    assert_eq!(two.draws_at_once().get(), 2 * one.draws_at_once().get());
    assert_eq!(two.name(), format!("2 x {}", one.name()));
    let scene = ocean(FIVE_DEGREES);
    // Each waits in the middle of its picture until the other one has begun.
    let both = Barrier::new(2);
    thread::scope(|scope| {
        for x in 0..2 {
            let (two, scene, both) = (&two, &scene, &both);
            let job = job(Mode::Volume, tile(2, x, 1, 256));
            let expected = one.render(&job, scene).unwrap();
            scope.spawn(move || {
                let (met, asked) = (Mutex::new(vec![]), AtomicBool::new(false));
                let seen = || {
                    if !asked.swap(true, Ordering::AcqRel) {
                        both.wait();
                        *met.lock().unwrap() = two.in_flight();
                        both.wait();
                    }
                    true
                };
                let picture = two.render_while(&job, scene, &seen).unwrap();
                assert_eq!(*met.lock().unwrap(), [1, 1], "one picture on each");
                assert!(picture == expected, "another picture");
            });
        }
    });
    assert_eq!(two.in_flight(), [0, 0]);
}

#[test]
fn while_one_device_is_lost_the_other_draws() {
    let Some(two) = doubled("one lost device") else {
        return;
    };
    // Fields whose numbers follow each other have their places on different devices.
    let scenes = [ocean(FIVE_DEGREES), ocean(FIVE_DEGREES)];
    // A plain map tile would need no device on a processor.
    let job = job(Mode::Sprites, tile(1, 0, 0, 256));
    let draw = |scene| two.render(&job, scene);
    let before = scenes.each_ref().map(|scene| draw(scene).unwrap());
    two.lose_device();
    let drawn = [0, 1, 0, 1].map(|at| (at, draw(&scenes[at])));
    let mut failures = 0;
    for (at, picture) in drawn {
        match picture {
            Ok(picture) => assert!(picture == before[at], "another picture"),
            // The first that meets the loss finds it.
            Err(error) => {
                assert!(error.is_device_fault(), "{error}");
                failures += 1;
            }
        }
    }
    assert!(failures <= 1, "{failures} pictures failed");
    two.renew().unwrap();
    assert!(!two.has_fault());
    assert_eq!(two.device_restarts(), 1, "the one that was lost");
}
