//! [`PlannedGranule`] in, its [`Reading`] out: steps are decoded one after the other, and checked, encoded and put a few at a
//! time.

use std::path::Path;
use std::pin::pin;

use contract::event::RejectReason;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use futures::stream::{FuturesOrdered, StreamExt as _};

use super::Pipeline;
use super::metrics::ended;
use super::progress::Stage;
use crate::decode::DecodedGrid;
use crate::error::{Rejection, Stop};
use crate::fetch::RawGranule;
use crate::limits::memory;
use crate::plan::{Plan, PlannedGranule};
use crate::put::reading::Reading;
use crate::{check, decode, encode, put};

impl Pipeline<'_> {
    /// All steps of a file that hold a value, and what was masked in all of its steps.
    pub(crate) async fn grids(
        &self,
        shown: &Path,
        planned: PlannedGranule,
        newest: Option<&Manifest>,
    ) -> Result<(Reading, MaskedCells), Stop> {
        let PlannedGranule { raw, mut plan } = planned;
        let at_once = memory::grids_at_once(&plan);
        let grids = Grids {
            pipeline: *self,
            shown,
            count: plan.steps.len(),
            quantity: plan.target.quantity,
            product: plan.target.product.clone(),
            grid: plan.mapping.grid,
            variable: plan.variable.name.clone(),
            raw: raw.clone(),
            newest,
        };
        let Stored {
            mut steps,
            masked,
            range,
        } = grids.all(&mut plan, at_once).await?;
        raw.check_unchanged()?;
        if steps.is_empty() {
            return Err(without_values(&plan, masked).into());
        }
        steps.sort_by_key(|step| step.period);
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
        Ok((reading, masked))
    }
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
    variable: String,
    raw: RawGranule,
    newest: Option<&'a Manifest>,
}

impl Grids<'_> {
    /// All steps that hold a value, and what was masked in all. The reader reads one after the other; what is to be done
    /// with each is done beside that.
    async fn all(&self, plan: &mut Plan, at_once: usize) -> Result<Stored, Stop> {
        let Pipeline {
            progress, metrics, ..
        } = self.pipeline;
        let mut stored = FuturesOrdered::new();
        let mut all = Stored::default();
        for index in 0..self.count {
            let step = plan.steps[index];
            progress.stage(self.shown, Stage::Decode, index + 1, self.count);
            let mut decoding = pin!(metrics.timed("decode", decode::run(plan, step)));
            let decoded = loop {
                tokio::select! {
                    decoded = &mut decoding => break decoded?,
                    Some(done) = stored.next() => all.take(done?),
                }
            };
            stored.push_back(self.grid(index, decoded));
            while stored.len() >= at_once {
                if let Some(done) = stored.next().await {
                    all.take(done?);
                }
            }
        }
        while let Some(done) = stored.next().await {
            all.take(done?);
        }
        Ok(all)
    }

    /// One time step that was decoded, with the range of its values: check, encode, put; and what was masked in it. None if it
    /// holds no value at all.
    async fn grid(
        &self,
        index: usize,
        decoded: DecodedGrid,
    ) -> Result<(Option<(Step, [f64; 2])>, MaskedCells), Stop> {
        let Pipeline {
            store, progress, ..
        } = self.pipeline;
        progress.stage(self.shown, Stage::Check, index + 1, self.count);
        let (quantity, product, grid) = (self.quantity, self.product.clone(), self.grid);
        let (variable, metrics) = (self.variable.clone(), self.pipeline.metrics.clone());
        let (encoded, masked) = tokio::task::spawn_blocking(move || {
            let running = metrics.start("check");
            let checked = check::run(decoded, quantity, &variable).map_err(Stop::from);
            running.done(ended(&checked));
            let checked = checked?;
            if checked.valid_cells == 0 {
                return Ok::<_, Stop>((None, checked.masked));
            }
            let running = metrics.start("encode");
            let encoded = encode::run(&checked, &product, &grid).map_err(Stop::from);
            running.done(ended(&encoded));
            encoded.map(|encoded| (Some((encoded, checked.range())), checked.masked))
        })
        .await??;
        let Some((encoded, range)) = encoded else {
            return Ok((None, masked));
        };
        progress.stage(self.shown, Stage::Put, index + 1, self.count);
        let there = self
            .newest
            .and_then(|newest| field_of(newest, encoded.period));
        let put = async { Ok(put::run(store, encoded, &self.raw, &self.grid, there).await?) };
        let stored = self.pipeline.metrics.timed("put", put).await?;
        Ok((Some((stored, range)), masked))
    }
}

/// Steps that are stored, in the order of the file.
#[derive(Default)]
struct Stored {
    steps: Vec<Step>,
    masked: MaskedCells,
    /// Of the values of all steps, least and greatest.
    range: Option<[f64; 2]>,
}

impl Stored {
    fn take(&mut self, (step, masked): (Option<(Step, [f64; 2])>, MaskedCells)) {
        if let Some((step, [low, high])) = step {
            self.steps.push(step);
            let own = self.range;
            self.range = Some(own.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
        }
        self.masked = self.masked + masked;
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

/// The field that a version has for a period.
fn field_of(manifest: &Manifest, period: Period) -> Option<&ObjectKey> {
    let index = manifest.step_of(period)?;
    Some(&manifest.steps[index].field)
}
