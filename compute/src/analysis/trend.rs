//! The trend of a series: seasons off, two slopes, a test.

use contract::analysis::{CalendarBins, TheilSenTrend, Trend, TrendValue};
use contract::time::{Period, TimeMs, TimeStep};

use super::climatology::{deseasonalised, mean};
use super::extremes::percentile;
use super::linear_trend::least_squares;
use super::mann_kendall::{LEAST_VALUES, MOST_VALUES, mann_kendall};
use super::theil_sen::Slopes;
use super::timeline::{YEAR_MS, longest_s, means_over, middles_years, no_shorter};
use super::undefined::Undefined;

/// What an answer about a trend is called.
const WHAT: &str = "a trend";
/// Years of values that a trend needs: of fewer, each month's own mean takes more than a fifth of what it is taken off from.
pub const LEAST_YEARS: f64 = 5.0;
/// Rounding of the years between two middles: of five years of months 4 years and 11 months lie between them.
const MONTH_YEARS: f64 = 0.09;
/// Years in a decade.
const DECADE: f64 = 10.0;

/// The trend of a series through means of `step`, or through steps as they are where those are longer.
///
/// `periods` are in the order of time, `values` beside them in `unit`, NaN no data. Where steps are no longer than months the
/// mean of each calendar month is taken off first.
///
/// # Errors
/// Fewer than ten values or five years, more than 12 000 values, or all equal.
pub fn trend(
    periods: &[Period],
    values: &[f64],
    step: TimeStep,
    unit: &str,
) -> Result<Trend, Undefined> {
    let step = no_shorter(periods, step);
    let (periods, values) = means_over(periods, values, step);
    let here: Vec<usize> = (0..values.len()).filter(|i| !values[*i].is_nan()).collect();
    let found = here.len();
    let found_years = years_of(&periods, &values, &here)?;
    let is_deseasonalised = longest_s(&periods) <= CalendarBins::Month.longest_step_s();
    let basis = if is_deseasonalised {
        deseasonalised(&periods, &values)
    } else {
        values.clone()
    };
    let years = middles_years(&periods);
    let of_here = |all: &[f64]| -> Vec<f64> { here.iter().map(|i| all[*i]).collect() };
    let (years_here, basis_here) = (of_here(&years), of_here(&basis));
    let constant = || Undefined::Constant {
        what: WHAT,
        count: found,
    };
    let slopes = Slopes::of(&years_here, &basis_here).ok_or_else(constant)?;
    let slope = slopes.median();
    let detrended: Vec<f64> = basis
        .iter()
        .zip(&years)
        .map(|(v, x)| v - slope * x)
        .collect();
    let test = mann_kendall(&basis, &detrended)?;
    let (lower, upper) = slopes.interval(test.variance_correction);
    let mid_years = mean(&years_here).ok_or_else(constant)?;
    let mean_of_all = mean(&of_here(&values)).ok_or_else(constant)?;
    let mean_of_basis = mean(&basis_here).ok_or_else(constant)?;
    let about_mid = |(x, v): (&f64, &f64)| v - slope * (x - mid_years);
    let mut about: Vec<f64> = years_here.iter().zip(&basis_here).map(about_mid).collect();
    about.sort_unstable_by(f64::total_cmp);
    let value = |i: &usize| TrendValue {
        start: periods[*i].start,
        end: periods[*i].end,
        value: basis[*i] - mean_of_basis + mean_of_all,
    };
    let mid_ms = periods[0].mid().ms() + (mid_years * YEAR_MS).round() as i64;
    Ok(Trend {
        slope_unit: format!("{unit} per decade").trim_start().to_owned(),
        step,
        deseasonalised: is_deseasonalised,
        count: found as u64,
        years: found_years,
        mid: TimeMs::new(mid_ms).unwrap_or_else(|_| periods[0].mid()),
        mean: mean_of_all,
        least_squares: least_squares(&years, &basis).ok_or_else(constant)?,
        theil_sen: TheilSenTrend {
            slope_per_decade: slope * DECADE,
            lower_per_decade: lower * DECADE,
            upper_per_decade: upper * DECADE,
            at_mid: percentile(&about, 50.0) - mean_of_basis + mean_of_all,
        },
        mann_kendall: test,
        values: here.iter().map(value).collect(),
    })
}

/// Years that values span, if a trend can be told from them; `here` are the places of those with data.
fn years_of(periods: &[Period], values: &[f64], here: &[usize]) -> Result<f64, Undefined> {
    let (what, found) = (WHAT, here.len());
    if found < LEAST_VALUES {
        let needed = LEAST_VALUES;
        return Err(Undefined::TooFew {
            what,
            needed,
            found,
        });
    }
    if found > MOST_VALUES {
        let most = MOST_VALUES;
        return Err(Undefined::TooMany { what, found, most });
    }
    let (first, last) = (periods[here[0]], periods[here[found - 1]]);
    let found_years = (last.end.ms() - first.start.ms()) as f64 / YEAR_MS;
    if found_years < LEAST_YEARS - MONTH_YEARS {
        let needed_years = LEAST_YEARS;
        return Err(Undefined::TooShort {
            what,
            needed_years,
            found_years,
        });
    }
    let is_first = |i: &usize| values[*i].to_bits() == values[here[0]].to_bits();
    if here.iter().all(is_first) {
        return Err(Undefined::Constant { what, count: found });
    }
    Ok(found_years)
}

#[cfg(test)]
mod tests;
