//! What is made of two series: their correlation at lags, and the difference of their means.

use contract::ContractError;
use contract::analysis::{
    CalendarBins, Correlation, CorrelationQuery, Difference, DifferenceSide, SeriesQuery,
};
use contract::statistics::MinCoverage;
use contract::time::{Period, TimeStep};
use futures::future::BoxFuture;

use super::climatology::deseasonalised;
use super::correlation::correlations;
use super::line::{Line, with_holes};
use super::mean_difference::{MeanOverTime, mean_over_time, welch};
use super::read::{self, ReadSeries, Version};
use super::timeline::{bins_over, longest_s, means_over, no_shorter};
use crate::{ComputeError, Engine};

/// Years from which the mean of a calendar month is more than its one value.
const SEASONS_FROM_MONTHS: usize = 24;

/// The correlation of two products over a region or at a place.
///
/// # Errors
/// Those of reading either; nothing that both cover; steps that have no common ones; lags between steps at unequal distances.
pub fn correlation<'a>(
    engine: &'a Engine,
    first: Version<'a>,
    second: Version<'a>,
    query: &'a CorrelationQuery,
) -> BoxFuture<'a, Result<Correlation, ComputeError>> {
    Box::pin(async move {
        let other = query.series.of_product(query.with.clone());
        let all = MinCoverage::default();
        let a = read::series(engine, first, &query.series, all).await?;
        let b = read::series(engine, second, &other, all).await?;
        let (bins, mut values) = on_common_bins(&a, &b, query.step)?;
        if query.max_lag > 0 && Line::of(&bins).is_none() {
            let reason = "gaps lie between the steps of both, whose lengths or distances are unequal: ask for lag 0, or for \
                          steps of the calendar";
            return Err(ContractError::invalid("lag", &query.max_lag.to_string(), reason).into());
        }
        if query.deseasonalise {
            let step_s = longest_s(&bins);
            if step_s > CalendarBins::Month.longest_step_s() {
                let reason = "seasons can be taken off steps of months or shorter ones";
                return Err(ContractError::invalid("step", query.step.as_str(), reason).into());
            }
            values = values.map(|values| deseasonalised(&bins, &values));
        }
        // Steps that both lack; all are there where they lie on a line.
        values = values.map(|values| with_holes(&bins, &values));
        let rows = correlations(&values[0], &values[1], query.max_lag);
        let strongest = rows
            .iter()
            .filter_map(|row| Some((row.lag_steps, row.correlation?.abs())))
            // Of equally strong ones the least lag, and of these the first leading.
            .max_by(|a, b| {
                let nearer = b.0.abs().cmp(&a.0.abs()).then(a.0.cmp(&b.0));
                a.1.total_cmp(&b.1).then(nearer)
            });
        let mut notes = a.notes;
        notes.extend(
            b.notes
                .into_iter()
                .filter(|note| !notes.contains(note))
                .collect::<Vec<_>>(),
        );
        Ok(Correlation {
            first: a.cited,
            second: b.cited,
            place: a.place,
            step: query.step,
            deseasonalised: query.deseasonalise,
            start: bins[0].start,
            end: bins[bins.len() - 1].end,
            notes,
            rows,
            strongest_lag_steps: strongest.map(|(lag, _)| lag),
        })
    })
}

/// Two series on the bins that both cover, at least one. Native steps that one has, or that both lack, stay in their places
/// between those of both, NaN where a series lacks them; those of both alone where steps lie on no line.
fn on_common_bins(
    a: &ReadSeries,
    b: &ReadSeries,
    step: TimeStep,
) -> Result<(Vec<Period>, [Vec<f64>; 2]), ContractError> {
    if step == TimeStep::Total {
        let reason = "one value does not vary: ask for shorter ones";
        return Err(ContractError::invalid("step", step.as_str(), reason));
    }
    for series in [a, b] {
        if no_shorter(&series.periods, step) != step {
            let product = &series.cited.product;
            let reason =
                format!("the steps of {product} are longer: ask for longer ones or native");
            return Err(ContractError::invalid("step", step.as_str(), reason));
        }
    }
    let (bins_a, bins_b) = (bins_over(&a.periods, step), bins_over(&b.periods, step));
    let in_both = |bin: &&Period| bins_b.binary_search(bin).is_ok();
    let common: Vec<Period> = bins_a.iter().filter(in_both).copied().collect();
    if common.is_empty() {
        let covers =
            |series: &ReadSeries| format!("{} covers {}", series.cited.product, series.extent());
        let reason = format!("no step is common to both: {}, {}", covers(a), covers(b));
        return Err(ContractError::invalid("step", step.as_str(), reason));
    }
    let bins = match step {
        TimeStep::Native => on_line(&bins_a, &bins_b, common),
        _ => common,
    };
    let on_bins = |series: &ReadSeries| -> Vec<f64> {
        let (own, means) = means_over(&series.periods, &series.values, step);
        let at = |bin: &Period| {
            own.binary_search(bin)
                .map_or(f64::NAN, |index| means[index])
        };
        bins.iter().map(at).collect()
    };
    let values = [on_bins(a), on_bins(b)];
    Ok((bins, values))
}

/// All steps from the first of those that two series have in common to the last, of either and of none; `common` where they
/// lie on no line.
fn on_line(a: &[Period], b: &[Period], common: Vec<Period>) -> Vec<Period> {
    let (Some(first), Some(last)) = (common.first(), common.last()) else {
        return common;
    };
    let is_between = |step: &&Period| *first <= **step && **step <= *last;
    let both = a.iter().chain(b).filter(is_between);
    let mut steps: Vec<Period> = both.copied().collect();
    steps.sort_unstable();
    steps.dedup();
    let line = Line::of(&steps).or_else(|| Line::of(&common));
    line.map_or(common, |line| line.steps)
}

/// The mean over time of one version of a product less that of another version, product or period.
///
/// # Errors
/// Those of reading either; two units; twice the same.
pub fn difference<'a>(
    engine: &'a Engine,
    of: (Version<'a>, &'a SeriesQuery),
    minus: (Version<'a>, &'a SeriesQuery),
) -> BoxFuture<'a, Result<Difference, ComputeError>> {
    Box::pin(async move {
        let (a_id, b_id) = (of.0.1, minus.0.1);
        if a_id == b_id && of.1.window() == minus.1.window() {
            let reason =
                "both sides are the same: give another product, version or period to take off";
            return Err(ContractError::invalid("difference", &a_id.to_string(), reason).into());
        }
        let all = MinCoverage::default();
        let a = read::series(engine, of.0, of.1, all).await?;
        let b = read::series(engine, minus.0, minus.1, all).await?;
        if a.cited.unit != b.cited.unit || a.cited.quantity != b.cited.quantity {
            let reason = format!(
                "{} is in {}, {} in {}: they have no difference",
                a.cited.product, a.cited.unit, b.cited.product, b.cited.unit
            );
            return Err(
                ContractError::invalid("difference", &b.cited.product.to_string(), reason).into(),
            );
        }
        let (mean_a, mean_b) = (of_side(&a), of_side(&b));
        let difference = mean_a.mean.zip(mean_b.mean).map(|(a, b)| a - b);
        let error = welch(&mean_a, &mean_b);
        let mut notes = a.notes.clone();
        notes.extend(
            b.notes
                .iter()
                .filter(|note| !a.notes.contains(note))
                .cloned(),
        );
        Ok(Difference {
            place: a.place.clone(),
            unit: a.cited.unit.clone(),
            difference,
            standard_error: error.map(|(error, _)| error),
            p_value: error.and_then(|(_, p_value)| p_value),
            of: side(a, &mean_a),
            minus: side(b, &mean_b),
            notes,
        })
    })
}

/// Mean of a side, its error by the spread about the mean of each month where there are two years of them.
fn of_side(series: &ReadSeries) -> MeanOverTime {
    let is_seasonal = longest_s(&series.periods) <= CalendarBins::Month.longest_step_s()
        && means_over(&series.periods, &series.values, TimeStep::Month)
            .0
            .len()
            >= SEASONS_FROM_MONTHS;
    let about = if is_seasonal {
        deseasonalised(&series.periods, &series.values)
    } else {
        series.values.clone()
    };
    mean_over_time(&series.periods, &series.values, &about)
}

fn side(series: ReadSeries, mean: &MeanOverTime) -> DifferenceSide {
    let extent = series.extent();
    DifferenceSide {
        cited: series.cited,
        start: extent.start,
        end: extent.end,
        count: mean.count as u64,
        mean: mean.mean,
        effective_count: mean.effective_count,
    }
}
