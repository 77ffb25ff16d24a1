//! One compiled entry point and the layout of its bindings.

use std::borrow::Cow;

use super::pipelines::Pipelines;
use super::{Checks, Gpu};

/// Uniform buffers that one kernel may read. Mesa 22.3's software adapter (Debian 12) writes beyond an array of its own
/// while it compiles a kernel that decides by a ninth (seen with valgrind).
const MOST_UNIFORMS: usize = 8;

/// A compute pipeline.
pub struct Kernel {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) label: &'static str,
    /// Numbers of the structs of parameters that it reads.
    pub(super) uniforms: Vec<u32>,
}

impl Kernel {
    pub(super) fn new(
        gpu: &Gpu,
        label: &'static str,
        source: &str,
        entry: &str,
        constants: &[(&str, f64)],
    ) -> Self {
        let device = &gpu.device;
        let source = &*for_adapter(source, gpu.is_software());
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        };
        let module = match gpu.checks {
            Checks::Full => device.create_shader_module(descriptor),
            Checks::Trusted => trusted(device, descriptor),
        };
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            // Stages write shared memory before they read it; one invocation would do it alone otherwise.
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: gpu.pipelines.as_ref().map(Pipelines::cache),
        });
        let layout = pipeline.get_bind_group_layout(0);
        Self {
            pipeline,
            layout,
            label,
            uniforms: vec![],
        }
    }

    /// With the structs of parameters that it reads, which are bound at every dispatch.
    ///
    /// # Panics
    /// More than eight of them: memory of the process would be overwritten at random on some adapters.
    #[must_use]
    pub fn reading<U: Copy + Into<u32>>(mut self, uniforms: &[U]) -> Self {
        assert!(
            uniforms.len() <= MOST_UNIFORMS,
            "the kernel {} reads {} structs of parameters",
            self.label,
            uniforms.len()
        );
        self.uniforms = uniforms.iter().map(|&number| number.into()).collect();
        self
    }
}

/// The source as an adapter is given it. Mesa's software adapter compiles a kernel anew for all values of uniform buffers
/// that it decides by, which a camera that moves changes with every picture: seconds of compilation for each. It reads the
/// same numbers from storage buffers, by whose values it compiles nothing.
fn for_adapter(source: &str, is_software: bool) -> Cow<'_, str> {
    if is_software {
        source.replace("var<uniform>", "var<storage, read>").into()
    } else {
        source.into()
    }
}

#[expect(
    unsafe_code,
    reason = "run-time checks cost several times the work of the eye; a test compares both ways"
)]
fn trusted(
    device: &wgpu::Device,
    descriptor: wgpu::ShaderModuleDescriptor<'_>,
) -> wgpu::ShaderModule {
    // SAFETY: every loop ends, its bound is a parameter or a count made by an earlier stage; every index is below the
    // length that its buffer was given for this frame, or tested against it (light texels, list entries).
    unsafe {
        device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
    }
}
