//! Frames that stay on the device between pictures, least recently drawn first to go.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::scene::Cells;

/// Share of a device's own memory for frames: the rest is for pictures in flight and for others.
const SHARE: u64 = 8;
/// Bytes kept where nobody knows what the device has.
const UNKNOWN_BYTES: u64 = 512 << 20;

/// Buffers by the id of their cells and the part of them that is held.
pub(crate) struct Resident {
    held: Mutex<Held>,
}

struct Held {
    /// Bytes kept at most, apart from frames in flight.
    most_bytes: u64,
    by_id: BTreeMap<(u64, usize, usize), (wgpu::Buffer, u64)>,
    uses: u64,
}

impl Resident {
    /// Nothing yet; up to so many bytes, a share of what the device has if none are named.
    pub(crate) fn new(gpu: &Gpu, most_bytes: Option<u64>) -> Self {
        let share = || gpu.own_bytes().map_or(UNKNOWN_BYTES, |own| own / SHARE);
        let held = Held {
            most_bytes: most_bytes.unwrap_or_else(share),
            by_id: BTreeMap::new(),
            uses: 0,
        };
        Self {
            held: Mutex::new(held),
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.bytes()
    }

    /// A part of the cells on the device, uploaded if it is not there.
    pub(crate) fn buffer<T: Pod>(
        &self,
        gpu: &Gpu,
        cells: &Cells<T>,
        part: Range<usize>,
    ) -> Result<wgpu::Buffer, RenderError> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.uses += 1;
        let use_count = held.uses;
        let id = (cells.id(), part.start, part.end);
        if let Some((buffer, last_use)) = held.by_id.get_mut(&id) {
            *last_use = use_count;
            return Ok(buffer.clone());
        }
        let buffer = gpu.storage("frame", &cells.content()[part])?;
        held.by_id.insert(id, (buffer.clone(), use_count));
        held.evict();
        Ok(buffer)
    }
}

impl Held {
    fn bytes(&self) -> u64 {
        self.by_id.values().map(|(buffer, _)| buffer.size()).sum()
    }

    fn evict(&mut self) {
        let mut bytes = self.bytes();
        while bytes > self.most_bytes && self.by_id.len() > 1 {
            let oldest = self
                .by_id
                .iter()
                .min_by_key(|(_, (_, last_use))| *last_use)
                .map(|(id, _)| *id);
            let Some((buffer, _)) = oldest.and_then(|id| self.by_id.remove(&id)) else {
                return;
            };
            bytes -= buffer.size();
        }
    }
}
