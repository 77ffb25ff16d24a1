//! Anomalies landed: step by step, the climatology taken off.
//!
//! Where there is memory for it, the blocks of cells that are wanted are read along time, a run of steps at once; else whole fields.

use std::ops::Range;
use std::sync::Arc;

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::time::Period;
use cube::Block;
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use storage::{Encoded, StorageError, fields};

use super::super::{DeriveProgress, Progress};
use super::blocks::Blocks;
use super::landed::{Found, Landing};
use crate::ComputeError;

/// Most fields on their way for each that can be encoded at once: others are flushed to the disk meanwhile.
const ON_THEIR_WAY: usize = 4;
/// Share of the memory for work that they may take.
const FIELDS_SHARE: usize = 8;
/// Bytes of a cell on its way: its value, in its pages, as they are stored.
const CELL_BYTES: usize = 12;

impl Landing<'_> {
    /// Stores everything but the manifest, which is returned with number 0; `normals` are those of every bin, `[bin][row, col]`,
    /// stored unit, NaN where there is none.
    pub(super) async fn anomalies(
        &self,
        normals: Vec<Vec<f64>>,
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let (plan, source, engine) = (self.plan, self.sources.first, self.engine);
        let (grid, factor) = (source.grid, plan.factor);
        let less = Arc::new(Less {
            grid,
            normals,
            factor,
        });
        let values = engine.values(source, &source.id()).await?;
        let blocks = Blocks::of(
            &grid,
            self.wanted,
            source.steps.len(),
            engine.memory_bytes(),
        );
        let (values, blocks) = (&values, &blocks);
        let read = |steps: Range<usize>| async move {
            let held = blocks.in_run(values, source, steps.clone()).await?;
            Ok::<_, ComputeError>(Arc::new(Run { steps, held }))
        };
        let each = |run: Arc<Run>| {
            let less = Arc::clone(&less);
            let steps = run.steps.clone();
            let step = move |step| Ok(self.anomaly(step, Arc::clone(&run), Arc::clone(&less)));
            stream::iter(steps.map(step))
        };
        let runs = values.runs().into_iter();
        let runs = runs.filter_map(|run| overlap(&run, &plan.written()));
        let fields = engine.memory_bytes() / FIELDS_SHARE / (grid.cell_count() * CELL_BYTES).max(1);
        let at_once = fields.clamp(1, ON_THEIR_WAY * engine.partitions().get());
        // In the order of time.
        let mut landing = stream::iter(runs)
            .then(|steps| read(steps).boxed())
            .map_ok(each)
            .try_flatten()
            .try_buffered(at_once)
            .boxed();
        let mut found = Found::nothing(grid.cell_count());
        let mut steps = vec![];
        while let Some((step, of_step)) = landing.try_next().await? {
            found.merge(&of_step);
            steps.push(step);
            progress(DeriveProgress {
                done_steps: steps.len(),
                all_steps: plan.outputs.len(),
            });
        }
        drop(landing);
        self.manifest(steps, &found).await
    }

    async fn anomaly(
        &self,
        step: usize,
        run: Arc<Run>,
        less: Arc<Less>,
    ) -> Result<(Step, Found), ComputeError> {
        let source = self.sources.first;
        let (store, grid) = (self.engine.store(), source.grid);
        let own = &source.steps[step];
        let output = &self.plan.outputs[step - self.plan.first_written];
        let (bin, period) = (self.plan.bins.of(own.period), output.period);
        let field = match run.held {
            Some(_) => None,
            None => Some(fields::read(store, &own.field, &grid).await?),
        };
        let making = move || {
            let values = field.unwrap_or_else(|| run.map(step, &grid));
            less.encoded(values, bin, period)
        };
        let made = tokio::task::spawn_blocking(making).await;
        let (encoded, found) = made.map_err(|e| ComputeError::inconsistent("an anomaly", e))??;
        let key = ObjectKey::field(self.target, &encoded.values_sha256);
        store.put_new(&key, encoded.content).await?;
        Ok((output.step(key, found.valid_cells), found))
    }
}

/// The steps that are in both.
fn overlap(run: &Range<usize>, other: &Range<usize>) -> Option<Range<usize>> {
    let both = run.start.max(other.start)..run.end.min(other.end);
    (!both.is_empty()).then_some(both)
}

/// Steps that are read together.
struct Run {
    steps: Range<usize>,
    /// Values of the blocks in which any cell is wanted; none where each step is read from its field.
    held: Option<Vec<Block>>,
}

impl Run {
    /// One of its steps, `[row, col]`, NaN where no block is held.
    fn map(&self, step: usize, grid: &Grid) -> Vec<f32> {
        let mut map = vec![f32::NAN; grid.cell_count()];
        let (at, count) = (step - self.steps.start, self.steps.len());
        for block in self.held.iter().flatten() {
            let cells = block.window.cell_indices(grid);
            for (place, values) in cells.zip(block.values.chunks_exact(count)) {
                map[place] = values[at];
            }
        }
        map
    }
}

/// What is taken off.
struct Less {
    grid: Grid,
    /// `[bin][row, col]`, stored unit, NaN where nothing is wanted or there is none.
    normals: Vec<Vec<f64>>,
    /// From the product's unit to that of anomalies.
    factor: f64,
}

impl Less {
    /// A step less the normals of its bin.
    fn encoded(
        &self,
        mut values: Vec<f32>,
        bin: usize,
        period: Period,
    ) -> Result<(Encoded, Found), StorageError> {
        for (value, normal) in values.iter_mut().zip(&self.normals[bin]) {
            *value = ((f64::from(*value) - normal) * self.factor) as f32;
        }
        let mut found = Found::nothing(values.len());
        found.add(&values);
        Ok((fields::encode(&self.grid, &values, period)?, found))
    }
}
