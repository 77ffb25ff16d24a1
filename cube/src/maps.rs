//! A map-major array of one state of a cube, to read: windows of cells of a step, of which only their chunks are read.

use std::collections::BTreeMap;
use std::sync::Arc;

use contract::chunk::Window;
use contract::grid::Grid;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::format::Path;
use zarrs::array::{Array, AsyncArrayShardedReadableExt as _, AsyncArrayShardedReadableExtCache};
use zarrs::storage::byte_range::ByteRange;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::Definition;
use crate::error::first_lines;
use crate::field::{Decoder, Number};
use crate::unreadable::Object;
use crate::{CubeError, Layout, arrays, axis, shards};

/// Chunks that are read and decoded at a time.
const CHUNKS_AT_ONCE: usize = 8;

/// Reads one array.
pub(crate) struct Maps<T> {
    pub(crate) array: Array<AsyncIcechunkStore>,
    /// For messages.
    place: String,
    layout: Layout,
    /// Rows and columns.
    cells: [u32; 2],
    /// Indexes of shards.
    shards: AsyncArrayShardedReadableExtCache,
    decoder: Arc<Decoder<T>>,
}

impl<T: Number> Maps<T> {
    /// Opens an array over a grid, which must be what it is defined to be.
    pub(crate) async fn open(
        store: &Arc<AsyncIcechunkStore>,
        definition: Definition,
        (grid, layout): (&Grid, Layout),
        place: &str,
    ) -> Result<Self, CubeError> {
        let array = axis::open(store, &definition, place).await?;
        Ok(Self {
            shards: AsyncArrayShardedReadableExtCache::new(&array),
            decoder: Arc::new(Decoder::new(definition, &layout)),
            array,
            place: place.to_owned(),
            layout,
            cells: [grid.rows, grid.cols],
        })
    }

    /// How many steps it has.
    pub(crate) fn steps(&self) -> u64 {
        self.array.shape()[0]
    }

    /// Name of the array.
    pub(crate) fn name(&self) -> String {
        arrays::name(&self.array)
    }

    /// Numbers of some windows of cells of a step, `[row, col]` of each; a chunk that some of them touch is read once.
    pub(crate) async fn windows(
        &self,
        step: usize,
        windows: &[Window],
    ) -> Result<Vec<Vec<T>>, CubeError> {
        let mut touched: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        let mut values = vec![];
        for (number, window) in windows.iter().enumerate() {
            self.check(step, *window)?;
            values.push(vec![T::BLANK; window.cell_count()]);
            for chunk in self.layout.chunks_of(*window) {
                touched.entry(chunk).or_default().push(number);
            }
        }
        let mut read = stream::iter(touched)
            .map(|(chunk, own)| async move {
                let found = self.chunk(step, chunk).await?;
                Ok::<_, CubeError>((chunk, own, found))
            })
            .buffered(CHUNKS_AT_ONCE);
        while let Some((chunk, own, found)) = read.try_next().await? {
            let Some(found) = found else { continue };
            for number in own {
                self.copy(&found, chunk, windows[number], &mut values[number]);
            }
        }
        Ok(values)
    }

    /// Numbers of a whole chunk, `[row, col]`; none where it is not stored, since no cell has data.
    async fn chunk(&self, step: usize, chunk: [u32; 2]) -> Result<Option<Vec<T>>, CubeError> {
        let index = [step as u64, chunk[0].into(), chunk[1].into()];
        match self.decoded(index).await {
            Ok(values) => Ok(values),
            Err(reason) => {
                let object = Object {
                    array: &self.array,
                    place: &self.place,
                    index: self.object_of(index),
                };
                Err(object.unreadable(index, &reason).await)
            }
        }
    }

    /// The object that holds a chunk.
    fn object_of(&self, index: [u64; 3]) -> [u64; 3] {
        let layout = &self.layout;
        let [rows, cols] = [0, 1].map(|at| u64::from(layout.object[at] / layout.chunk[at]));
        [index[0], index[1] / rows, index[2] / cols]
    }

    /// Does the repository name the object of a chunk?
    async fn is_named(&self, index: [u64; 3]) -> Result<bool, String> {
        let path = Path::new(self.array.path().as_str()).map_err(|e| e.to_string())?;
        shards::is_named(&self.array, &path, self.object_of(index)).await
    }

    async fn decoded(&self, index: [u64; 3]) -> Result<Option<Vec<T>>, String> {
        let found = if self.layout.is_sharded() {
            let place = self.array.async_subchunk_byte_range(&self.shards, &index);
            let place = match place.await {
                Ok(place) => place,
                // Of a shard that is not stored the library says that it cannot be found.
                Err(_) if !self.is_named(index).await? => return Ok(None),
                Err(error) => return Err(first_lines(&error)),
            };
            // It gives what the index has, where a chunk that is not stored has no place but all bits set, and would read it there.
            if place.is_none_or(|place| matches!(place, ByteRange::FromStart(u64::MAX, _))) {
                return Ok(None);
            }
            let found = self
                .array
                .async_retrieve_encoded_subchunk(&self.shards, &index);
            found.await.map_err(|e| first_lines(&e))
        } else {
            let found = self.array.async_retrieve_encoded_chunk(&index).await;
            found
                .map(|found| found.map(Vec::from))
                .map_err(|e| first_lines(&e))
        };
        let Some(content) = found? else {
            return Ok(None);
        };
        let decoder = Arc::clone(&self.decoder);
        let decoded = tokio::task::spawn_blocking(move || decoder.decode(content));
        decoded.await.map_err(|e| e.to_string())?.map(Some)
    }

    /// Copies the cells that a chunk and a window share.
    fn copy(&self, chunk: &[T], index: [u32; 2], window: Window, values: &mut [T]) {
        let [rows, cols] = self.layout.chunk;
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
        let [rows, cols] = self.cells;
        let steps = self.steps() as usize;
        let fits = |from: u32, count: u32, all: u32| {
            count > 0 && from.checked_add(count).is_some_and(|end| end <= all)
        };
        if step < steps
            && fits(window.row, window.rows, rows)
            && fits(window.col, window.cols, cols)
        {
            return Ok(());
        }
        Err(CubeError::Outside {
            what: format!("step {step}, {window:?} of {}", self.name()),
            steps,
            rows,
            cols,
        })
    }
}
