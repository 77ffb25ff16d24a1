//! Buffers that one frame at a time works in; they grow to the largest frame drawn and are used again.

use bytemuck::Pod;

use super::Gpu;
use crate::error::RenderError;
use crate::stages::layout::Entry;

/// What a buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    Params,
    Rows,
    Cols,
    Palette,
    Axes,
    GroundAxes,
    Coast,
    SeaFloor,
    IsolineLevels,
    Isolines,
    Trails,
    Value,
    Velocity,
    Seen,
    Lit,
    Light,
    Counts,
    BlockSums,
    HotLists,
    HotParts,
    HotSums,
    Entries,
    Picture,
    Image,
}

impl Slot {
    const COUNT: usize = Self::Image as usize + 1;

    fn label(self) -> &'static str {
        match self {
            Self::Params => "params",
            Self::Rows => "rows",
            Self::Cols => "columns",
            Self::Palette => "palette",
            Self::Axes => "axes",
            Self::GroundAxes => "ground axes",
            Self::Coast => "coast mask",
            Self::SeaFloor => "sea floor",
            Self::IsolineLevels => "table of isolines",
            Self::Isolines => "isolines",
            Self::Trails => "trails",
            Self::Value => "interpolated values",
            Self::Velocity => "velocities",
            Self::Seen => "splats on the screen",
            Self::Lit => "splats in the light",
            Self::Light => "light layers",
            Self::Counts => "list counts",
            Self::BlockSums => "scan sums",
            Self::HotLists => "long lists",
            Self::HotParts => "parts of long lists",
            Self::HotSums => "sums of long lists",
            Self::Entries => "list entries",
            Self::Picture => "picture",
            Self::Image => "image",
        }
    }
}

/// The buffers of one frame in flight.
#[derive(Default)]
pub struct Workspace {
    buffers: [Option<wgpu::Buffer>; Slot::COUNT],
    /// Whose content a slot holds, by [`Workspace::upload_once`].
    owners: [u64; Slot::COUNT],
}

impl Workspace {
    /// The buffer of a slot with room for `bytes`; what it held is kept only if it was large enough.
    pub fn room(&mut self, gpu: &Gpu, slot: Slot, bytes: u64) -> Result<wgpu::Buffer, RenderError> {
        gpu.check_size(slot.label(), bytes)?;
        let held = &mut self.buffers[slot as usize];
        if let Some(buffer) = held.as_ref().filter(|buffer| buffer.size() >= bytes) {
            return Ok(buffer.clone());
        }
        let kind = if slot == Slot::Params {
            wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::STORAGE
        } else {
            wgpu::BufferUsages::STORAGE
        };
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(slot.label()),
            // Powers of two: frames of slightly different size share a buffer.
            size: bytes
                .max(256)
                .next_power_of_two()
                .min(gpu.most_buffer_bytes.max(256)),
            usage: kind | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        *held = Some(buffer.clone());
        Ok(buffer)
    }

    /// The buffer of a slot with this content at its start, before anything recorded later runs.
    pub fn upload<T: Pod>(
        &mut self,
        gpu: &Gpu,
        slot: Slot,
        content: &[T],
    ) -> Result<wgpu::Buffer, RenderError> {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        self.owners[slot as usize] = 0;
        let buffer = self.room(gpu, slot, bytes.len() as u64)?;
        gpu.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// The same, but for content that the slot still holds from `owner`, a number above 0 that stands for this content.
    pub fn upload_once<T: Pod>(
        &mut self,
        gpu: &Gpu,
        slot: Slot,
        owner: u64,
        content: &[T],
    ) -> Result<wgpu::Buffer, RenderError> {
        if self.owners[slot as usize] == owner
            && let Some(buffer) = &self.buffers[slot as usize]
        {
            return Ok(buffer.clone());
        }
        let buffer = self.upload(gpu, slot, content)?;
        self.owners[slot as usize] = owner;
        Ok(buffer)
    }

    /// List entries there is room for.
    pub fn entry_room(&self) -> u32 {
        (self.room_bytes(Slot::Entries) / size_of::<Entry>() as u64) as u32
    }

    /// Bytes a slot has room for.
    pub fn room_bytes(&self, slot: Slot) -> u64 {
        self.buffers[slot as usize]
            .as_ref()
            .map_or(0, wgpu::Buffer::size)
    }
}
