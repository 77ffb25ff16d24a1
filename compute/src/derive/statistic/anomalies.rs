//! Anomalies landed: step by step, or mean by mean, the climatology taken off.
//!
//! Where there is memory for it, the blocks of cells that are wanted are read along time, a run of steps at once; else whole fields.

use std::sync::Arc;

use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use cube::AtHand;
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
use storage::{StorageError, fields};

use super::super::{DeriveProgress, Progress};
use super::blocks::Blocks;
use super::computed::Computed;
use super::found::Found;
use super::landed::Landing;
use super::means::{MeanOf, Sum};
use super::plan::Output;
use super::runs::{AnomaliesOf, Less, MadeRun, OfAnomalies, Runs};
use crate::ComputeError;

/// Most fields on their way for each that can be encoded at once: others are flushed to the disk meanwhile.
const ON_THEIR_WAY: usize = 4;
/// Share of the memory for work that they may take.
const FIELDS_SHARE: usize = 8;
/// Bytes of a cell on its way: its value, in its pages, as they are stored, and the sum that it may be made of.
const CELL_BYTES: usize = 44;

/// A version to be published, and what its cube can be made of.
pub(super) type Made = (Manifest, Option<Arc<dyn AtHand>>);

impl Landing<'_> {
    /// Stores everything but the manifest, which is returned with number 0, of anomalies that are held or of their normals.
    pub(super) async fn anomalies(
        &self,
        computed: Computed,
        progress: &Progress<'_>,
    ) -> Result<Made, ComputeError> {
        let (plan, source, engine) = (self.plan, self.sources.first, self.engine);
        let stored = (self.stored, &(0..self.stored.grid.rows));
        let blocks = Arc::new(Blocks::of(engine, &source.grid, self.wanted, stored));
        let of = if let Some(held) = computed.held {
            AnomaliesOf::Held(Arc::new(held))
        } else {
            let bin = |output: &Output| plan.parts.of_period(output.period);
            let less = Arc::new(Less {
                grid: source.grid,
                stored: *self.stored,
                of: Arc::clone(&plan.anomalies_of),
                bins: plan.outputs.iter().map(bin).collect(),
                normals: computed.maps.held()?,
                factor: plan.factor,
            });
            if !blocks.are_held_in_runs() {
                return Ok((self.by_fields(&less, progress).await?, None));
            }
            let source = engine.values(source, &source.id()).await?;
            AnomaliesOf::Product { source, less }
        };
        let mut at_hand = OfAnomalies {
            runs: Runs {
                blocks,
                count: plan.outputs.len(),
                of,
            },
            checks: vec![],
        };
        let manifest = self.by_runs(&mut at_hand, progress).await?;
        Ok((manifest, Some(Arc::new(at_hand))))
    }

    /// Fields that may be on their way at once, of so many cells each.
    fn at_once(&self, cells: usize) -> usize {
        let engine = self.engine;
        let fields = engine.memory_bytes() / FIELDS_SHARE / (cells * CELL_BYTES).max(1);
        fields.clamp(1, ON_THEIR_WAY * engine.partitions().get())
    }

    /// Anomalies of blocks of cells, a run of steps at once; what is needed to make them again stays in `at_hand`.
    async fn by_runs(
        &self,
        at_hand: &mut OfAnomalies,
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let grid = self.stored.grid;
        let (mut found, mut checks) = (Found::nothing(grid.cell_count()), vec![]);
        let mut steps = vec![];
        let runs = &at_hand.runs;
        let each = |(run, made): (usize, MadeRun)| {
            made.cells(&grid, |cell| found.has_data(cell));
            checks.push(made.check);
            let made = Arc::new(made);
            let step = move |(at, anomaly): (usize, usize)| {
                let made = Arc::clone(&made);
                Ok(self.stored(anomaly, 0, move || made.values.map(at, &grid)))
            };
            stream::iter(runs.anomalies(run).enumerate().map(step))
        };
        let made = stream::iter(0..runs.count())
            .then(|run| async move { Ok::<_, ComputeError>((run, runs.make(run).await?)) }.boxed());
        // In the order of time.
        let mut landing = made
            .map_ok(each)
            .try_flatten()
            .try_buffered(self.at_once(grid.cell_count()))
            .boxed();
        let mut of_steps = Found::nothing(0);
        while let Some((step, of_step)) = landing.try_next().await? {
            of_steps.merge(&of_step);
            steps.push(step);
            progress(self.done(steps.len()));
        }
        drop(landing);
        found.merge(&of_steps);
        at_hand.checks = checks;
        self.manifest(steps, found).await
    }

    /// Anomalies of whole fields: where there is no memory for runs of steps.
    async fn by_fields(
        &self,
        less: &Arc<Less>,
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let anomaly = |anomaly| async move {
            let sums = self.sums(&less.of[anomaly]).await?;
            let less = Arc::clone(less);
            let cells = self.stored.grid.cell_count();
            let values = move || less.map(anomaly, &sums);
            self.stored(anomaly, cells, values).await
        };
        let mut landing = stream::iter(0..less.of.len())
            .map(|number| anomaly(number).boxed())
            .buffered(self.at_once(self.sources.first.grid.cell_count()))
            .boxed();
        let mut found = Found::nothing(self.stored.grid.cell_count());
        let mut steps = vec![];
        while let Some((step, of_step)) = landing.try_next().await? {
            found.merge(&of_step);
            steps.push(step);
            progress(self.done(steps.len()));
        }
        drop(landing);
        self.manifest(steps, found).await
    }

    /// What the steps of a mean come to in every cell that is stored.
    async fn sums(&self, mean: &MeanOf) -> Result<Vec<Sum>, ComputeError> {
        let source = self.sources.first;
        let mut sums = vec![Sum::default(); source.grid.cell_count()];
        for step in mean.steps.clone() {
            let field = &source.steps[step].field;
            let values = fields::read(self.engine.store(), field, &source.grid).await?;
            for (sum, value) in sums.iter_mut().zip(&values) {
                mean.add(sum, step, *value);
            }
        }
        Ok(self.stored.map(sums))
    }

    /// Stores an anomaly whose values are made on a thread of their own, and tells which of so many cells hold data.
    async fn stored(
        &self,
        anomaly: usize,
        cells: usize,
        values: impl FnOnce() -> Vec<f32> + Send + 'static,
    ) -> Result<(Step, Found), ComputeError> {
        let (store, grid) = (self.engine.store(), self.stored.grid);
        let output = &self.plan.outputs[anomaly];
        let period = output.period;
        let making = move || {
            let values = values();
            let mut found = Found::nothing(cells);
            found.add(0, &values);
            Ok::<_, StorageError>((fields::encode(&grid, &values, period)?, found))
        };
        let made = tokio::task::spawn_blocking(making).await;
        let (encoded, found) = made.map_err(|e| ComputeError::inconsistent("an anomaly", e))??;
        let key = ObjectKey::field(self.target, &encoded.values_sha256);
        store.put_new(&key, encoded.content).await?;
        Ok((output.step(key, found.valid_cells), found))
    }

    fn done(&self, done_steps: usize) -> DeriveProgress {
        let all_steps = self.plan.outputs.len();
        DeriveProgress {
            done_steps,
            all_steps,
        }
    }
}
