//! One derivation: kept steps and new ones in the order of time, exact sums from one run of steps to the next.

use contract::key::ObjectKey;
use contract::manifest::{Contributed, MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use storage::contributed::{self, Reader};
use storage::domain::{self, Cells};
use storage::fields;

use super::carried::{Carried, CarriedBand};
use super::prior::Prior;
use super::source::SourceStep;
use super::steps::{Band, accumulate_segment, sums_after};
use super::with_data::with_data;
use super::{Progress, exact, of_all};
use crate::workshop::Workshop;
use crate::{ComputeError, Engine};

/// A derivation under way. Its result is the same, bit for bit, whatever could be kept and in whatever bands it is worked on.
pub(super) struct Derivation<'a> {
    engine: &'a Engine,
    workshop: Workshop<'a>,
    source: &'a Manifest,
    target: &'a ProductId,
    steps: &'a [SourceStep<'a>],
    domain: ObjectKey,
    cells: Cells,
    prior: Prior<'a>,
    /// Exact sums after the steps so far, from the first one on that is not kept, and what they hold.
    carried: Carried,
    done: Vec<Step>,
}

impl<'a> Derivation<'a> {
    /// Finds out what of the newest manifest can be kept, and the exact sums at its end.
    pub(super) async fn begin(
        (engine, workshop): (&'a Engine, Workshop<'a>),
        source: &'a Manifest,
        target: &'a ProductId,
        steps: &'a [SourceStep<'a>],
        latest: Option<&'a Manifest>,
    ) -> Result<Self, ComputeError> {
        let (store, grid) = (workshop.store, &source.grid);
        let mut prior = Prior::of(latest, grid, steps);
        let counts = prior.contributed(store, grid).await?;
        let cells = with_data(workshop, source, steps, &prior).await?;
        let domain = domain::write_cells(store, target, cells.clone()).await?;
        prior.over_domain(store, (&domain, &cells)).await?;
        let start = steps.first().map(|step| step.period.start);
        let start = start.expect("there is a step to accumulate");
        let mut begun = Self {
            engine,
            workshop,
            source,
            target,
            steps,
            domain,
            cells,
            carried: Carried::nothing(workshop, grid, start)?,
            prior,
            done: vec![],
        };
        // With everything kept nobody asks for the sums.
        if let Some(counts) = counts.filter(|_| begun.prior.step_count < steps.len()) {
            begun.go_on_from(counts).await?;
        }
        let kept = begun.prior.step_count;
        tracing::debug!(product = %target, kept, steps = steps.len(), "accumulating");
        Ok(begun)
    }

    /// Finds the exact sums after the last kept step; `counts` are what they hold.
    async fn go_on_from(&mut self, mut counts: Reader) -> Result<(), ComputeError> {
        let (grid, kept) = (&self.source.grid, &self.steps[..self.prior.step_count]);
        let Some(last) = kept.last() else {
            return Ok(());
        };
        for (index, rows) in self.carried.bands().to_vec().into_iter().enumerate() {
            let key = exact::key(last.made_of, grid, &rows);
            let counts = counts.rows(rows.len() as u32)?;
            let cell_count = counts.steps.len();
            let sums = match exact::kept(self.workshop.store, &key, cell_count).await? {
                Some(sums) => sums,
                None => sums_after(self.engine, &Band::new(grid, &rows), kept).await?,
            };
            let band = CarriedBand { sums, counts };
            self.carried.put(index, band, self.workshop.spool)?;
        }
        Ok(())
    }

    /// Computes and stores everything but the manifest, which is returned with number 0.
    pub(super) async fn finish(
        mut self,
        progress: &Progress<'_>,
    ) -> Result<Manifest, ComputeError> {
        let cells = self.source.grid.cell_count() as u64;
        let held = cells.min(self.workshop.band_cells).max(1);
        let per_run = (self.workshop.run_values / held).max(1) as usize;
        for run in self.steps.chunks(per_run) {
            self.run(run, progress).await?;
        }
        self.keep_sums().await?;
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
            indexes: vec![],
        })
    }

    /// Stores the exact sums after the last step, if they are not those that were kept.
    async fn keep_sums(&mut self) -> Result<(), ComputeError> {
        let is_new = self.prior.step_count < self.steps.len();
        let Some(last) = self.steps.last().filter(|_| is_new) else {
            return Ok(());
        };
        for (index, rows) in self.carried.bands().to_vec().into_iter().enumerate() {
            let key = exact::key(last.made_of, &self.source.grid, &rows);
            let band = self.carried.take(index, self.workshop.spool)?;
            exact::keep(self.workshop.store, &key, &band.sums).await?;
        }
        Ok(())
    }

    /// One run of steps.
    async fn run(
        &mut self,
        run: &[SourceStep<'_>],
        progress: &Progress<'_>,
    ) -> Result<(), ComputeError> {
        let first = self.done.len();
        let kept_count = self.prior.step_count.saturating_sub(first).min(run.len());
        for (index, step) in (first..).zip(&run[..kept_count]) {
            let kept = if let Some(kept) = self.prior.step(index) {
                kept.clone()
            } else {
                let over = (index, &self.cells);
                let field = self.prior.over(self.workshop, self.target, over).await?;
                stored(step, field, self.prior.counts(index).cloned())
            };
            self.done.push(kept);
            progress(of_all(self.done.len(), self.steps));
        }
        let rest = &run[kept_count..];
        if rest.is_empty() {
            return Ok(());
        }
        for (step, written) in rest.iter().zip(self.accumulated(rest).await?) {
            let store = self.workshop.store;
            let field = written.field.put(store, self.target).await?;
            let (counts, complete_cells) = written.counts.put(store, self.target).await?;
            let contributed = Contributed {
                counts,
                complete_cells,
                since: None,
            };
            self.done.push(stored(step, field, Some(contributed)));
            progress(of_all(self.done.len(), self.steps));
        }
        Ok(())
    }

    /// Accumulates steps band by band; fields and counts of each, still to be stored.
    async fn accumulated(&mut self, run: &[SourceStep<'_>]) -> Result<Vec<Written>, ComputeError> {
        let (grid, workshop) = (&self.source.grid, self.workshop);
        let mut written: Vec<Written> = vec![];
        for (index, rows) in self.carried.bands().to_vec().into_iter().enumerate() {
            let mut own = self.carried.take(index, workshop.spool)?;
            let band = Band::new(grid, &rows);
            let made = accumulate_segment(self.engine, &band, run, &self.cells, &own.sums).await?;
            for (at, step) in run.iter().enumerate() {
                own.counts.add(step.period, &made.has_data[at]);
                if written.len() == at {
                    let head = (own.counts.period, own.counts.of_steps);
                    let folder = workshop.spool;
                    written.push(Written {
                        field: fields::Spooled::one_of(run.len(), folder, grid, step.period)?,
                        counts: contributed::Spooled::one_of(run.len(), folder, grid, head)?,
                    });
                }
                written[at].field.band(&made.columns[at])?;
                written[at].counts.band(&own.counts)?;
            }
            own.sums = made.after;
            self.carried.put(index, own, workshop.spool)?;
        }
        Ok(written)
    }
}

/// What is made of a step, before it is stored.
struct Written {
    field: fields::Spooled,
    counts: contributed::Spooled,
}

fn stored(
    step: &SourceStep<'_>,
    (field, valid_cells): (ObjectKey, u64),
    contributed: Option<Contributed>,
) -> Step {
    Step {
        masked: None,
        period: step.period,
        field,
        raw_sha256: step.made_of,
        origin: format!("accumulated up to {}", step.step.origin),
        valid_cells,
        contributed,
    }
}
