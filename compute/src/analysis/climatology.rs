//! Mean, spread and count of each part of the year, and how far steps are from them.

use std::collections::BTreeSet;

use contract::analysis::{
    Anomalies, AnomalyRow, BasePeriod, CalendarBins, Climatology, ClimatologyRow,
};
use contract::time::Period;

use super::correlation::varies;
use super::timeline::longest_s;
use super::undefined::Undefined;

/// The climatology of a series over the years of `base`, those of the series if absent.
///
/// `periods` are in the order of time, `values` beside them, NaN no data, any unit. A step belongs to the bin and the year of
/// its middle. Spread is the standard deviation with the divisor n - 1, as of
/// a sample: that of the statistic `std` has the divisor n (docs/answers.md).
///
/// # Errors
/// Steps longer than a bin, no data, no data in the base period.
pub fn climatology(
    periods: &[Period],
    values: &[f64],
    bins: CalendarBins,
    base: Option<BasePeriod>,
) -> Result<Climatology, Undefined> {
    let step_s = longest_s(periods);
    if step_s > bins.longest_step_s() {
        return Err(Undefined::StepTooLong {
            what: "a climatology",
            step_days: step_s / 86_400.0,
            bin: bins.as_str(),
        });
    }
    let (Some(first), Some(last)) = (periods.first(), periods.last()) else {
        return Err(Undefined::NoData);
    };
    let covered = BasePeriod::around(Period {
        start: first.start,
        end: last.end,
    });
    let base = base.unwrap_or(covered);
    let window = base.period();
    let mut members: Vec<Vec<f64>> = vec![vec![]; bins.count()];
    let mut years: Vec<BTreeSet<i32>> = vec![BTreeSet::new(); bins.count()];
    for (period, value) in periods.iter().zip(values) {
        let mid = period.mid();
        if value.is_nan() || mid < window.start || mid >= window.end {
            continue;
        }
        let bin = bins.of(*period);
        members[bin].push(*value);
        years[bin].insert(mid.year_month().0);
    }
    if members.iter().all(Vec::is_empty) {
        return Err(if values.iter().all(|value| value.is_nan()) {
            Undefined::NoData
        } else {
            Undefined::NothingInBase {
                base: base.to_string(),
                covered: covered.to_string(),
            }
        });
    }
    let row = |(bin, members): (usize, &Vec<f64>)| ClimatologyRow {
        bin: bins.title(bin),
        mean: mean(members),
        spread: spread(members),
        count: members.len() as u64,
        years: years[bin].len() as u64,
    };
    let rows = members.iter().enumerate().map(row).collect();
    Ok(Climatology { bins, base, rows })
}

/// How far each step is from a climatology of the same bins; any unit.
pub fn anomalies(periods: &[Period], values: &[f64], climatology: &Climatology) -> Anomalies {
    let bins = climatology.bins;
    let row = |(period, value): (&Period, &f64)| {
        let of_bin = &climatology.rows[bins.of(*period)];
        let value = (!value.is_nan()).then_some(*value);
        let anomaly = value.zip(of_bin.mean).map(|(value, mean)| value - mean);
        let spread = of_bin.spread.filter(|spread| *spread > 0.0);
        AnomalyRow {
            start: period.start,
            end: period.end,
            mid: period.mid(),
            value,
            normal: of_bin.mean,
            anomaly,
            standardised: anomaly
                .zip(spread)
                .map(|(anomaly, spread)| anomaly / spread),
        }
    };
    Anomalies {
        bins,
        base: climatology.base,
        rows: periods.iter().zip(values).map(row).collect(),
    }
}

/// Values less the mean of their calendar month over the whole series, NaN no data.
pub fn deseasonalised(periods: &[Period], values: &[f64]) -> Vec<f64> {
    less_their_months(&months_of(periods), values)
}

/// Calendar months of some periods, from 0 for January.
pub fn months_of(periods: &[Period]) -> Vec<usize> {
    let month = |period: &Period| CalendarBins::Month.of(*period);
    periods.iter().map(month).collect()
}

/// [`deseasonalised`] of values whose months are known.
pub fn less_their_months(months: &[usize], values: &[f64]) -> Vec<f64> {
    let (mut sums, mut counts) = ([0.0; 12], [0.0; 12]);
    for (month, value) in months.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
        sums[*month] += value;
        counts[*month] += 1.0;
    }
    let less = |(month, value): (&usize, &f64)| value - sums[*month] / counts[*month];
    months.iter().zip(values).map(less).collect()
}

/// What is left of a value that is taken off from itself, as a share of the largest: rounding. Stored values have seven digits.
const ROUNDING: f64 = 1e-12;

/// How far apart values may lie that would be equal but for rounding, once means or a line were taken off: of the values before that.
pub fn rounding_of(values: &[f64]) -> f64 {
    let present = values.iter().filter(|value| !value.is_nan());
    ROUNDING * present.fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// [`less_their_months`]; of a season and nothing else nothing is left, not even rounding.
pub fn less_their_months_exactly(months: &[usize], values: &[f64]) -> Vec<f64> {
    let rounding = rounding_of(values);
    let left = |value: f64| {
        if value.abs() <= rounding { 0.0 } else { value }
    };
    let less = less_their_months(months, values);
    less.into_iter().map(left).collect()
}

/// A series without its season.
#[derive(Debug, Clone, PartialEq)]
pub struct Seasonless {
    /// Values less the means of their calendar months or seasons, which take with them what rises within a year: no trend, no rise.
    pub less: Vec<f64>,
    /// The same with the line that was found together with the means of months: rising as the series does.
    pub with_line: Vec<f64>,
    /// What squares of times come to beside the means of months, years²: how well a slope is known.
    pub squared_years: f64,
    /// Calendar months, or seasons, that have values.
    pub part_count: usize,
}

impl Seasonless {
    /// Means of months and a line along `years` found together by least squares: of what is left of both without the months (Frisch and Waugh 1933,
    /// doi:10.2307/1907330). The mean of a month alone has the part of a line that falls between the middles of months and takes it off: of K whole years
    /// the slope would be less by 1 in K², and of a few values here and there by far more.
    pub fn of(months: &[usize], years: &[f64], values: &[f64]) -> Self {
        let less = less_their_months_exactly(months, values);
        let of_value = |(year, value): (&f64, &f64)| if value.is_nan() { f64::NAN } else { *year };
        let years: Vec<f64> = years.iter().zip(values).map(of_value).collect();
        let less_years = less_their_months_exactly(months, &years);
        let (mut along, mut squared_years) = (0.0, 0.0);
        for (x, value) in less_years.iter().zip(&less).filter(|(_, v)| !v.is_nan()) {
            along += x * value;
            squared_years += x * x;
        }
        // Of one value a month there is no line beside their means.
        let slope = if squared_years > 0.0 {
            along / squared_years
        } else {
            0.0
        };
        let line = years
            .iter()
            .zip(&less_years)
            .map(|(x, less)| slope * (x - less));
        let with_line = less
            .iter()
            .zip(line)
            .map(|(value, line)| value + line)
            .collect();
        let here = months
            .iter()
            .zip(values)
            .filter(|(_, value)| !value.is_nan());
        let has: BTreeSet<usize> = here.map(|(month, _)| *month).collect();
        Self {
            less,
            with_line,
            squared_years,
            part_count: has.len(),
        }
    }
}

/// Mean of values; none of none.
pub fn mean(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}

/// Standard deviation √(Σ (x - m)² / (n - 1)); none of fewer than two, 0 of values that are all equal. In two passes, so that large means
/// cost no digits.
pub fn spread(values: &[f64]) -> Option<f64> {
    let mean = mean(values).filter(|_| values.len() > 1)?;
    if !varies(values.iter().copied()) {
        return Some(0.0);
    }
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / (values.len() - 1) as f64).sqrt())
}

#[cfg(test)]
mod tests;
