//! Sums of whole runs of steps over a geometry that this process has found: another statistic, other bins or another period of the same
//! geometry read nothing again.

use std::sync::Arc;

use contract::digest::Digest;
use quick_cache::Weighter;
use quick_cache::sync::Cache;

use super::accumulator::StepSums;

/// Bytes of all that is remembered: a thousand geometries over 16 years of months, a hundred over as many of days.
const HELD_BYTES: u64 = 64 << 20;
/// A year of days, which sizes tables.
const TYPICAL_BYTES: u64 = 32 << 10;

/// Sums by step, by the digest of all that they are made of: values of a run, weights, a scale. None of these ever changes.
#[derive(Debug)]
pub(crate) struct Remembered(Cache<Digest, Arc<Vec<(u32, StepSums)>>, Size>);

impl Default for Remembered {
    fn default() -> Self {
        let typical_count = (HELD_BYTES / TYPICAL_BYTES) as usize;
        Self(Cache::with_weighter(typical_count, HELD_BYTES, Size))
    }
}

impl Remembered {
    /// Sums of the steps of a run that hold data, by their place in it.
    pub(super) fn get(&self, name: &Digest) -> Option<Arc<Vec<(u32, StepSums)>>> {
        self.0.get(name)
    }

    pub(super) fn insert(&self, name: Digest, sums: Vec<(u32, StepSums)>) {
        self.0.insert(name, Arc::new(sums));
    }
}

#[derive(Debug, Clone)]
struct Size;

impl Weighter<Digest, Arc<Vec<(u32, StepSums)>>> for Size {
    fn weight(&self, _name: &Digest, sums: &Arc<Vec<(u32, StepSums)>>) -> u64 {
        (sums.len() * size_of::<(u32, StepSums)>()) as u64 + 1
    }
}
