//! A region's weights in memory, by chunk: read from the store once and shared by every task of a process.

use std::collections::BTreeMap;
use std::future::Future;
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use datafusion::error::DataFusionError;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use storage::StorageError;
use storage::weights::SharedAreas;

use crate::ComputeError;

/// Weights held, bytes: those of the globe's sea in cells of 1/100 degree take 22 MB. Larger ones are read anew by each task.
const HELD_BYTES: u64 = 256 << 20;
/// Regions held, a guess that sizes tables. For so few the cache is one shard: in several, each would have a part of the room
/// that large weights do not fit into.
const HELD_REGIONS: usize = 32;

/// Areas of a region's share of every cell, m², by chunk.
#[derive(Debug)]
pub(crate) struct RegionWeights {
    /// In the order of their numbers; chunks that the region does not touch are left out.
    chunks: Vec<(u32, SharedAreas)>,
}

impl RegionWeights {
    pub(crate) fn new<A: Into<SharedAreas>>(chunks: Vec<(u32, A)>) -> Self {
        let chunks = chunks.into_iter();
        let mut chunks: Vec<(u32, SharedAreas)> =
            chunks.map(|(chunk, areas)| (chunk, areas.into())).collect();
        chunks.sort_by_key(|(chunk, _)| *chunk);
        Self { chunks }
    }

    /// Chunks that the region touches.
    pub(crate) fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    /// Areas of the cells of a chunk; none where the region does not touch it.
    fn areas_m2(&self, chunk: u32) -> Option<&SharedAreas> {
        let at = self
            .chunks
            .binary_search_by_key(&chunk, |(chunk, _)| *chunk);
        at.ok().map(|at| &self.chunks[at].1)
    }

    /// Areas of the cells of every chunk that the region touches, with its number.
    pub(crate) fn chunks(&self) -> impl Iterator<Item = (u32, &SharedAreas)> {
        self.chunks.iter().map(|(chunk, areas)| (*chunk, areas))
    }

    /// All areas, cell by cell in the order of chunks.
    pub(crate) fn cells(&self) -> impl Iterator<Item = f64> {
        self.chunks.iter().flat_map(|(_chunk, areas)| areas.iter())
    }

    /// Hands over the column and the weight of the cells of a run of a row that lie in chunks which the geometry touches, eastwards;
    /// the grid has `grid_cols` columns.
    pub(crate) fn each_in_row(
        &self,
        grid_cols: u32,
        row: u32,
        cols: Range<u32>,
        mut take: impl FnMut(u32, f64),
    ) {
        let chunks_across = grid_cols.div_ceil(CHUNK_COLS);
        let mut col = cols.start;
        while col < cols.end {
            let across = col / CHUNK_COLS;
            let chunk_end = ((across + 1) * CHUNK_COLS).min(grid_cols);
            let run_end = cols.end.min(chunk_end);
            if let Some(areas) = self.areas_m2(row / CHUNK_ROWS * chunks_across + across) {
                let width = chunk_end - across * CHUNK_COLS;
                let at = ((row % CHUNK_ROWS) * width + col % CHUNK_COLS) as usize;
                for (cells, area) in areas.runs(at..at + (run_end - col) as usize) {
                    for cell in cells {
                        take(col + (cell - at) as u32, area);
                    }
                }
            }
            col = run_end;
        }
    }

    fn size_bytes(&self) -> u64 {
        // Those that several chunks share are held once.
        let own = self.chunks.iter();
        let own = own.map(|(_, areas)| (areas.address(), areas.size_bytes()));
        let distinct: BTreeMap<usize, u64> = own.collect();
        let areas = distinct.values().sum::<u64>();
        areas + (self.chunks.len() * size_of::<(u32, SharedAreas)>()) as u64
    }
}

/// Weights that this process has read.
#[derive(Debug)]
pub(crate) struct LoadedWeights {
    held: Cache<String, Arc<RegionWeights>, Size>,
}

impl Default for LoadedWeights {
    fn default() -> Self {
        Self {
            held: Cache::with_weighter(HELD_REGIONS, HELD_BYTES, Size),
        }
    }
}

impl LoadedWeights {
    /// Those of a name, where they are held.
    pub(crate) fn held(&self, name: &str) -> Option<Arc<RegionWeights>> {
        self.held.get(name)
    }

    /// Those at an address; many who ask at once wait for one reading.
    pub(crate) async fn get(
        &self,
        address: &str,
        read: impl Future<Output = Result<RegionWeights, DataFusionError>>,
    ) -> Result<Arc<RegionWeights>, DataFusionError> {
        let reading = async { Ok(Arc::new(read.await?)) };
        self.held.get_or_insert_async(address, reading).await
    }
}

/// Why weights could not be had, in the words of whoever found out.
pub(crate) fn weights_failed(error: datafusion::error::DataFusionError) -> ComputeError {
    use datafusion::error::DataFusionError::External;
    match error {
        External(source) => match source.downcast::<ComputeError>() {
            Ok(own) => *own,
            Err(other) => match other.downcast::<StorageError>() {
                Ok(own) => (*own).into(),
                Err(other) => ComputeError::engine("reading a region's weights")(External(other)),
            },
        },
        other => ComputeError::engine("reading a region's weights")(other),
    }
}

/// Counts bytes of areas.
#[derive(Debug, Clone)]
struct Size;

impl Weighter<String, Arc<RegionWeights>> for Size {
    fn weight(&self, _address: &String, weights: &Arc<RegionWeights>) -> u64 {
        weights.size_bytes().max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_that_is_not_touched_has_no_areas() {
        let weights = RegionWeights::new(vec![(7, vec![1.0]), (3, vec![2.0, 0.5])]);
        assert_eq!(weights.areas_m2(3), Some(&vec![2.0, 0.5].into()));
        assert_eq!(weights.areas_m2(5), None);
    }

    #[tokio::test]
    async fn weights_are_read_once_and_a_failure_is_not_remembered() {
        let loaded = LoadedWeights::default();
        let failing = async { Err(DataFusionError::Execution("away".into())) };
        assert!(loaded.get("a", failing).await.is_err());
        assert!(loaded.held("a").is_none());
        let read = async { Ok(RegionWeights::new(vec![(1, vec![1.0])])) };
        loaded.get("a", read).await.unwrap();
        let never = async { panic!("read again") };
        assert!(loaded.get("a", never).await.unwrap().areas_m2(1).is_some());
        assert!(loaded.held("a").unwrap().areas_m2(1).is_some());
    }

    #[tokio::test]
    async fn weights_that_take_most_of_the_room_are_held() {
        let loaded = LoadedWeights::default();
        // Each its own, or they took nothing.
        let areas = (0..HELD_BYTES as usize * 9 / 10 / size_of::<f64>()).map(|cell| cell as f64);
        let weights = RegionWeights::new(vec![(1, areas.collect::<Vec<f64>>())]);
        assert!(weights.size_bytes() > HELD_BYTES * 8 / 10);
        let read = async { Ok(weights) };
        loaded.get("large", read).await.unwrap();
        let never = async { panic!("read again") };
        assert!(loaded.get("large", never).await.is_ok());
    }
}
