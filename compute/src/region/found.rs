//! Areas of chunks as they are found, equal ones held once, and no more of them than there is room for.

use storage::weights::{SharedAreas, Sharing};

use crate::ComputeError;

/// Most memory that areas of one region may take, bytes, equal neighbours and equal chunks counted once: a hundred times what the coasts of a
/// grid of 1/100 degree need.
const MAX_AREA_BYTES: u64 = 2 << 30;

/// Chunks with any area.
#[derive(Default)]
pub(super) struct Found {
    sharing: Sharing,
    pub(super) chunks: Vec<(u32, SharedAreas)>,
}

impl Found {
    /// Adds a chunk, if it has any area.
    pub(super) fn add(&mut self, chunk: u32, areas_m2: &[f64]) -> Result<(), ComputeError> {
        if areas_m2.iter().any(|&area_m2| area_m2 > 0.0) {
            self.chunks.push((chunk, self.sharing.of(areas_m2)));
        }
        if self.sharing.distinct_bytes() > MAX_AREA_BYTES {
            let reason = format!(
                "its weights on this grid take more than the {} MiB that are held: ask for a smaller region, or one with a simpler \
                 edge",
                MAX_AREA_BYTES >> 20
            );
            return Err(ComputeError::Region { reason });
        }
        Ok(())
    }
}
