//! What is made of two series: their correlation at lags, and the difference of their means.

use std::collections::BTreeSet;

use contract::ContractError;
use contract::analysis::{
    CalendarBins, Correlation, CorrelationQuery, CorrelationRow, Difference, DifferenceSide,
    SeriesQuery,
};
use contract::product::ProductId;
use contract::statistics::MinCoverage;
use contract::time::TimeStep;
use futures::future::BoxFuture;

use super::climatology::deseasonalised;
use super::common_steps::{CommonSteps, Covered};
use super::correlation::correlations;
use super::mean_difference::{MeanOverTime, mean_over_time, welch};
use super::read::{self, ReadSeries, Version};
use super::timeline::{left_out, longest_s, means_over};
use crate::{ComputeError, Engine};

/// Years from which the mean of a calendar month is more than its one value.
const SEASONS_FROM_MONTHS: usize = 24;
/// Shares of a calendar month that differ by more than three days of a year are different ones.
const MONTHS_APART: f64 = 3.0 / 365.0;

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
        let least = query.min_coverage;
        let a = read::series(engine, first, &query.series, least).await?;
        let b = read::series(engine, second, &other, least).await?;
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
        let of_side = |side: &ReadSeries| {
            let means = left_out(&side.periods, &side.values, query.step);
            side.notes.iter().cloned().chain(means).collect::<Vec<_>>()
        };
        let mut notes = notes_of([("first", &of_side(&a)), ("second", &of_side(&b))]);
        let products = [&a.cited.product, &b.cited.product];
        notes.extend(of_undefined(&rows, products, query.deseasonalise));
        Ok(Correlation {
            first: a.cited,
            second: b.cited,
            place: a.place,
            step: query.step,
            deseasonalised: query.deseasonalise,
            start: common.extent().start,
            end: common.extent().end,
            min_coverage_percent: least.percent(),
            left_out_counts: [a.left_out as u64, b.left_out as u64],
            notes,
            rows,
            strongest_lag_steps: strongest.map(|(lag, _)| lag),
        })
    })
}

/// What is said of two sides: of both once, of one alone with its name before it.
fn notes_of([(a, of_a), (b, of_b)]: [(&str, &[String]); 2]) -> Vec<String> {
    let own = |name: &str, note: &String, other: &[String]| {
        if other.contains(note) {
            note.clone()
        } else {
            format!("{name}: {note}")
        }
    };
    let first = of_a.iter().map(|note| own(a, note, of_b));
    let second = of_b.iter().filter(|note| !of_a.contains(note));
    first.chain(second.map(|note| own(b, note, of_a))).collect()
}

/// What is to be said of lags without a correlation: how many they are, and why lag 0 or else the first of them has none.
fn of_undefined(
    rows: &[CorrelationRow],
    [first, second]: [&ProductId; 2],
    are_deseasonalised: bool,
) -> Option<String> {
    let without = || rows.iter().filter(|row| row.undefined.is_some());
    let told = without().find(|row| row.lag_steps == 0);
    let told = told.or_else(|| without().next())?;
    let why = told.undefined.as_deref()?;
    let less = if are_deseasonalised {
        ", less the mean of each calendar month"
    } else {
        ""
    };
    Some(format!(
        "{} of {} lags have no correlation, lag {} for this: {why} (the first is {first}, the second {second}{less})",
        without().count(),
        rows.len(),
        told.lag_steps
    ))
}

/// What a series covers.
fn covered(series: &ReadSeries) -> Covered<'_> {
    Covered {
        product: &series.cited.product,
        periods: &series.periods,
    }
}

/// The mean over time of one version of a product less that of another version, product or period; steps that hold data over less of a
/// region's sea, or of a line, than `least` are left out of either.
///
/// # Errors
/// Those of reading either; two units; twice the same.
pub fn difference<'a>(
    engine: &'a Engine,
    of: (Version<'a>, &'a SeriesQuery),
    minus: (Version<'a>, &'a SeriesQuery),
    least: MinCoverage,
) -> BoxFuture<'a, Result<Difference, ComputeError>> {
    Box::pin(async move {
        let (a_id, b_id) = (of.0.1, minus.0.1);
        if a_id == b_id && of.1.window() == minus.1.window() {
            let reason =
                "both sides are the same: give another product, version or period to take off";
            return Err(ContractError::invalid("difference", &a_id.to_string(), reason).into());
        }
        let a = read::series(engine, of.0, of.1, least).await?;
        let b = read::series(engine, minus.0, minus.1, least).await?;
        let is_same_kind = a.cited.quantity.is_same_kind(b.cited.quantity);
        if a.cited.unit != b.cited.unit || !is_same_kind {
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
        let mut notes = notes_of([("of", &a.notes[..]), ("minus", &b.notes[..])]);
        notes.extend(of_seasons([(&a, &mean_a), (&b, &mean_b)]));
        Ok(Difference {
            place: a.place.clone(),
            unit: a.cited.unit.clone(),
            difference,
            standard_error: error.map(|(error, _)| error),
            p_value: error.and_then(|(_, p_value)| p_value),
            of: side(a, &mean_a),
            minus: side(b, &mean_b),
            min_coverage_percent: least.percent(),
            notes,
        })
    })
}

/// Are steps short enough to tell months apart?
fn has_months(series: &ReadSeries) -> bool {
    longest_s(&series.periods) <= CalendarBins::Month.longest_step_s()
}

/// Are there two years of months, so that what comes every year is told from what does not?
fn has_seasons(series: &ReadSeries) -> bool {
    let months = means_over(&series.periods, &series.values, TimeStep::Month);
    // Each month's mean takes a value, and a spread needs two that are left.
    let is_enough = series.value_count() > months_of_year(series) + 1;
    has_months(series) && months.0.len() >= SEASONS_FROM_MONTHS && is_enough
}

/// Calendar months that hold data.
fn months_of_year(series: &ReadSeries) -> usize {
    let here = series.periods.iter().zip(&series.values);
    let months = here.filter(|(_, value)| !value.is_nan());
    let months: BTreeSet<usize> = months
        .map(|(period, _)| CalendarBins::Month.of(*period))
        .collect();
    months.len()
}

/// Share of its time with data in the asked period that each calendar month has.
fn shares_of_months(series: &ReadSeries) -> [f64; 12] {
    let mut shares = [0.0; 12];
    let here = series.periods.iter().zip(&series.values);
    for (period, _) in here.filter(|(_, value)| !value.is_nan()) {
        let inside = series.within(*period);
        for part in TimeStep::Month.bins(inside, []).unwrap_or_default() {
            shares[CalendarBins::Month.of(part)] += part.seconds();
        }
    }
    let all: f64 = shares.iter().sum();
    shares.map(|own| own / all)
}

/// What is to be said of the season in a difference: it may be in its error, or be the difference.
fn of_seasons(sides: [(&ReadSeries, &MeanOverTime); 2]) -> Vec<String> {
    if sides
        .iter()
        .any(|(series, mean)| !has_months(series) || mean.count == 0)
    {
        return vec![];
    }
    let mut notes = vec![];
    let [of, minus] = sides.map(|(series, _)| shares_of_months(series));
    let apart = of.iter().zip(&minus).map(|(a, b)| (a - b).abs());
    if apart.fold(0.0, f64::max) > MONTHS_APART {
        notes.push("the two sides hold the months of the year in different shares: part of their difference is the season".to_owned());
    }
    let is_short =
        |(series, mean): &(&ReadSeries, &MeanOverTime)| mean.count > 1 && !has_seasons(series);
    if sides.iter().any(is_short) {
        notes.push("a side spans less than two years of months, or hardly more values than months, so that its season cannot be told from chance: the standard error has it, and the p value tells nothing of what comes beside the season".to_owned());
    }
    notes
}

/// Mean of a side, its error by the spread about the mean of each month where there are two years of them.
fn of_side(series: &ReadSeries) -> MeanOverTime {
    let (periods, values, window) = (&series.periods, &series.values, series.window);
    if !has_seasons(series) {
        return mean_over_time(periods, values, (values, 1), window);
    }
    let about = deseasonalised(periods, values);
    mean_over_time(periods, values, (&about, months_of_year(series)), window)
}

fn side(series: ReadSeries, mean: &MeanOverTime) -> DifferenceSide {
    let extent = series.within(series.extent());
    DifferenceSide {
        cited: series.cited,
        start: extent.start,
        end: extent.end,
        count: mean.count as u64,
        left_out_count: series.left_out as u64,
        mean: mean.mean,
        effective_count: mean.effective_count,
    }
}
