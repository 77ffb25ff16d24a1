//! The steps of a plan in, references to them out: each is decoded and checked band by band as a file's is, and its digest taken.

use std::ops::Range;
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
use storage::domain::Cells;
use storage::fields::FieldDigest;
use tokio::sync::mpsc;

use super::bands;
use super::kept::Kept;
use crate::check::{CheckedBand, Found};
use crate::decode::{self, Conversion, RawBand};
use crate::error::{IngestError, Stop};
use crate::limits::{Limits, memory};
use crate::plan::{Plan, PlannedStep};

/// What all steps came to.
pub(super) struct Read {
    /// Those that hold a value, in the order of the store.
    pub(super) steps: Vec<Step>,
    /// Cells that hold a value in one of them.
    pub(super) domain: Cells,
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

/// Steps of the plan that are wanted, one after the other, each band by band; what is to be done with each is done beside the reading
/// of the next.
pub(super) async fn read(
    plan: &mut Plan,
    put: Put<'_>,
    wanted: &[PlannedStep],
    told: &(dyn Fn(usize, usize) + Send + Sync),
) -> Result<Read, Stop> {
    let own = Own::of(plan, put, wanted)?;
    let band_rows = own
        .bands
        .iter()
        .map(|rows| u64::from(rows.end - rows.start));
    let limits = Limits {
        band_cells: band_rows.max().unwrap_or(0) * u64::from(own.grid.cols),
        ..Limits::default()
    };
    let at_once = memory::grids_at_once(plan, &limits);
    let mut all = Read {
        steps: vec![],
        domain: Cells::none(own.grid.cell_count()),
        masked: MaskedCells::default(),
        range: None,
    };
    let (mut stored, mut done_count) = (FuturesOrdered::new(), 0);
    let mut take = |done: Result<One, Stop>| {
        let done = done?;
        done_count += 1;
        told(done_count, wanted.len());
        all.take(done);
        Ok::<_, Stop>(())
    };
    for step in wanted {
        while stored.len() >= at_once
            && let Some(done) = stored.next().await
        {
            take(done)?;
        }
        // One band is worked on while the next is read, and no further one is asked for.
        let (given, taken) = mpsc::channel(1);
        stored.push_back(own.step(*step, taken));
        for rows in &own.bands {
            let mut reading = pin!(async {
                let Ok(room) = given.reserve().await else {
                    return Ok(false);
                };
                room.send(decode::read(plan, (*step, rows.clone()), None).await?);
                Ok::<_, Stop>(true)
            });
            let is_taken = loop {
                tokio::select! {
                    read = &mut reading => break read?,
                    Some(done) = stored.next() => take(done)?,
                }
            };
            // Nobody takes it: why is the answer of the step, or of one before.
            if !is_taken {
                break;
            }
        }
    }
    while let Some(done) = stored.next().await {
        take(done)?;
    }
    own.conversion.tell(plan);
    Ok(all)
}

/// What the steps have in common.
struct Own<'a> {
    put: Put<'a>,
    quantity: Quantity,
    grid: Grid,
    /// Rows that are read together, from the north.
    bands: Vec<Range<u32>>,
    variable: String,
    conversion: Conversion,
}

/// A step that was read.
struct One {
    /// None if it holds no value at all.
    step: Option<Step>,
    found: Found,
    /// Cells that hold a value.
    valued: Cells,
}

impl<'a> Own<'a> {
    fn of(plan: &Plan, put: Put<'a>, wanted: &[PlannedStep]) -> Result<Self, Stop> {
        let variable = &plan.variable.name;
        let starts = match bands::rows_axis(&plan.axes) {
            Some(axis) if !wanted.is_empty() => plan.values.chunk_starts(variable, axis)?,
            _ => vec![],
        };
        Ok(Self {
            put,
            quantity: plan.target.quantity,
            grid: plan.mapping.grid,
            bands: bands::of(&plan.mapping, &starts),
            variable: variable.clone(),
            conversion: Conversion::of(plan),
        })
    }

    async fn step(
        &self,
        planned: PlannedStep,
        mut read: mpsc::Receiver<RawBand>,
    ) -> Result<One, Stop> {
        let period = planned.period;
        let mut work = Work {
            quantity: self.quantity,
            conversion: self.conversion.clone(),
            found: Found::nothing(),
            valued: Cells::none(self.grid.cell_count()),
            digest: FieldDigest::new(&self.grid, period),
            cells_done: 0,
        };
        while let Some(band) = read.recv().await {
            work = tokio::task::spawn_blocking(move || work.band(band)).await??;
        }
        let Work {
            found,
            valued,
            digest,
            ..
        } = work;
        found.check(self.quantity, &self.variable, period)?;
        if found.valid_cells == 0 {
            return Ok(One {
                step: None,
                found,
                valued,
            });
        }
        let reference = self.put.reference(&planned, self.grid);
        let field = self.put.reference_to(&digest.finish(), &reference).await?;
        let step = Step {
            period,
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
            valued,
        })
    }
}

/// One step of which bands are turned and checked, on a thread that may take its time.
struct Work {
    quantity: Quantity,
    conversion: Conversion,
    found: Found,
    valued: Cells,
    digest: FieldDigest,
    cells_done: usize,
}

impl Work {
    fn band(mut self, band: RawBand) -> Result<Self, Stop> {
        let band = self.conversion.band(band)?;
        let CheckedBand(values) = self.found.band(band, self.quantity);
        self.valued.add_valued(self.cells_done, &values);
        self.digest.add(&values);
        self.cells_done += values.len();
        Ok(self)
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
        self.domain.add(&one.valued);
        self.steps.push(step);
    }
}
