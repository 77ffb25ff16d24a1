//! A list of commands for the device: dispatches and clears in order, then one download that runs them all.

use std::sync::mpsc::sync_channel;
use std::time::Duration;

use bytemuck::Pod;

use super::{Gpu, Kernel, Stamps, uniform};
use crate::error::RenderError;
use crate::timings::{self, Step};

/// Most workgroups in one dimension of a dispatch (the least any device allows).
const MOST_GROUPS: u32 = 65_535;

/// A device that has not drawn a part by then hangs; a software adapter needs seconds for the largest.
const HUNG: Duration = Duration::from_mins(5);

/// Commands that have not run yet.
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    pub(super) encoder: wgpu::CommandEncoder,
    stamps: Option<&'a Stamps>,
    /// Structs of parameters.
    uniforms: Option<wgpu::Buffer>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(gpu: &'a Gpu) -> Self {
        Self {
            gpu,
            encoder: gpu.encoder(),
            stamps: None,
            uniforms: None,
        }
    }

    /// Dispatches recorded from here on read their structs of parameters in this buffer.
    pub fn read_uniforms(&mut self, buffer: wgpu::Buffer) {
        self.uniforms = Some(buffer);
    }

    /// Passes recorded from here on tell when they begin and end.
    pub fn stamp(&mut self, stamps: &'a Stamps) {
        self.stamps = Some(stamps);
    }

    /// The list itself, for what has no verb here.
    pub fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        &mut self.encoder
    }

    /// Runs everything recorded so far, without waiting for it; what is recorded from here on runs after that.
    pub fn flush(&mut self) {
        let fresh = self.gpu.encoder();
        let recorded = std::mem::replace(&mut self.encoder, fresh);
        self.gpu.queue.submit([recorded.finish()]);
    }

    /// Runs everything recorded, without waiting for it.
    pub fn submit(self) -> wgpu::SubmissionIndex {
        self.gpu.queue.submit([self.encoder.finish()])
    }

    /// Runs `kernel` on `groups` workgroups with these buffers at their binding numbers.
    pub fn dispatch(
        &mut self,
        kernel: &Kernel,
        buffers: &[(u32, &wgpu::Buffer)],
        groups: [u32; 2],
    ) {
        self.dispatch_deep(kernel, buffers, [groups[0], groups[1], 1]);
    }

    /// The same in three dimensions.
    pub fn dispatch_deep(
        &mut self,
        kernel: &Kernel,
        buffers: &[(u32, &wgpu::Buffer)],
        groups: [u32; 3],
    ) {
        if groups.contains(&0) {
            return;
        }
        let whole = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            });
        let structs = self.uniforms.iter().flat_map(|buffer| {
            let numbers = kernel.uniforms.iter();
            numbers.map(move |&number| uniform(buffer, number))
        });
        let entries: Vec<_> = whole.chain(structs).collect();
        let bindings = self
            .gpu
            .device
            .create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(kernel.label),
                layout: &kernel.layout,
                entries: &entries,
            });
        let mut pass = self
            .encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(kernel.label),
                timestamp_writes: self.stamps.and_then(|stamps| {
                    let (query_set, first) = stamps.of_pass(kernel.label)?;
                    Some(wgpu::ComputePassTimestampWrites {
                        query_set,
                        beginning_of_pass_write_index: Some(first),
                        end_of_pass_write_index: Some(first + 1),
                    })
                }),
            });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }

    /// Runs `kernel` with one workgroup for every `size` of `count` items.
    pub fn dispatch_list(
        &mut self,
        kernel: &Kernel,
        buffers: &[(u32, &wgpu::Buffer)],
        count: u32,
        size: u32,
    ) {
        let groups = count.div_ceil(size);
        let across = groups.min(MOST_GROUPS);
        let down = if across == 0 {
            0
        } else {
            groups.div_ceil(across)
        };
        self.dispatch(kernel, buffers, [across, down]);
    }

    /// Sets the first `bytes` of a buffer to zero.
    pub fn clear(&mut self, buffer: &wgpu::Buffer, bytes: u64) {
        self.encoder.clear_buffer(buffer, 0, Some(bytes));
    }

    /// Runs everything recorded and reads the first `len` items of a buffer.
    pub fn download<T: Pod>(
        self,
        buffer: &wgpu::Buffer,
        len: usize,
    ) -> Result<Vec<T>, RenderError> {
        let bytes = (len * size_of::<T>()) as u64;
        let [content] = self.download_parts([(buffer, 0, bytes)])?;
        Ok(bytemuck::pod_collect_to_vec(&content))
    }

    /// Runs everything recorded and reads parts of buffers: `(buffer, first byte, bytes)`.
    pub fn download_parts<const N: usize>(
        mut self,
        parts: [(&wgpu::Buffer, u64, u64); N],
    ) -> Result<[Vec<u8>; N], RenderError> {
        let size = parts.iter().map(|part| part.2).sum();
        let staging = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("download"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut at = 0;
        for (buffer, first, bytes) in parts {
            self.encoder
                .copy_buffer_to_buffer(buffer, first, &staging, at, bytes);
            at += bytes;
        }
        let (gpu, commands) = (self.gpu, self.encoder.finish());
        let mapped = timings::timed(Step::Device, || {
            let submission = gpu.queue.submit([commands]);
            // A refused submission never ends: it must not be waited for.
            gpu.check_fault("drawing")?;
            let (done_tx, done_rx) = sync_channel(1);
            staging.map_async(wgpu::MapMode::Read, .., move |result| {
                // The receiver is gone only if this function has returned with an error.
                drop(done_tx.send(result));
            });
            let wait = wgpu::PollType::Wait {
                submission_index: Some(submission),
                timeout: Some(HUNG),
            };
            let stopped = |reason: &dyn std::fmt::Display| gpu.stopped("drawing", reason);
            gpu.device.poll(wait).map_err(|error| stopped(&error))?;
            done_rx
                .recv()
                .map_err(|error| stopped(&error))?
                .map_err(|error| stopped(&error))?;
            gpu.check_fault("drawing")?;
            staging
                .get_mapped_range(..)
                .map_err(|error| stopped(&error))
        })?;
        let mut rest: &[u8] = &mapped;
        Ok(timings::timed(Step::ReadBack, || {
            parts.map(|(_, _, bytes)| {
                let (content, after) = rest.split_at(bytes as usize);
                rest = after;
                content.to_vec()
            })
        }))
    }
}
