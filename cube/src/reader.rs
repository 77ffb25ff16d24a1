//! One state of a cube, to read: windows of cells of a step, whole fields, the series of a cell.

use std::sync::Arc;

use contract::chunk::Window;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::session::Session;
use tokio::sync::RwLock;
use zarrs::array::{Array, AsyncArrayShardedReadableExt as _, AsyncArrayShardedReadableExtCache};
use zarrs_icechunk::AsyncIcechunkStore;

use crate::error::first_lines;
use crate::field::Decoder;
use crate::{CubeError, Description, Layout, Step, arrays, axis};

/// Chunks that are read and decoded at a time.
const CHUNKS_AT_ONCE: usize = 8;

/// One state of a cube. It does not change; clones share it.
#[derive(Clone)]
pub struct Cube(Arc<Inner>);

struct Inner {
    description: Description,
    layout: Layout,
    steps: Vec<Step>,
    array: Array<AsyncIcechunkStore>,
    /// Indexes of shards.
    shards: AsyncArrayShardedReadableExtCache,
    decoder: Arc<Decoder>,
}

impl Cube {
    pub(crate) async fn open(session: Session, place: &str) -> Result<Self, CubeError> {
        let store = Arc::new(AsyncIcechunkStore::new(session));
        let description = Description::of_group(&store, place).await?;
        let steps = axis::read(&store, &description, place).await?;
        let definition = arrays::values(&description, steps.len() as u64)?;
        let array = axis::open(&store, &definition, place).await?;
        if array.shape()[0] != steps.len() as u64 {
            return Err(CubeError::Foreign {
                place: place.to_owned(),
                array: arrays::name(&array),
                reason: format!("it has {} steps, time {}", array.shape()[0], steps.len()),
            });
        }
        Ok(Self(Arc::new(Inner {
            layout: Layout::of(&description.grid),
            shards: AsyncArrayShardedReadableExtCache::new(&array),
            decoder: Arc::new(Decoder::new(&description)?),
            description,
            steps,
            array,
        })))
    }

    /// What it is of.
    pub fn description(&self) -> &Description {
        &self.0.description
    }

    /// Its steps in the order of time.
    pub fn steps(&self) -> &[Step] {
        &self.0.steps
    }

    /// Values of a window of cells of a step, `[row, col]`, stored unit, NaN no data. Only its chunks are read.
    pub async fn window(&self, step: usize, window: Window) -> Result<Vec<f32>, CubeError> {
        self.check(step, window)?;
        let mut values = vec![f32::NAN; window.cell_count()];
        let chunks: Vec<_> = self.0.layout.chunks_of(window).collect();
        let mut read = stream::iter(chunks)
            .map(|chunk| async move {
                let found = self.chunk(step, chunk).await?;
                Ok::<_, CubeError>((chunk, found))
            })
            .buffered(CHUNKS_AT_ONCE);
        while let Some((chunk, found)) = read.try_next().await? {
            if let Some(found) = found {
                self.copy(&found, chunk, window, &mut values);
            }
        }
        Ok(values)
    }

    /// Values of a whole step, `[row, col]`, compared with their digest.
    pub async fn field(&self, step: usize) -> Result<Vec<f32>, CubeError> {
        let grid = self.0.description.grid;
        let whole = Window {
            row: 0,
            col: 0,
            rows: grid.rows,
            cols: grid.cols,
        };
        let values = self.window(step, whole).await?;
        let Step {
            period,
            values_sha256,
        } = self.0.steps[step];
        let digested = tokio::task::spawn_blocking(move || {
            let digest = storage::fields::digest_of(&grid, &values, period);
            (digest, values)
        });
        let array = || arrays::name(&self.0.array);
        let (digest, values) = digested
            .await
            .map_err(|e| CubeError::library(&array(), "checking values", e))?;
        if digest == values_sha256 {
            Ok(values)
        } else {
            Err(CubeError::Step {
                array: array(),
                period,
            })
        }
    }

    /// Values of one cell in a run of steps, in the order of time. Each step's chunk is read.
    pub async fn series(
        &self,
        row: u32,
        col: u32,
        steps: std::ops::Range<usize>,
    ) -> Result<Vec<f32>, CubeError> {
        let cell = Window {
            row,
            col,
            rows: 1,
            cols: 1,
        };
        if let Some(last) = steps.end.checked_sub(1) {
            self.check(last, cell)?;
        }
        stream::iter(steps)
            .map(|step| async move { Ok(self.window(step, cell).await?[0]) })
            .buffered(CHUNKS_AT_ONCE)
            .try_collect()
            .await
    }

    /// What reads its parts.
    pub(crate) fn session(&self) -> Arc<RwLock<Session>> {
        self.0.array.storage().session()
    }

    /// Name of the values' array.
    pub(crate) fn array_name(&self) -> String {
        arrays::name(&self.0.array)
    }

    /// Values of a whole chunk, `[row, col]`; none where it is not stored, since no cell has data.
    async fn chunk(&self, step: usize, chunk: [u32; 2]) -> Result<Option<Vec<f32>>, CubeError> {
        let inner = &self.0;
        let index = [step as u64, chunk[0].into(), chunk[1].into()];
        let unreadable = |reason: String| CubeError::Chunk {
            array: arrays::name(&inner.array),
            chunk: index.to_vec(),
            reason,
        };
        let found = if inner.layout.is_sharded() {
            let found = inner
                .array
                .async_retrieve_encoded_subchunk(&inner.shards, &index);
            found.await.map_err(|e| first_lines(&e))
        } else {
            let found = inner.array.async_retrieve_encoded_chunk(&index).await;
            found
                .map(|found| found.map(Vec::from))
                .map_err(|e| first_lines(&e))
        };
        let Some(content) = found.map_err(unreadable)? else {
            return Ok(None);
        };
        let decoder = Arc::clone(&inner.decoder);
        let decoded = tokio::task::spawn_blocking(move || decoder.decode(content));
        let values = decoded.await.map_err(|e| unreadable(e.to_string()))?;
        values.map(Some).map_err(unreadable)
    }

    /// Copies the cells that a chunk and a window share.
    fn copy(&self, chunk: &[f32], index: [u32; 2], window: Window, values: &mut [f32]) {
        let [rows, cols] = self.0.layout.chunk;
        let (top, left) = (index[0] * rows, index[1] * cols);
        let (first, last) = (
            left.max(window.col),
            (left + cols).min(window.col + window.cols),
        );
        let width = (last - first) as usize;
        for row in top.max(window.row)..(top + rows).min(window.row + window.rows) {
            let from = (row - top) as usize * cols as usize + (first - left) as usize;
            let to =
                (row - window.row) as usize * window.cols as usize + (first - window.col) as usize;
            values[to..to + width].copy_from_slice(&chunk[from..from + width]);
        }
    }

    fn check(&self, step: usize, window: Window) -> Result<(), CubeError> {
        let grid = &self.0.description.grid;
        let fits = |from: u32, count: u32, all: u32| {
            count > 0 && from.checked_add(count).is_some_and(|end| end <= all)
        };
        if step < self.0.steps.len()
            && fits(window.row, window.rows, grid.rows)
            && fits(window.col, window.cols, grid.cols)
        {
            return Ok(());
        }
        Err(CubeError::Outside {
            what: format!("step {step}, {window:?}"),
            steps: self.0.steps.len(),
            rows: grid.rows,
            cols: grid.cols,
        })
    }
}
