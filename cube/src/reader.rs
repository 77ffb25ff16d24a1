//! One state of a cube, to read: windows of cells of a step, whole fields, blocks of its time-major copy.

use std::collections::BTreeMap;
use std::sync::Arc;

use contract::chunk::Window;
use futures::future::BoxFuture;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::session::Session;
use tokio::sync::RwLock;
use zarrs::array::{Array, AsyncArrayShardedReadableExt as _, AsyncArrayShardedReadableExtCache};
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::SERIES;
use crate::blocks::Blocks;
use crate::error::first_lines;
use crate::field::Decoder;
use crate::layout::RUN_STEPS;
use crate::object_storage::ObjectStorage;
use crate::series::Runs;
use crate::stored_chunks::StoredChunks;
use crate::sums::Sums;
use crate::unreadable::Object;
use crate::{CubeError, Description, Layout, Step, arrays, axis};

/// Chunks that are read and decoded at a time.
const CHUNKS_AT_ONCE: usize = 8;

/// One state of a cube. It does not change; clones share it.
#[derive(Clone)]
pub struct Cube(Arc<Inner>);

struct Inner {
    description: Description,
    /// For messages.
    place: String,
    layout: Layout,
    steps: Vec<Step>,
    array: Array<AsyncIcechunkStore>,
    /// Indexes of shards.
    shards: AsyncArrayShardedReadableExtCache,
    decoder: Arc<Decoder>,
    /// Runs of the time-major copy.
    runs: Runs,
    /// Of each run, how many of the steps in its place it holds, the first ones.
    held: Vec<usize>,
    /// Reads them; none where there are none.
    blocks: Option<Blocks>,
    /// Sums of blocks.
    sums: Sums,
    /// Reads them; none where there are none.
    records: Option<Blocks>,
}

impl Cube {
    pub(crate) async fn open(session: Session, objects: &ObjectStorage) -> Result<Self, CubeError> {
        let place = &objects.to_string();
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
        let session = store.session();
        let session = session.read().await;
        let runs = Runs::read(&session, &store, SERIES, place).await?;
        let sums = Sums::read(&session, &store, &description, place).await?;
        drop(session);
        let blocks = match runs.len() {
            0 => None,
            count => {
                let array = arrays::series(&description, count)?;
                let array = axis::open(&store, &array, place).await?;
                Some(Blocks::new(array, &description, objects)?)
            }
        };
        let records = match sums.runs.len() {
            0 => None,
            count => {
                let array = arrays::sums(&description, count)?;
                let array = axis::open(&store, &array, place).await?;
                Some(Blocks::new(array, &description, objects)?)
            }
        };
        let held = (0..runs.len()).map(|run| runs.held_count(run, &steps));
        Ok(Self(Arc::new(Inner {
            held: held.collect(),
            runs,
            blocks,
            sums,
            records,
            layout: Layout::of(&description.grid),
            shards: AsyncArrayShardedReadableExtCache::new(&array),
            decoder: Arc::new(Decoder::new(&description)?),
            description,
            place: place.to_owned(),
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
    pub fn window(
        &self,
        step: usize,
        window: Window,
    ) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
            let mut found = self.windows(step, &[window]).await?;
            Ok(found.pop().unwrap_or_default())
        })
    }

    /// The same of several windows; a chunk that some of them touch is read once.
    pub(crate) async fn windows(
        &self,
        step: usize,
        windows: &[Window],
    ) -> Result<Vec<Vec<f32>>, CubeError> {
        let mut touched: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        let mut values = vec![];
        for (number, window) in windows.iter().enumerate() {
            self.check(step, *window)?;
            values.push(vec![f32::NAN; window.cell_count()]);
            for chunk in self.0.layout.chunks_of(*window) {
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

    /// Values of a whole step, `[row, col]`, compared with their digest.
    pub fn field(&self, step: usize) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
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
        })
    }

    /// The time-major run that holds a step, if it is there.
    pub(crate) fn run_of(&self, step: usize) -> Option<usize> {
        let run = step / RUN_STEPS;
        (step % RUN_STEPS < *self.0.held.get(run)?).then_some(run)
    }

    /// Which runs there are.
    pub(crate) fn runs(&self) -> &Runs {
        &self.0.runs
    }

    /// Blocks of a run that [`Self::run_of`] gave, as they are stored.
    pub(crate) async fn stored_blocks(
        &self,
        run: usize,
        blocks: &[[u32; 2]],
    ) -> Result<StoredChunks, CubeError> {
        match &self.0.blocks {
            Some(own) => own.stored(run, blocks).await,
            None => Err(self.no_run(run)),
        }
    }

    /// The error of one of them that cannot be decoded.
    pub(crate) async fn undecoded(&self, run: usize, block: [u32; 2], reason: &str) -> CubeError {
        match &self.0.blocks {
            Some(own) => own.undecoded(run, block, reason).await,
            None => self.no_run(run),
        }
    }

    /// Sums of blocks.
    pub(crate) fn sums(&self) -> &Sums {
        &self.0.sums
    }

    /// Are there sums of the values of a run?
    pub(crate) fn is_summed(&self, run: usize) -> bool {
        let own = self.0.sums.runs.name(run);
        own.is_some() && own == self.0.runs.name(run)
    }

    /// What compaction is to make next: a run of the time-major copy, and sums of it.
    pub(crate) fn first_missing(&self) -> Option<usize> {
        let Inner { runs, steps, .. } = &*self.0;
        let missing = runs.first_missing(steps);
        if self.0.sums.next_basis(&self.0.description).is_none() {
            return missing;
        }
        let complete = missing.unwrap_or(usize::MAX).min(steps.len() / RUN_STEPS);
        (0..complete).find(|run| !self.is_summed(*run)).or(missing)
    }

    /// Records of sums of a run, as they are stored.
    pub(crate) async fn records(
        &self,
        run: usize,
        blocks: &[[u32; 2]],
    ) -> Result<StoredChunks, CubeError> {
        match &self.0.records {
            Some(own) => own.stored(run, blocks).await,
            None => Err(self.no_run(run)),
        }
    }

    /// The error of one of them that cannot be decoded.
    pub(crate) async fn undecoded_record(
        &self,
        run: usize,
        block: [u32; 2],
        reason: &str,
    ) -> CubeError {
        match &self.0.records {
            Some(own) => own.undecoded(run, block, reason).await,
            None => self.no_run(run),
        }
    }

    /// Records of a whole shard, `[row, col, byte]` of blocks; none where no cell has data.
    pub(crate) async fn records_of_shard(
        &self,
        run: usize,
        shard: [u32; 2],
    ) -> Result<Option<Vec<u8>>, CubeError> {
        match &self.0.records {
            Some(own) => own.shard(run, shard).await,
            None => Ok(None),
        }
    }

    /// Name of the array of sums, if there is one.
    pub(crate) fn sums_name(&self) -> Option<String> {
        self.0.records.as_ref().map(Blocks::name)
    }

    fn no_run(&self, run: usize) -> CubeError {
        CubeError::Outside {
            what: format!("run {run} of the time-major copy"),
            steps: self.0.steps.len(),
            rows: self.0.description.grid.rows,
            cols: self.0.description.grid.cols,
        }
    }

    /// What reads its parts.
    pub(crate) fn session(&self) -> Arc<RwLock<Session>> {
        self.0.array.storage().session()
    }

    /// Name of the values' array.
    pub(crate) fn array_name(&self) -> String {
        arrays::name(&self.0.array)
    }

    /// Name of the array of the time-major copy, if there is one.
    pub(crate) fn series_name(&self) -> Option<String> {
        self.0.blocks.as_ref().map(Blocks::name)
    }

    /// Values of a whole shard of the time-major copy, `[row, col, step]`; none where no cell has data.
    pub(crate) async fn shard(
        &self,
        run: usize,
        shard: [u32; 2],
    ) -> Result<Option<Vec<f32>>, CubeError> {
        match &self.0.blocks {
            Some(blocks) => blocks.shard(run, shard).await,
            None => Ok(None),
        }
    }

    /// Values of a whole chunk, `[row, col]`; none where it is not stored, since no cell has data.
    async fn chunk(&self, step: usize, chunk: [u32; 2]) -> Result<Option<Vec<f32>>, CubeError> {
        let inner = &self.0;
        let index = [step as u64, chunk[0].into(), chunk[1].into()];
        match self.decoded(index).await {
            Ok(values) => Ok(values),
            Err(reason) => {
                let [rows, cols] =
                    [0, 1].map(|at| inner.layout.object[at] / inner.layout.chunk[at]);
                let object = Object {
                    array: &inner.array,
                    place: &inner.place,
                    index: [
                        index[0],
                        index[1] / u64::from(rows),
                        index[2] / u64::from(cols),
                    ],
                };
                Err(object.unreadable(index, &reason).await)
            }
        }
    }

    async fn decoded(&self, index: [u64; 3]) -> Result<Option<Vec<f32>>, String> {
        let inner = &self.0;
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
        let Some(content) = found? else {
            return Ok(None);
        };
        let decoder = Arc::clone(&inner.decoder);
        let decoded = tokio::task::spawn_blocking(move || decoder.decode(content));
        decoded.await.map_err(|e| e.to_string())?.map(Some)
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
