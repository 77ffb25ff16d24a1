//! The steps of a plan in, references to them out: each is decoded and checked as a file's is, and its digest taken.

use std::pin::pin;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Step;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::quantity::Quantity;
use futures::stream::{FuturesOrdered, StreamExt as _};
use storage::Store;
use storage::attached::Reference;

use super::kept::Kept;
use crate::check::{CheckedBand, Found};
use crate::decode;
use crate::decode::DecodedBand;
use crate::error::{IngestError, Stop};
use crate::limits::{Limits, memory};
use crate::plan::{Plan, PlannedStep};

/// What all steps came to.
#[derive(Default)]
pub(super) struct Read {
    /// Those that hold a value, in the order of the store.
    pub(super) steps: Vec<Step>,
    /// Cells that hold a value in one of them.
    pub(super) domain: Vec<bool>,
    /// What was masked in all.
    pub(super) masked: MaskedCells,
    /// Least and greatest value.
    pub(super) range: Option<[f64; 2]>,
}

/// What references are stored as.
#[derive(Clone, Copy)]
pub(super) struct Put<'a> {
    pub(super) store: &'a Store,
    pub(super) product: &'a ProductId,
    pub(super) attachment: Digest,
    /// Name of the array with its store, for people.
    pub(super) origin: &'a str,
}

impl Put<'_> {
    /// A step that was read before, of this attachment now.
    pub(super) async fn again(
        &self,
        planned: &PlannedStep,
        grid: Grid,
        kept: Kept,
    ) -> Result<Step, IngestError> {
        let reference = self.reference(planned, grid);
        let field = self.reference_to(&kept.values_sha256, &reference).await?;
        Ok(Step {
            field,
            raw_sha256: self.attachment,
            origin: self.origin.to_owned(),
            ..kept.step
        })
    }

    fn reference(&self, planned: &PlannedStep, grid: Grid) -> Reference {
        Reference::new(
            self.attachment,
            (planned.time_index, planned.period),
            [grid.rows, grid.cols],
            [planned.factor, planned.offset],
        )
    }

    async fn reference_to(
        &self,
        values_sha256: &Digest,
        reference: &Reference,
    ) -> Result<ObjectKey, IngestError> {
        let put = self
            .store
            .put_reference(self.product, values_sha256, reference);
        put.await.map_err(IngestError::storage("store a reference"))
    }
}

/// Steps of the plan that are wanted, one after the other; what is to be done with each is done beside the reading of the next.
pub(super) async fn read(
    plan: &mut Plan,
    put: Put<'_>,
    wanted: &[PlannedStep],
    told: &(dyn Fn(usize, usize) + Send + Sync),
) -> Result<Read, Stop> {
    // Maps are read whole here.
    let whole = Limits {
        band_cells: u64::MAX,
        ..Limits::default()
    };
    let at_once = memory::grids_at_once(plan, &whole);
    let rows = 0..plan.mapping.grid.rows;
    let own = Own {
        put,
        quantity: plan.target.quantity,
        grid: plan.mapping.grid,
        variable: plan.variable.name.clone(),
    };
    let mut all = Read {
        domain: vec![false; own.grid.cell_count()],
        ..Read::default()
    };
    let (mut stored, mut done_count) = (FuturesOrdered::new(), 0);
    for step in wanted {
        let mut decoding = pin!(decode::run(plan, *step, rows.clone()));
        let decoded = loop {
            tokio::select! {
                decoded = &mut decoding => break decoded?,
                Some(done) = stored.next() => {
                    done_count += 1;
                    told(done_count, wanted.len());
                    all.take(done?);
                }
            }
        };
        stored.push_back(own.step(*step, decoded));
        while stored.len() >= at_once
            && let Some(done) = stored.next().await
        {
            done_count += 1;
            told(done_count, wanted.len());
            all.take(done?);
        }
    }
    while let Some(done) = stored.next().await {
        done_count += 1;
        told(done_count, wanted.len());
        all.take(done?);
    }
    Ok(all)
}

/// What the steps have in common.
struct Own<'a> {
    put: Put<'a>,
    quantity: Quantity,
    grid: Grid,
    variable: String,
}

/// A step that was read.
struct One {
    /// None if it holds no value at all.
    step: Option<Step>,
    found: Found,
    values: Vec<f32>,
}

impl Own<'_> {
    async fn step(&self, planned: PlannedStep, decoded: DecodedBand) -> Result<One, Stop> {
        let period = planned.period;
        let (quantity, grid, variable) = (self.quantity, self.grid, self.variable.clone());
        let (found, values, digest) = tokio::task::spawn_blocking(move || {
            let mut found = Found::nothing();
            let CheckedBand(values) = found.band(decoded, quantity);
            found.check(quantity, &variable, period)?;
            let digest = storage::fields::digest_of(&grid, &values, period);
            Ok::<_, Stop>((found, values, digest))
        })
        .await??;
        if found.valid_cells == 0 {
            return Ok(One {
                step: None,
                found,
                values,
            });
        }
        let reference = self.put.reference(&planned, grid);
        let field = self.put.reference_to(&digest, &reference).await?;
        let step = Step {
            period: planned.period,
            field,
            raw_sha256: self.put.attachment,
            origin: self.put.origin.to_owned(),
            valid_cells: found.valid_cells,
            masked: Some(found.masked),
            contributed: None,
        };
        Ok(One {
            step: Some(step),
            found,
            values,
        })
    }
}

impl Read {
    fn take(&mut self, one: One) {
        self.masked = self.masked + one.found.masked;
        let Some(step) = one.step else {
            return;
        };
        let [low, high] = one.found.range();
        let range = self.range;
        self.range = Some(range.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
        let cells = self.domain.iter_mut().zip(&one.values);
        cells.for_each(|(cell, value)| *cell |= !value.is_nan());
        self.steps.push(step);
    }
}
