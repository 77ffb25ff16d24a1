//! The graphics device of the tests: no adapter is a failure unless `NO_GPU=1` says that it is meant.

use std::sync::OnceLock;

use render::gpu::Gpu;
use render::{Backend, Renderer};
use test_data::is_without_gpu;

/// The device, shared by the tests of this run; none if it is switched off.
pub(crate) fn gpu(test: &str) -> Option<&'static Gpu> {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    (!is_without_gpu(test))
        .then(|| GPU.get_or_init(|| Gpu::open().expect("a Vulkan adapter, or NO_GPU=1")))
}

/// A device whose shaders check every index, for planted faults: they must not leave their buffers.
pub(crate) fn checked_gpu(test: &str) -> Option<&'static Gpu> {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    let open = || Gpu::open_checked().expect("a Vulkan adapter, or NO_GPU=1");
    (!is_without_gpu(test)).then(|| GPU.get_or_init(open))
}

/// A renderer on the device, shared likewise.
pub(crate) fn gpu_renderer(test: &str) -> Option<&'static Renderer> {
    static RENDERER: OnceLock<Renderer> = OnceLock::new();
    let open = || Renderer::new(Backend::Gpu).expect("a Vulkan adapter, or NO_GPU=1");
    (!is_without_gpu(test)).then(|| RENDERER.get_or_init(open))
}

/// Both back ends, or the CPU twins alone.
pub(crate) fn renderers(test: &str) -> Vec<&'static Renderer> {
    static CPU: OnceLock<Renderer> = OnceLock::new();
    let cpu = CPU.get_or_init(|| Renderer::new(Backend::Cpu).expect("the twins need no device"));
    std::iter::once(cpu).chain(gpu_renderer(test)).collect()
}
