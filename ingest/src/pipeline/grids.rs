//! [`PlannedGranule`] in, its [`Reading`] out: every step decoded, checked, encoded and put, one after the other.

use std::path::Path;

use contract::event::RejectReason;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::masked::MaskedCells;
use contract::time::Period;

use super::Pipeline;
use super::metrics::ended;
use super::progress::Stage;
use crate::error::{Rejection, Stop};
use crate::plan::PlannedGranule;
use crate::put::reading::Reading;
use crate::{check, decode, encode, put};

impl Pipeline<'_> {
    /// All steps of a file that hold a value, and what was masked in all of its steps.
    pub(crate) async fn grids(
        &self,
        shown: &Path,
        mut planned: PlannedGranule,
        newest: Option<&Manifest>,
    ) -> Result<(Reading, MaskedCells), Stop> {
        let (mut steps, mut masked) = (Vec::new(), MaskedCells::default());
        let mut range: Option<[f64; 2]> = None;
        for index in 0..planned.steps.len() {
            let (step, own) = self.grid(shown, &mut planned, index, newest).await?;
            if let Some((step, [low, high])) = step {
                steps.push(step);
                range = Some(range.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
            }
            masked = masked + own;
        }
        planned.raw.check_unchanged()?;
        if steps.is_empty() {
            return Err(without_values(&planned, masked).into());
        }
        steps.sort_by_key(|step| step.period);
        let PlannedGranule {
            target,
            mapping,
            recipe,
            assumptions,
            ..
        } = planned;
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

    /// One time step with the range of its values: decode, check, encode, put; and what was masked in it. None if it holds
    /// no value at all.
    async fn grid(
        &self,
        shown: &Path,
        planned: &mut PlannedGranule,
        index: usize,
        newest: Option<&Manifest>,
    ) -> Result<(Option<(Step, [f64; 2])>, MaskedCells), Stop> {
        let (number, count) = (index + 1, planned.steps.len());
        let tell = |stage| self.progress.stage(shown, stage, number, count);
        tell(Stage::Decode);
        let step = planned.steps[index];
        let decoded = self
            .metrics
            .timed("decode", decode::run(planned, step))
            .await?;
        tell(Stage::Check);
        let (quantity, product, grid) = (
            planned.target.quantity,
            planned.target.product.clone(),
            planned.mapping.grid,
        );
        let variable = planned.variable.name.clone();
        let metrics = self.metrics.clone();
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
        tell(Stage::Put);
        let there = newest.and_then(|newest| field_of(newest, encoded.period));
        let put = async { Ok(put::run(self.store, encoded, &planned.raw, &grid, there).await?) };
        let stored = self.metrics.timed("put", put).await?;
        Ok((Some((stored, range)), masked))
    }
}

/// The refusal of a file all of whose steps are empty.
fn without_values(planned: &PlannedGranule, masked: MaskedCells) -> Rejection {
    let gap = if masked.is_none() { "" } else { " (" };
    let end = if masked.is_none() { "" } else { ")" };
    let detail = match &planned.quality {
        None => format!(
            "holds no value in any step{gap}{masked}{end}; correct fill value or valid range in a profile"
        ),
        Some(quality) => format!(
            "holds no value in any step that is good enough by {:?}{gap}{masked}{end}; correct fill value, valid range or [quality] in a profile",
            quality.variable
        ),
    };
    Rejection::new(RejectReason::Values, &planned.variable.name, detail)
}

/// The field that a version has for a period.
fn field_of(manifest: &Manifest, period: Period) -> Option<&ObjectKey> {
    let index = manifest.step_of(period)?;
    Some(&manifest.steps[index].field)
}
