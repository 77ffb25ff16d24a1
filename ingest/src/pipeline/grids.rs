//! [`PlannedGranule`] in, its [`Reading`] out: steps are decoded one after the other, band by band, and checked, encoded and put
//! a few at a time.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::pin::pin;

use contract::chunk::bands;
use contract::event::RejectReason;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use futures::stream::{FuturesOrdered, StreamExt as _};
use storage::domain::Cells;
use tokio::sync::mpsc;

use super::Pipeline;
use super::metrics::{Metrics, ended};
use super::progress::Stage;
use crate::check::Found;
use crate::decode::{Conversion, RawBand};
use crate::encode::{EncodedGrid, Encoding};
use crate::error::{IngestError, Rejection, Stop};
use crate::fetch::RawGranule;
use crate::limits::memory;
use crate::plan::{self, Plan, PlannedGranule};
use crate::put::reading::Reading;
use crate::{decode, put};

impl Pipeline<'_> {
    /// All steps of a file that hold a value, and what was found in all of its steps.
    pub(crate) async fn grids(
        &self,
        shown: &Path,
        planned: PlannedGranule,
        newest: Option<&Manifest>,
    ) -> Result<(Reading, FoundInAll), Stop> {
        let PlannedGranule { raw, mut plan } = planned;
        let limits = &self.settings.limits;
        let at_once = memory::grids_at_once(&plan, limits);
        let grids = Grids {
            pipeline: *self,
            shown,
            count: plan.steps.len(),
            quantity: plan.target.quantity,
            product: plan.target.product.clone(),
            grid: plan.mapping.grid,
            bands: bands(&plan.mapping.grid, limits.band_cells).collect(),
            variable: plan.variable.name.clone(),
            conversion: Conversion::of(&plan),
            raw: raw.clone(),
            newest,
        };
        let Stored {
            mut steps,
            masked,
            range,
            valued,
        } = grids.all(&mut plan, at_once).await?;
        grids.conversion.tell(&mut plan);
        raw.check_unchanged()?;
        if steps.is_empty() {
            return Err(without_values(&plan, masked).into());
        }
        steps.sort_by_key(|step| step.period);
        let told = left_out(&plan, &steps);
        plan.assumptions.extend(told);
        let Plan {
            target,
            mapping,
            recipe,
            assumptions,
            ..
        } = plan;
        let mut target = target;
        if let Some(range) = range {
            let over = target.quantity.over(range);
            target.quantity = over
                .map_err(|e| Rejection::new(RejectReason::NoVariable, "quantity", e.to_string()))?;
        }
        let mut reading = Reading::new(recipe, &target, mapping.grid, steps);
        reading.assumptions = assumptions;
        Ok((reading, FoundInAll { masked, valued }))
    }
}

/// What was found in all steps of a file.
#[derive(Debug, Default)]
pub(crate) struct FoundInAll {
    pub(crate) masked: MaskedCells,
    /// Cells that hold a value in some step; none of maps that are not held whole.
    pub(crate) valued: Option<Cells>,
}

/// What the steps of a file have in common.
struct Grids<'a> {
    pipeline: Pipeline<'a>,
    shown: &'a Path,
    /// Steps of the file.
    count: usize,
    quantity: Quantity,
    product: ProductId,
    grid: Grid,
    /// Rows of the grid that are worked on together, from the north.
    bands: Vec<Range<u32>>,
    variable: String,
    conversion: Conversion,
    raw: RawGranule,
    newest: Option<&'a Manifest>,
}

impl Grids<'_> {
    /// All steps that hold a value, and what was masked in all. The reader reads one band after the other; what is to be done
    /// with each is done beside that.
    async fn all(&self, plan: &mut Plan, at_once: usize) -> Result<Stored, Stop> {
        let Pipeline {
            progress, metrics, ..
        } = self.pipeline;
        let mut stored = FuturesOrdered::new();
        let mut all = Stored::default();
        for index in 0..self.count {
            while stored.len() >= at_once {
                if let Some(done) = stored.next().await {
                    all.take(done?);
                }
            }
            let step = plan.steps[index];
            let later = plan.steps.get(index + 1).copied();
            progress.stage(self.shown, Stage::Decode, index + 1, self.count);
            // One band is worked on while the next is read, and no further one is asked for.
            let (given, taken) = mpsc::channel(1);
            stored.push_back(self.grid(index, step.period, taken));
            for (band, rows) in self.bands.iter().enumerate() {
                let next = match (self.bands.get(band + 1), later, self.bands.first()) {
                    (Some(rows), ..) => Some((step, rows.clone())),
                    (None, Some(later), Some(rows)) => Some((later, rows.clone())),
                    _ => None,
                };
                let mut decoding = pin!(async {
                    let Ok(room) = given.reserve().await else {
                        return Ok(None);
                    };
                    let read = decode::read(plan, (step, rows.clone()), next);
                    room.send(metrics.timed("decode", read).await?);
                    Ok::<_, Stop>(Some(()))
                });
                let is_taken = loop {
                    tokio::select! {
                        decoded = &mut decoding => break decoded?.is_some(),
                        Some(done) = stored.next() => all.take(done?),
                    }
                };
                // Nobody takes it: why is the answer of the step, or of one before.
                if !is_taken {
                    break;
                }
            }
        }
        while let Some(done) = stored.next().await {
            all.take(done?);
        }
        Ok(all)
    }

    /// One time step whose bands are read: check, encode, put.
    async fn grid(
        &self,
        index: usize,
        period: Period,
        mut read: mpsc::Receiver<RawBand>,
    ) -> Result<One, Stop> {
        let Pipeline {
            store,
            progress,
            settings,
            ..
        } = self.pipeline;
        let mut work = Work {
            grid: self.grid,
            period,
            quantity: self.quantity,
            product: self.product.clone(),
            variable: self.variable.clone(),
            conversion: self.conversion.clone(),
            spool: settings.spool.clone(),
            metrics: self.pipeline.metrics.clone(),
            found: Found::nothing(),
            valued: (self.bands.len() == 1).then(|| Cells::none(self.grid.cell_count())),
            rows_done: 0,
            encoding: None,
        };
        while let Some(band) = read.recv().await {
            if work.rows_done == 0 {
                progress.stage(self.shown, Stage::Check, index + 1, self.count);
            }
            work = tokio::task::spawn_blocking(move || work.band(band)).await??;
        }
        let (found, valued) = (work.found, work.valued.take());
        let one = One {
            step: None,
            range: found.range(),
            masked: found.masked,
            valued,
        };
        let encoded = tokio::task::spawn_blocking(move || work.finish()).await??;
        let Some(encoded) = encoded else {
            return Ok(one);
        };
        progress.stage(self.shown, Stage::Put, index + 1, self.count);
        let there = self.newest.and_then(|newest| field_of(newest, period));
        let put = async { Ok(put::run(store, encoded, &self.raw, &self.grid, there).await?) };
        let stored = self.pipeline.metrics.timed("put", put).await?;
        Ok(One {
            step: Some(stored),
            ..one
        })
    }
}

/// A step that is done.
struct One {
    /// None if it holds no value at all.
    step: Option<Step>,
    /// Lowest and highest value; of none at all nothing to be used.
    range: [f64; 2],
    masked: MaskedCells,
    /// Cells that hold a value; none of maps that are not held whole.
    valued: Option<Cells>,
}

/// One step of which bands are turned, checked and encoded, on a thread that may take its time.
struct Work {
    grid: Grid,
    period: Period,
    quantity: Quantity,
    product: ProductId,
    variable: String,
    conversion: Conversion,
    spool: PathBuf,
    metrics: Metrics,
    found: Found,
    /// Cells that hold a value, where that is asked.
    valued: Option<Cells>,
    rows_done: u32,
    /// From the first band on that holds a value.
    encoding: Option<Encoding>,
}

impl Work {
    fn band(mut self, band: RawBand) -> Result<Self, Stop> {
        let running = self.metrics.start("check");
        let band = match self.conversion.band(band) {
            Ok(band) => band,
            Err(refused) => {
                let refused = Err(refused.into());
                running.done(ended(&refused));
                return refused;
            }
        };
        let cols = (self.grid.cols as usize).max(1);
        let rows = (band.values.len() / cols) as u32;
        let empty_rows = self.rows_done;
        self.rows_done += rows;
        let checked = self.found.band(band, self.quantity);
        if let Some(valued) = &mut self.valued {
            valued.add_valued(empty_rows as usize * cols, &checked.0);
        }
        // A file that is refused has nothing encoded after its last band.
        let whole = if self.rows_done == self.grid.rows {
            let found = self.found.check(self.quantity, &self.variable, self.period);
            found.map_err(Stop::from)
        } else {
            Ok(())
        };
        running.done(ended(&whole));
        whole?;
        if self.found.valid_cells == 0 {
            return Ok(self);
        }
        let running = self.metrics.start("encode");
        let encoded = self.encoding(empty_rows).and_then(|mut encoding| {
            encoding.band(&checked)?;
            Ok(encoding)
        });
        let encoded = encoded.map_err(Stop::from);
        running.done(ended(&encoded));
        self.encoding = Some(encoded?);
        Ok(self)
    }

    fn encoding(&mut self, empty_rows: u32) -> Result<Encoding, IngestError> {
        match self.encoding.take() {
            Some(encoding) => Ok(encoding),
            None => Encoding::begin(&self.spool, &self.grid, self.period, empty_rows),
        }
    }

    /// The field; none if no band holds a value.
    fn finish(self) -> Result<Option<EncodedGrid>, Stop> {
        let Some(encoding) = self.encoding else {
            return Ok(None);
        };
        let (key, field) = encoding.finish(&self.product)?;
        Ok(Some(EncodedGrid {
            period: self.period,
            key,
            field,
            valid_cells: self.found.valid_cells,
            masked: self.found.masked,
        }))
    }
}

/// Steps that are stored, in the order of the file.
#[derive(Default)]
struct Stored {
    steps: Vec<Step>,
    masked: MaskedCells,
    /// Of the values of all steps, least and greatest.
    range: Option<[f64; 2]>,
    /// Cells that hold a value in some step.
    valued: Option<Cells>,
}

impl Stored {
    fn take(&mut self, one: One) {
        if let Some(step) = one.step {
            self.steps.push(step);
            let (own, [low, high]) = (self.range, one.range);
            self.range = Some(own.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
        }
        self.masked = self.masked + one.masked;
        match (&mut self.valued, one.valued) {
            (Some(all), Some(own)) => all.add(&own),
            (none, own) => *none = own,
        }
    }
}

/// The refusal of a file all of whose steps are empty.
pub(crate) fn without_values(plan: &Plan, masked: MaskedCells) -> Rejection {
    let gap = if masked.is_none() { "" } else { " (" };
    let end = if masked.is_none() { "" } else { ")" };
    let detail = match &plan.quality {
        None => format!(
            "holds no value in any step{gap}{masked}{end}; correct fill value or valid range in a profile"
        ),
        Some(quality) => format!(
            "holds no value in any step that is good enough by {:?}{gap}{masked}{end}; correct fill value, valid range or [quality] in a profile",
            quality.variable
        ),
    };
    Rejection::new(RejectReason::Values, &plan.variable.name, detail)
}

/// What is told of steps of a plan that hold no value, where others do: `steps` are those.
pub(crate) fn left_out(plan: &Plan, steps: &[Step]) -> Option<String> {
    let there: BTreeSet<Period> = steps.iter().map(|step| step.period).collect();
    let planned = plan.steps.iter().map(|step| step.period);
    let mut empty: Vec<Period> = planned.filter(|own| !there.contains(own)).collect();
    empty.sort_unstable();
    let (first, all) = (empty.first()?, plan.steps.len());
    let told = match empty.len() {
        1 => format!("1 of {all} steps, {first}, which is left out"),
        count => format!("{count} of {all} steps, which are left out; the first is {first}"),
    };
    Some(plan::line(format!(
        "{}: holds no value in {told}",
        plan.variable.name
    )))
}

/// The field that a version has for a period.
fn field_of(manifest: &Manifest, period: Period) -> Option<&ObjectKey> {
    let index = manifest.step_of(period)?;
    Some(&manifest.steps[index].field)
}
