//! One state of a cube, to read: windows of cells of a step, whole fields, blocks of its time-major copy.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::level::{self, Level};
use futures::future::BoxFuture;
use icechunk::session::Session;
use tokio::sync::RwLock;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::SERIES;
use crate::blocks::{Blocks, RunAxis};
use crate::joining::WHOLLY_COVERED;
use crate::layout::RUN_STEPS;
use crate::levels::Levels;
use crate::maps::Maps;
use crate::object_storage::ObjectStorage;
use crate::series::Runs;
use crate::stored_chunks::StoredChunks;
use crate::sums::Sums;
use crate::{CubeError, Description, Layout, Step, arrays, axis};

/// One state of a cube. It does not change; clones share it.
#[derive(Clone)]
pub struct Cube(Arc<Inner>);

struct Inner {
    description: Description,
    steps: Vec<Step>,
    values: Maps<f32>,
    /// Of which steps levels are there.
    level_names: Levels,
    /// Reads them; none where there are none.
    levels: Vec<LevelMaps>,
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

/// Reads one level.
struct LevelMaps {
    level: Level,
    values: Maps<f32>,
    coverage: Maps<u8>,
}

/// Cells of a coarser level.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelWindow {
    /// `[row, col]`, stored unit, NaN no data: means by area of the cells that hold data, unless the quantity has none
    /// (docs/decisions/032-levels.md).
    pub values: Vec<f32>,
    /// `[row, col]`: share of the area of each cell that holds data, in steps of [`WHOLLY_COVERED`](crate::WHOLLY_COVERED).
    pub coverage: Vec<u8>,
}

impl LevelWindow {
    /// That of cells of the values themselves, which have data or have none.
    pub fn of_cells(values: Vec<f32>) -> Self {
        let coverage = |value: &f32| if value.is_nan() { 0 } else { WHOLLY_COVERED };
        Self {
            coverage: values.iter().map(coverage).collect(),
            values,
        }
    }
}

impl LevelMaps {
    async fn open(
        store: &Arc<AsyncIcechunkStore>,
        description: &Description,
        level: Level,
        place: &str,
    ) -> Result<Self, CubeError> {
        let cut = || (&level.grid, Layout::of_level(&level.grid));
        let values = arrays::level_values(description, &level, 1)?;
        let coverage = arrays::level_coverage(description, &level, 1)?;
        Ok(Self {
            values: Maps::open(store, values, cut(), place).await?,
            coverage: Maps::open(store, coverage, cut(), place).await?,
            level,
        })
    }
}

impl Cube {
    /// Opens a state whose steps are read, unless the caller knows them.
    pub(crate) async fn open(
        session: Session,
        objects: &ObjectStorage,
        known_steps: Option<Vec<Step>>,
    ) -> Result<Self, CubeError> {
        let place = &objects.to_string();
        let store = Arc::new(AsyncIcechunkStore::new(session));
        let description = Description::of_group(&store, place).await?;
        let steps = match known_steps {
            Some(steps) => steps,
            None => axis::read(&store, &description, place).await?,
        };
        let definition = arrays::values(&description, steps.len() as u64)?;
        let cut = (&description.grid, Layout::of(&description.grid));
        let values = Maps::open(&store, definition, cut, place).await?;
        if values.steps() != steps.len() as u64 {
            return Err(CubeError::Foreign {
                place: place.to_owned(),
                array: values.name(),
                reason: format!("it has {} steps, time {}", values.steps(), steps.len()),
            });
        }
        let session = store.session();
        let session = session.read().await;
        let runs = Runs::read(&session, &store, SERIES, place).await?;
        let sums = Sums::read(&session, &store, &description, place).await?;
        let level_names = Levels::read(&session, &store, &description, &steps, place).await?;
        drop(session);
        let mut levels = vec![];
        if level_names.is_there {
            for level in level::levels(&description.grid) {
                levels.push(LevelMaps::open(&store, &description, level, place).await?);
            }
        }
        let blocks = match runs.len() {
            0 => None,
            count => {
                let array = arrays::series(&description, count)?;
                let array = axis::open(&store, &array, place).await?;
                let array = (array, RunAxis::First);
                Some(Blocks::new(array, &description, objects)?)
            }
        };
        let records = match sums.runs.len() {
            0 => None,
            count => {
                let array = arrays::sums(&description, count)?;
                let array = axis::open(&store, &array, place).await?;
                let array = (array, RunAxis::Last);
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
            description,
            steps,
            values,
            level_names,
            levels,
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
        self.0.values.windows(step, windows).await
    }

    /// Coarser levels that steps have; none of a grid that is small.
    pub fn levels(&self) -> impl Iterator<Item = &Level> {
        self.0.levels.iter().map(|own| &own.level)
    }

    /// Are the levels of a step there? They are used only if they were made of its values.
    pub fn has_levels(&self, step: usize) -> bool {
        self.range_of(step).is_some()
    }

    /// Smallest and largest value of a step that has levels, 0 and 0 without data: what is found in any window of any of them lies
    /// between, unless values are directions.
    pub fn range_of(&self, step: usize) -> Option<[f32; 2]> {
        let own = self.0.steps.get(step)?;
        let made_of = self.0.level_names.of(step, own)?;
        (!self.0.levels.is_empty()).then_some(made_of.range)
    }

    /// The place of a step with these values, if it is there.
    pub fn step_of(&self, values_sha256: &Digest) -> Option<usize> {
        let steps = self.0.steps.iter();
        steps
            .clone()
            .position(|step| step.values_sha256 == *values_sha256)
    }

    /// A window of cells of a coarser level of a step, by the number of the level; level 0 are the values themselves. Only its chunks
    /// are read. None where the step has no levels, or not this one.
    ///
    /// # Errors
    /// `Outside` if there is no such step or window; a chunk that is damaged or gone, by its name.
    pub fn window_at(
        &self,
        level: u32,
        window: Window,
        step: usize,
    ) -> BoxFuture<'_, Result<Option<LevelWindow>, CubeError>> {
        Box::pin(async move {
            if level == 0 {
                let values = self.window(step, window).await?;
                return Ok(Some(LevelWindow::of_cells(values)));
            }
            let own = self.0.levels.iter().find(|own| own.level.number == level);
            let Some(own) = own.filter(|_| self.has_levels(step)) else {
                return Ok(None);
            };
            let windows = [window];
            let (mut values, mut coverage) = futures::try_join!(
                own.values.windows(step, &windows),
                own.coverage.windows(step, &windows)
            )?;
            Ok(Some(LevelWindow {
                values: values.pop().unwrap_or_default(),
                coverage: coverage.pop().unwrap_or_default(),
            }))
        })
    }

    /// The first steps that have no levels, though they should.
    pub(crate) fn without_levels(&self) -> Vec<usize> {
        if level::levels(&self.0.description.grid).is_empty() {
            return vec![];
        }
        let steps = self.0.steps.iter().enumerate();
        steps
            .filter(|(place, step)| self.0.level_names.of(*place, step).is_none())
            .map(|(place, _)| place)
            .collect()
    }

    /// Names of the arrays of levels.
    pub(crate) fn level_array_names(&self) -> Vec<String> {
        let names = |own: &LevelMaps| [own.values.name(), own.coverage.name()];
        self.0.levels.iter().flat_map(names).collect()
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
            let array = || self.0.values.name();
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

    /// What compaction is to make, ascending: runs of the time-major copy, and of those that are there sums.
    pub(crate) fn missing(&self) -> BTreeSet<usize> {
        let Inner { runs, steps, .. } = &*self.0;
        let mut missing: BTreeSet<usize> = runs.missing(steps).collect();
        if self.0.sums.next_basis(&self.0.description).is_some() {
            let complete = 0..steps.len() / RUN_STEPS;
            missing.extend(complete.filter(|run| !self.is_summed(*run)));
        }
        missing
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
        self.0.values.array.storage().session()
    }

    /// Names its state.
    pub(crate) async fn snapshot(&self) -> String {
        self.session().read().await.snapshot_id().to_string()
    }

    /// Name of the values' array.
    pub(crate) fn array_name(&self) -> String {
        self.0.values.name()
    }

    /// Name of the array of the time-major copy, if there is one.
    pub(crate) fn series_name(&self) -> Option<String> {
        self.0.blocks.as_ref().map(Blocks::name)
    }

    /// Values of a whole shard of the time-major copy, `[step, row, col]`; none where no cell has data.
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
}
