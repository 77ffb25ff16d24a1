//! What is made of two series: their correlation at lags, and the difference of their means.

use contract::ContractError;
use contract::analysis::{
    CalendarBins, Correlation, CorrelationQuery, Difference, DifferenceSide, SeriesQuery,
};
use contract::statistics::MinCoverage;
use contract::time::TimeStep;
use futures::future::BoxFuture;

use super::climatology::deseasonalised;
use super::common_steps::{CommonSteps, Covered};
use super::correlation::correlations;
use super::mean_difference::{MeanOverTime, mean_over_time, welch};
use super::read::{self, ReadSeries, Version};
use super::timeline::{longest_s, means_over};
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
        let mut common = CommonSteps::of([covered(&a), covered(&b)], query.step)?;
        common.check_lag(query.max_lag)?;
        if query.deseasonalise {
            common = common.without_seasons()?;
        }
        let [first, second] = common.beside([&a.values, &b.values]);
        let rows = correlations(&first, &second, query.max_lag);
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
            start: common.extent().start,
            end: common.extent().end,
            notes,
            rows,
            strongest_lag_steps: strongest.map(|(lag, _)| lag),
        })
    })
}

/// What a series covers.
fn covered(series: &ReadSeries) -> Covered<'_> {
    Covered {
        product: &series.cited.product,
        periods: &series.periods,
    }
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
                "{} holds {}, {} holds {}: they have no difference",
                a.cited.product,
                a.cited.titled(),
                b.cited.product,
                b.cited.titled()
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
