//! The pipelines of the classic renderer, from one module of shaders.

use render::stages::params::Params;
use render::stages::{bin, light};
use render::{passes, stages};

use super::QUADS;

/// Of the eye's picture.
pub(super) const EYE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Particle radius over light texel, as in the compute renderer.
const LIGHT_RADIUS_TEXELS: f32 = 1.0 / 0.612;

/// Format of the light's picture, one channel: 32 bits where the adapter can add to them, else 16.
pub(super) fn light_format(device: &wgpu::Device) -> wgpu::TextureFormat {
    if device
        .features()
        .contains(wgpu::Features::FLOAT32_BLENDABLE)
    {
        wgpu::TextureFormat::R32Float
    } else {
        wgpu::TextureFormat::R16Float
    }
}

/// What slices are counted, sorted and drawn with.
pub(super) struct Pipelines {
    pub(super) count: wgpu::ComputePipeline,
    pub(super) start: wgpu::ComputePipeline,
    pub(super) order: wgpu::ComputePipeline,
    pub(super) eye: wgpu::RenderPipeline,
    pub(super) light: wgpu::RenderPipeline,
}

impl Pipelines {
    #[expect(clippy::too_many_lines, reason = "descriptors of five pipelines")]
    pub(super) fn new(device: &wgpu::Device, params: &Params) -> Self {
        // Light depth of a splat from its depth on the screen, at the scale of what lies below the camera.
        let height = params.view.eye.length() - 1.0;
        let scale = params.view.focal_px / height;
        let gain = params.projection.light_depth_gain / (scale * scale);
        let constants = [
            ("LIGHT_RADIUS_TEXELS", f64::from(LIGHT_RADIUS_TEXELS)),
            ("LIGHT_GAIN", f64::from(gain)),
            ("QUADS", f64::from(QUADS)),
        ];
        let compilation_options = wgpu::PipelineCompilationOptions {
            constants: &constants,
            ..Default::default()
        };
        let source = [
            stages::PRELUDE,
            light::TEXEL_FUNCTIONS,
            bin::FUNCTIONS,
            passes::CELLS,
            include_str!("../classic.wgsl"),
        ]
        .concat();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("classic"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let compute = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: compilation_options.clone(),
                cache: None,
            })
        };
        let render = |vertex, fragment, format, blend| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleList,
                    ..Default::default()
                },
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: compilation_options.clone(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format,
                        blend: Some(blend),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let component = |src_factor| wgpu::BlendComponent {
            src_factor,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let both = |factor| wgpu::BlendState {
            color: component(factor),
            alpha: component(factor),
        };
        Self {
            count: compute("count_slices"),
            start: compute("start_slices"),
            order: compute("order_slices"),
            // What is nearer was drawn before.
            eye: render(
                "eye_corner",
                "eye_pixel",
                EYE_FORMAT,
                both(wgpu::BlendFactor::OneMinusDstAlpha),
            ),
            light: render(
                "light_corner",
                "light_pixel",
                light_format(device),
                both(wgpu::BlendFactor::One),
            ),
        }
    }
}
