//! One derivation: kept steps and new ones in the order of time, exact sums from one run of steps to the next.

use contract::manifest::{Contributed, MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use storage::contributed::{self, Contributed as Counts};
use storage::{Store, domain, fields};

use super::prior::Prior;
use super::source::SourceStep;
use super::steps::{accumulate_segment, sums_after};
use super::{Progress, exact, of_all};
use crate::{ComputeError, Engine};
use contract::key::ObjectKey;

/// Values of one query: 256 MiB of f32, whatever the grid.
const RUN_VALUES: usize = 64 << 20;

/// A derivation under way. Its result is the same, bit for bit, whatever could be kept.
pub(super) struct Derivation<'a> {
    engine: &'a Engine,
    source: &'a Manifest,
    target: &'a ProductId,
    steps: &'a [SourceStep<'a>],
    domain: ObjectKey,
    /// `[row, col]`.
    cells: Vec<bool>,
    prior: Prior<'a>,
    /// Exact sums after the steps so far, from the first one on that is not kept.
    sums: Vec<i64>,
    /// Steps and time that they hold.
    counts: Counts,
    done: Vec<Step>,
}

impl<'a> Derivation<'a> {
    /// Finds out what of the newest manifest can be kept, and the exact sums at its end.
    pub(super) async fn begin(
        engine: &'a Engine,
        source: &'a Manifest,
        target: &'a ProductId,
        steps: &'a [SourceStep<'a>],
        latest: Option<&'a Manifest>,
    ) -> Result<Self, ComputeError> {
        let (store, grid) = (engine.store(), &source.grid);
        let cells = domain::read(store, &source.domain).await?;
        if cells.len() != grid.cell_count() {
            return Err(ComputeError::inconsistent(
                source.domain.to_string(),
                "it does not fill its product's grid",
            ));
        }
        let domain = domain::write(store, target, &cells).await?;
        let mut prior = Prior::of(store, latest, grid, steps, &domain).await?;
        let counts = prior.contributed(store, grid, steps).await?;
        let kept = &steps[..prior.step_count];
        let sums = match kept.last() {
            // With everything kept nobody asks for the sums.
            Some(last) if kept.len() < steps.len() => {
                match exact::kept(store, last.made_of, grid.cell_count()).await? {
                    Some(sums) => sums,
                    None => sums_after(engine, grid, kept).await?,
                }
            }
            _ => vec![0; grid.cell_count()],
        };
        tracing::debug!(product = %target, kept = kept.len(), steps = steps.len(), "accumulating");
        Ok(Self {
            engine,
            source,
            target,
            steps,
            domain,
            cells,
            prior,
            sums,
            counts,
            done: vec![],
        })
    }

    /// Computes and stores everything but the manifest, which is returned with number 0.
    pub(super) async fn finish(
        mut self,
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let per_run = (RUN_VALUES / self.source.grid.cell_count()).max(1);
        for run in self.steps.chunks(per_run) {
            self.run(run, progress).await?;
        }
        if let Some(last) = self
            .steps
            .last()
            .filter(|_| self.prior.step_count < self.steps.len())
        {
            exact::keep(self.store(), last.made_of, &self.sums).await?;
        }
        Ok(Manifest {
            schema: MANIFEST_SCHEMA,
            product: self.target.clone(),
            number: 0,
            title: format!("{}, accumulated", self.source.title),
            quantity: Quantity::AccumulatedCarbon,
            synthetic: self.source.synthetic,
            source: self.source.source.clone(),
            grid: self.source.grid,
            steps: self.done,
            domain: self.domain,
            series: vec![],
            derived_from: Some(self.source.id()),
            computed: None,
            notices: vec![],
        })
    }

    fn store(&self) -> &'a Store {
        self.engine.store()
    }

    /// One run of steps.
    async fn run(
        &mut self,
        run: &[SourceStep<'_>],
        progress: &Progress<'_>,
    ) -> Result<(), ComputeError> {
        let first = self.done.len();
        let kept = (first..first + run.len()).map_while(|index| self.prior.step(index));
        let kept: Vec<Step> = kept.cloned().collect();
        if kept.len() == run.len() {
            self.done.extend(kept);
            progress(of_all(self.done.len(), self.steps));
            return Ok(());
        }
        let (columns, has_data) = self.columns(first, run).await?;
        let kept_count = run.len() - has_data.len();
        for (index, (step, values)) in run.iter().zip(&columns).enumerate() {
            let contributed = match index.checked_sub(kept_count) {
                Some(new) => self.counted(step, &has_data[new]).await?,
                None => self.prior.counts(first + index).cloned(),
            };
            let step = match self.prior.step(first + index) {
                Some(kept) => kept.clone(),
                None => self.stored(step, values, contributed).await?,
            };
            self.done.push(step);
            progress(of_all(self.done.len(), self.steps));
        }
        Ok(())
    }

    /// Values of every step of a run that is stored anew, `[row, col]` each: read where they are kept over another domain, else
    /// accumulated; and of those that are accumulated the cells with data.
    async fn columns(
        &mut self,
        first: usize,
        run: &[SourceStep<'_>],
    ) -> Result<(Vec<Vec<f32>>, Vec<Vec<bool>>), ComputeError> {
        let kept_count = self.prior.step_count.saturating_sub(first).min(run.len());
        let mut columns = vec![];
        for index in first..first + kept_count {
            columns.push(match self.prior.step(index) {
                // Its field is kept as it is.
                Some(_step) => vec![],
                None => self.prior.column(self.store(), index, &self.cells).await?,
            });
        }
        let rest = &run[kept_count..];
        if rest.is_empty() {
            return Ok((columns, vec![]));
        }
        let grid = &self.source.grid;
        let new = accumulate_segment(self.engine, grid, rest, &self.cells, &self.sums).await?;
        columns.extend(new.columns);
        self.sums = new.after;
        Ok((columns, new.has_data))
    }

    /// Counts a step in and stores what the sums hold after it.
    async fn counted(
        &mut self,
        step: &SourceStep<'_>,
        has_data: &[bool],
    ) -> Result<Option<Contributed>, ComputeError> {
        self.counts.add(step.period, has_data);
        let (store, grid, counts) = (self.store(), &self.source.grid, &self.counts);
        Ok(Some(Contributed {
            counts: contributed::write(store, self.target, grid, counts).await?,
            complete_cells: counts.complete_cells(),
        }))
    }

    async fn stored(
        &self,
        step: &SourceStep<'_>,
        values: &[f32],
        contributed: Option<Contributed>,
    ) -> Result<Step, ComputeError> {
        let (store, grid) = (self.store(), &self.source.grid);
        Ok(Step {
            masked: None,
            period: step.period,
            field: fields::write(store, self.target, grid, values, step.period).await?,
            raw_sha256: step.made_of,
            origin: format!("accumulated up to {}", step.step.origin),
            valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
            contributed,
        })
    }
}
