//! One compiled entry point and the layout of its bindings.

/// A compute pipeline.
pub struct Kernel {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) label: &'static str,
}

impl Kernel {
    pub(super) fn new(
        device: &wgpu::Device,
        label: &'static str,
        source: &str,
        entry: &str,
    ) -> Self {
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        };
        #[expect(
            unsafe_code,
            reason = "only here; every index is bounded in the shader and a test compares with checked modules"
        )]
        // SAFETY: loops end (their bounds are counts made by earlier stages) and indices stay inside their buffers.
        let module = unsafe {
            device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
        };
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let layout = pipeline.get_bind_group_layout(0);
        Self {
            pipeline,
            layout,
            label,
        }
    }
}
