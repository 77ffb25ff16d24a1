//! Which steps of a product a statistic is made of: those that are read, the means that they are gathered in, those in the base period.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{BasePeriod, MapOptions, MapStatistic};
use contract::manifest::{Manifest, Step};
use contract::time::{Period, TimeStep};

use super::means::{self, MeanOf};
use crate::analysis::timeline::{least_in_words, longest_s};

/// Steps by their place.
pub(super) struct Ranges {
    /// That are read.
    pub(super) read: Range<usize>,
    /// Years that normals stand for.
    pub(super) base: BasePeriod,
    /// Means that normals are made of, where steps are not taken as they are.
    pub(super) normals_of: Option<Arc<[MeanOf]>>,
    /// What anomalies are of.
    pub(super) anomalies_of: Arc<[MeanOf]>,
}

impl Ranges {
    pub(super) fn of(source: &Manifest, options: &MapOptions) -> Result<Self, ContractError> {
        if let (MapStatistic::Anomaly, Some(step)) = (options.statistic, options.anomaly_step) {
            return Self::of_means(source, options, step);
        }
        let inside = inside(source, options)?;
        // Of bins the base period decides what is read; of anomalies the window what is written.
        let read = match (options.statistic, options.base) {
            (MapStatistic::Climatology | MapStatistic::Anomaly, Some(base)) => {
                in_base(source, base)?
            }
            (MapStatistic::Anomaly, None) => 0..source.steps.len(),
            _ => inside.clone(),
        };
        let base = options.base.filter(|_| options.statistic.has_bins());
        let of_step = |step: usize| MeanOf::of_step(step, source.steps[step].period);
        let is_anomaly = options.statistic == MapStatistic::Anomaly;
        Ok(Self {
            base: base.unwrap_or_else(|| BasePeriod::around(extent(source, &read))),
            read,
            normals_of: None,
            anomalies_of: inside.filter(|_| is_anomaly).map(of_step).collect(),
        })
    }

    /// Those of anomalies of means: each mean is of all of its steps, also of those beyond the asked period.
    fn of_means(
        source: &Manifest,
        options: &MapOptions,
        step: TimeStep,
    ) -> Result<Self, ContractError> {
        let periods: Vec<Period> = of_steps(source, &(0..source.steps.len())).collect();
        check_means(&periods, step)?;
        let (window, _steps) = source.steps_inside(options.from, options.to)?;
        let means = means::over(&periods, step);
        let inside = means.iter().filter(|mean| mean.period.overlaps(window));
        let anomalies_of: Arc<[MeanOf]> = inside.cloned().collect();
        let covered = extent(source, &(0..source.steps.len()));
        if anomalies_of.is_empty() {
            let reason = format!(
                "none of them from {} to {} has steps over {}; {} covers {covered}",
                window.start,
                window.end,
                least_in_words(step),
                source.product
            );
            return Err(ContractError::invalid("step", step.as_str(), reason));
        }
        let normals_of: Arc<[MeanOf]> = match options.base {
            None => means.into(),
            Some(base) => {
                let window = base.period();
                let is_in = |mean: &MeanOf| (window.start..window.end).contains(&mean.period.mid());
                means.into_iter().filter(is_in).collect()
            }
        };
        let (Some(first), Some(last)) = (normals_of.first(), normals_of.last()) else {
            let base = options
                .base
                .map_or_else(String::new, |base| base.to_string());
            let reason = format!("{} has no step in it; it covers {covered}", source.product);
            return Err(ContractError::invalid("base period", &base, reason));
        };
        Ok(Self {
            base: options.base.unwrap_or_else(|| BasePeriod::around(covered)),
            read: first.steps.start..last.steps.end,
            normals_of: Some(normals_of),
            anomalies_of,
        })
    }
}

/// Periods of some steps.
pub(super) fn of_steps(source: &Manifest, range: &Range<usize>) -> impl Iterator<Item = Period> {
    source.steps[range.clone()].iter().map(|step| step.period)
}

/// Can steps of these periods be gathered in means that have anomalies?
fn check_means(periods: &[Period], step: TimeStep) -> Result<(), ContractError> {
    let refused = |reason: String| Err(ContractError::invalid("step", step.as_str(), reason));
    let step_s = longest_s(periods);
    match step.longest_step_s() {
        None => refused(format!(
            "anomalies are of {}, or of every step",
            "days, weeks, months, seasons or years"
        )),
        Some(most_s) if step_s > most_s => {
            refused(format!("steps of {:.0} days are longer", step_s / 86_400.0))
        }
        Some(_) => Ok(()),
    }
}

/// Steps that reach into the asked period: they follow each other.
pub(super) fn inside(
    source: &Manifest,
    options: &MapOptions,
) -> Result<Range<usize>, ContractError> {
    let (window, _steps) = source.steps_inside(options.from, options.to)?;
    let touched = |step: &Step| step.period.overlaps(window);
    let first = source.steps.iter().position(touched).unwrap_or_default();
    let count = source.steps.iter().filter(|step| touched(step)).count();
    Ok(first..first + count)
}

/// From the first to the last of some steps.
pub(super) fn extent(source: &Manifest, range: &Range<usize>) -> Period {
    Period {
        start: source.steps[range.start].period.start,
        end: source.steps[range.end - 1].period.end,
    }
}

/// Steps whose middle lies in a base period: they follow each other.
fn in_base(source: &Manifest, base: BasePeriod) -> Result<Range<usize>, ContractError> {
    let window = base.period();
    let from = source
        .steps
        .partition_point(|step| step.period.mid() < window.start);
    let to = source
        .steps
        .partition_point(|step| step.period.mid() < window.end);
    if from < to {
        return Ok(from..to);
    }
    let covered = source
        .extent()
        .map_or_else(|| "nothing".to_owned(), |all| all.to_string());
    let reason = format!("{} has no step in it; it covers {covered}", source.product);
    Err(ContractError::invalid(
        "base period",
        &base.to_string(),
        reason,
    ))
}
