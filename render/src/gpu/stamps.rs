//! When each pass of recorded commands began and ended, by the device's own clock.

use std::sync::{Mutex, PoisonError};

use super::Gpu;
use crate::error::RenderError;

/// Most passes that one set of stamps holds.
const MOST_PASSES: u32 = 2048;

/// A set of time stamps; passes of any recorder may write to it until it is full.
pub struct Stamps {
    set: wgpu::QuerySet,
    /// Only passes of this name are stamped.
    only: Option<&'static str>,
    labels: Mutex<Vec<&'static str>>,
}

/// One pass: name, begin and end in seconds from any start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamped {
    pub label: &'static str,
    pub begin_s: f64,
    pub end_s: f64,
}

impl Stamps {
    /// Stamps for all passes, or for those of one name; none if the device has no clock.
    pub fn new(gpu: &Gpu, only: Option<&'static str>) -> Option<Self> {
        let has_clock = gpu
            .device
            .features()
            .contains(wgpu::Features::TIMESTAMP_QUERY);
        has_clock.then(|| Self {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST_PASSES,
            }),
            only,
            labels: Mutex::default(),
        })
    }

    /// What a pass of this name must write, if it is stamped.
    pub fn of_pass(&self, label: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let mut labels = self.labels.lock().unwrap_or_else(PoisonError::into_inner);
        let at = labels.len() as u32;
        let is_asked = self.only.is_none_or(|only| only == label);
        (is_asked && at < MOST_PASSES).then(|| {
            labels.push(label);
            (&self.set, 2 * at)
        })
    }

    /// All stamps of commands that have run; the set is empty afterwards.
    pub fn take(&self, gpu: &Gpu) -> Result<Vec<Stamped>, RenderError> {
        let mut labels = self.labels.lock().unwrap_or_else(PoisonError::into_inner);
        let count = 2 * labels.len() as u32;
        if count == 0 {
            return Ok(vec![]);
        }
        let ticks = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ticks"),
            size: u64::from(count) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut recorder = gpu.recorder();
        recorder
            .encoder
            .resolve_query_set(&self.set, 0..count, &ticks, 0);
        let ticks: Vec<u64> = recorder.download(&ticks, count as usize)?;
        let tick_s = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        let pairs = labels.drain(..).zip(ticks.chunks_exact(2));
        Ok(pairs
            .map(|(label, pair)| Stamped {
                label,
                begin_s: pair[0] as f64 * tick_s,
                end_s: pair[1] as f64 * tick_s,
            })
            .collect())
    }
}
