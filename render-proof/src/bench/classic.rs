//! The classic half-angle renderer, kept as an honest baseline: particles sorted by slice, and for every slice one render
//! pass for the eye, which looks its shadow up in the light's picture, and one into the light's picture.
//!
//! What a graphics programmer would do without thinking is done: quads come from an index buffer, many an instance, and
//! the light's picture has the one channel that it needs.

mod pipelines;

use anyhow::{Context as _, Result, ensure};
use contract::job::RenderJob;
use glam::Vec3;
use render::frame_context::FrameContext;
use render::gpu::{Gpu, Slot, Stamps, Workspace, uniform};
use render::passes::splat::{self, Splats};
use render::plan::Plan;
use render::playback::{Playback, Steps};
use render::stages::colour::srgb_of;
use render::stages::layout::GROUP;
use render::stages::params::Uniform;
use render::{Image, Scene, passes};
use wgpu::util::DeviceExt as _;

use pipelines::{EYE_FORMAT, Pipelines, light_format};

/// What is to be said beside every comparison.
pub const NOTE: &str = "an H200 has 2 of its 66 clusters wired for graphics: there the ratio is no statement about a graphics card";

/// Quads of an instance: their corners can be named by 16 bits.
const QUADS: u32 = 1024;
/// Bytes of the arguments of an indexed draw.
const DRAW_BYTES: u64 = 20;
/// Name of the pass that ends a frame, as stamps know it.
pub const LAST_PASS: &str = "classic";
/// Slices of the sorting shaders.
const MOST_SLICES: u32 = 256;

/// A view with its pipelines and targets.
pub struct Classic<'a> {
    gpu: &'a Gpu,
    splats: Splats,
    plan: Plan,
    workspace: Workspace,
    pipelines: Pipelines,
    eye: wgpu::Texture,
    light: wgpu::Texture,
    slice_counts: wgpu::Buffer,
    draws: wgpu::Buffer,
    order: wgpu::Buffer,
    corners: wgpu::Buffer,
}

/// The corners of two triangles for each quad of an instance.
fn corner_indices(device: &wgpu::Device) -> wgpu::Buffer {
    let quads = 0..QUADS as u16;
    let corners: Vec<u16> = quads
        .flat_map(|quad| [0, 1, 2, 2, 1, 3].map(|corner| 4 * quad + corner))
        .collect();
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("corners"),
        contents: bytemuck::cast_slice(&corners),
        usage: wgpu::BufferUsages::INDEX,
    })
}

impl<'a> Classic<'a> {
    /// The renderer for a job's view; the light must be on the eye's side of the volume.
    pub fn new(gpu: &'a Gpu, job: &RenderJob, scene: &Scene) -> Result<Self> {
        let plan = Plan::holding(job, scene, gpu.most_buffer_bytes(), u64::MAX)?;
        let params = plan.params_of(plan.whole());
        ensure!(
            params.view.front_to_back == 1 && params.lighting.mode == 1,
            "only drawn towards the light"
        );
        let buffer = |label, bytes: u64, usage| {
            gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: usage | wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let target = |label, width, height, format| {
            gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width,
                    height,
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        Ok(Self {
            gpu,
            splats: Splats::new(gpu, splat::SOURCE, passes::probes(gpu)),
            workspace: Workspace::default(),
            pipelines: Pipelines::new(gpu.device(), &params),
            eye: target(
                "eye",
                params.view.size_px.x,
                params.view.size_px.y,
                EYE_FORMAT,
            ),
            light: target(
                "light",
                params.lighting.size.x,
                params.lighting.size.y,
                light_format(gpu.device()),
            ),
            slice_counts: buffer(
                "slice counts",
                u64::from(MOST_SLICES) * 4,
                wgpu::BufferUsages::empty(),
            ),
            draws: buffer(
                "draws",
                u64::from(MOST_SLICES) * DRAW_BYTES,
                wgpu::BufferUsages::INDIRECT,
            ),
            order: buffer(
                "order",
                // Every slice begins at a whole instance.
                (u64::from(params.cells.splat_count) + u64::from(MOST_SLICES * QUADS)) * 4,
                wgpu::BufferUsages::empty(),
            ),
            corners: corner_indices(gpu.device()),
            plan,
        })
    }

    /// Format of the light's picture.
    pub fn light_format(&self) -> wgpu::TextureFormat {
        self.light.format()
    }

    /// Draws an instant; the picture stays on the device. Does not wait. Its last pass is stamped as [`LAST_PASS`].
    #[expect(
        clippy::too_many_lines,
        reason = "one list of passes, read from top to bottom"
    )]
    pub fn draw(
        &mut self,
        steps: &Steps,
        weights: (f32, f32),
        stamps: Option<&Stamps>,
    ) -> Result<wgpu::SubmissionIndex> {
        (
            self.plan.params.values.weight,
            self.plan.params.values.accumulated_weight,
        ) = weights;
        let params = self.plan.params_of(self.plan.whole());
        let mut frame = FrameContext::new(
            self.gpu,
            &mut self.workspace,
            &self.plan,
            params,
            steps.clone(),
        )?;
        self.splats.record(&mut frame)?;
        let (seen, lit) = (frame.room(Slot::Seen, 4)?, frame.room(Slot::Lit, 4)?);
        let params_buffer = frame.params_buffer.clone();
        let encoder = frame.recorder.encoder();
        encoder.clear_buffer(&self.slice_counts, 0, None);
        encoder.clear_buffer(&self.order, 0, None);
        let device = self.gpu.device();
        let light_view = self
            .light
            .create_view(&wgpu::TextureViewDescriptor::default());
        let eye_view = self
            .eye
            .create_view(&wgpu::TextureViewDescriptor::default());
        let bind = |layout: &wgpu::BindGroupLayout, uniforms: &[Uniform], bindings: &[u32]| {
            let structs = uniforms.iter();
            let structs = structs.map(|&number| uniform(&params_buffer, number.into()));
            let entries: Vec<_> = bindings
                .iter()
                .map(|&binding| wgpu::BindGroupEntry {
                    binding,
                    resource: match binding {
                        1 => seen.as_entire_binding(),
                        7 => lit.as_entire_binding(),
                        3 => wgpu::BindingResource::TextureView(&light_view),
                        4 => self.slice_counts.as_entire_binding(),
                        5 => self.draws.as_entire_binding(),
                        _ => self.order.as_entire_binding(),
                    },
                })
                .chain(structs)
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries: &entries,
            })
        };
        let groups = params.cells.splat_count.div_ceil(GROUP);
        let across = groups.min(65_535);
        let lists = [across, groups.div_ceil(across.max(1))];
        let sort: [(&wgpu::ComputePipeline, Uniform, &[u32], [u32; 2]); 3] = [
            (&self.pipelines.count, Uniform::Cells, &[1, 4, 7], lists),
            (&self.pipelines.start, Uniform::View, &[4, 5], [1, 1]),
            (&self.pipelines.order, Uniform::Cells, &[1, 4, 6, 7], lists),
        ];
        for (pipeline, uniform, bindings, [x, y]) in sort {
            let group = bind(&pipeline.get_bind_group_layout(0), &[uniform], bindings);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(x, y, 1);
        }
        let eye_group = bind(
            &self.pipelines.eye.get_bind_group_layout(0),
            &[Uniform::View, Uniform::Lighting, Uniform::Lists],
            &[1, 2, 3, 7],
        );
        let light_group = bind(
            &self.pipelines.light.get_bind_group_layout(0),
            &[Uniform::Lighting, Uniform::Lists],
            &[1, 2, 7],
        );
        for slice in 0..params.view.slices {
            let sides = [
                (&eye_view, &self.pipelines.eye, &eye_group),
                (&light_view, &self.pipelines.light, &light_group),
            ];
            // Slice 0 finds the light's picture as the last frame left it unless it is cleared before.
            let sides = if slice == 0 {
                [sides[1], sides[0], sides[1]]
            } else {
                [sides[0], sides[1], sides[1]]
            };
            for (step, (view, pipeline, group)) in sides
                .into_iter()
                .enumerate()
                .take(if slice == 0 { 3 } else { 2 })
            {
                let is_clear = slice == 0 && step < 2;
                let load = if is_clear {
                    wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT)
                } else {
                    wgpu::LoadOp::Load
                };
                let is_last = slice + 1 == params.view.slices && step > 0;
                let stamp = stamps.filter(|_| is_last);
                let stamp = stamp.and_then(|stamps| stamps.of_pass(LAST_PASS));
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: None,
                    timestamp_writes: stamp.map(|(query_set, first)| {
                        wgpu::RenderPassTimestampWrites {
                            query_set,
                            beginning_of_pass_write_index: Some(first),
                            end_of_pass_write_index: Some(first + 1),
                        }
                    }),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load,
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    ..Default::default()
                });
                if slice == 0 && step == 0 {
                    continue;
                }
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.set_index_buffer(self.corners.slice(..), wgpu::IndexFormat::Uint16);
                pass.draw_indexed_indirect(&self.draws, u64::from(slice) * DRAW_BYTES);
            }
        }
        Ok(frame.recorder.submit())
    }

    /// The picture last drawn, straight alpha.
    pub fn image(&self) -> Result<Image> {
        let (width, height) = (self.eye.width(), self.eye.height());
        let row_bytes = (width * 8).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = u64::from(row_bytes) * u64::from(height);
        let buffer = self
            .gpu
            .device()
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("picture"),
                contents: &vec![0; bytes as usize],
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            });
        let mut recorder = self.gpu.recorder();
        recorder.encoder().copy_texture_to_buffer(
            self.eye.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            self.eye.size(),
        );
        let [content] = recorder.download_parts([(&buffer, 0, bytes)])?;
        let rows = content.chunks_exact(row_bytes as usize);
        let rgba8 = rows
            .flat_map(|row| row[..width as usize * 8].chunks_exact(8))
            .flat_map(|texel| {
                let channel = |i: usize| half(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]]));
                let alpha = channel(3);
                let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
                // Blended as light, written as sRGB.
                let light = Vec3::new(channel(0), channel(1), channel(2)) / alpha.max(1e-6);
                let [r, g, b] = srgb_of(light).to_array().map(byte);
                [r, g, b, byte(alpha)]
            })
            .collect();
        Ok(Image {
            width,
            height,
            rgba8,
        })
    }
}

/// A non-negative half-precision number.
fn half(bits: u16) -> f32 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f32::from(bits & 0x3ff));
    if exponent == 0 {
        mantissa * 2f32.powi(-24)
    } else {
        (1.0 + mantissa / 1024.0) * 2f32.powi(exponent - 15)
    }
}

/// The fields of a scene on the device.
pub fn steps(gpu: &Gpu, scene: &Scene) -> Result<Steps> {
    Playback::upload(gpu, scene).context("uploading the fields")
}
