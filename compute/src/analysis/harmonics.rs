//! Amplitude and phase of the year and the half-year.

use std::f64::consts::TAU;

use contract::analysis::{Harmonic, Season};
use contract::time::Period;

use super::climatology::spread;
use super::least_squares::fit;
use super::timeline::{YEAR_MS, longest_s};
use super::undefined::Undefined;

/// What an answer about the season is called.
const WHAT: &str = "a season";
/// Factors of the fit: mean, line, two of each wave.
const FACTORS: usize = 6;
/// Values that leave two to tell how far the fit is off.
const LEAST_VALUES: usize = FACTORS + 2;
/// Years from which a line is told from a wave of a year.
const LINE_YEARS: f64 = 1.99;
/// Years that a wave of a year needs to be seen.
const LEAST_YEARS: f64 = 0.9;
/// Longest step that a wave of half a year is seen in, s: a third of it.
const LONGEST_STEP_S: f64 = 62.0 * 86_400.0;
/// Longest part of the year without data, beyond which a wave of a year is what the noise beside it makes of it: after three months the error
/// of an amplitude is twice that of values all the year round, after four 3.4 times, after six 16 times.
const LONGEST_GAP_DAYS: usize = 110;
/// Days of a year that are looked at, the last one a little longer.
const YEAR_DAYS: usize = 365;
/// 2000-01-01, ms since 1970.
const START_MS: f64 = 946_684_800_000.0;

/// The season of steps of any length and distance, NaN no data, any unit.
///
/// Least squares of mean, line (from two years on), and cosine and sine of the year and the half-year, each the mean of its
/// wave over a step's period: monthly means flatten a year's wave by 1.1 %, which a wave read at their middles would lose.
///
/// # Errors
/// Fewer than eight values, less than a year, steps of more than two months, steps that leave several answers, or nearly a third of the year
/// without data in any year.
pub fn season(periods: &[Period], values: &[f64]) -> Result<Season, Undefined> {
    let both = periods.iter().zip(values).filter(|(_, v)| !v.is_nan());
    let (here, values): (Vec<Period>, Vec<f64>) = both.unzip();
    let years = years_of(&here, &values, longest_s(periods))?;
    let has_trend = years >= LINE_YEARS;
    let undetermined = || Undefined::Undetermined { what: WHAT };
    if longest_gap_days(&here) > LONGEST_GAP_DAYS {
        return Err(undetermined());
    }
    let fitted = if has_trend {
        with_line(&here, &values, years)
    } else {
        without_line(&here, &values)
    };
    let Fitted {
        mean,
        waves,
        left,
        without,
    } = fitted.ok_or_else(undetermined)?;
    let squares = |left: &[f64]| left.iter().map(|v| v * v).sum::<f64>();
    Ok(Season {
        mean,
        has_trend,
        annual: harmonic([waves[0], waves[1]], 1.0),
        semi_annual: harmonic([waves[2], waves[3]], 2.0),
        explained_percent: 100.0 * (1.0 - squares(&left) / squares(&without)).max(0.0),
        residual_spread: spread(&left).unwrap_or_default(),
        count: values.len() as u64,
    })
}

/// Years that steps with data span, if a season can be told from them.
fn years_of(periods: &[Period], values: &[f64], step_s: f64) -> Result<f64, Undefined> {
    let (what, found) = (WHAT, values.len());
    if step_s > LONGEST_STEP_S {
        let (step_days, bin) = (step_s / 86_400.0, "half-year");
        return Err(Undefined::StepTooLong {
            what,
            step_days,
            bin,
        });
    }
    if found < LEAST_VALUES {
        let needed = LEAST_VALUES;
        return Err(Undefined::TooFew {
            what,
            needed,
            found,
        });
    }
    let span_ms = periods[found - 1].end.ms() - periods[0].start.ms();
    let found_years = span_ms as f64 / YEAR_MS;
    if found_years < LEAST_YEARS {
        let needed_years = LEAST_YEARS;
        return Err(Undefined::TooShort {
            what,
            needed_years,
            found_years,
        });
    }
    if values.iter().all(|v| v.to_bits() == values[0].to_bits()) {
        return Err(Undefined::Constant { what, count: found });
    }
    Ok(found_years)
}

/// The longest part of the year, of so many days, that none of some periods lies in, whatever the year.
fn longest_gap_days(periods: &[Period]) -> usize {
    let mut is_held = [false; YEAR_DAYS];
    let day = |ms: i64| {
        let share = ((ms as f64 - START_MS) / YEAR_MS).rem_euclid(1.0);
        ((share * YEAR_DAYS as f64) as usize).min(YEAR_DAYS - 1)
    };
    for period in periods {
        let (first, last) = (day(period.start.ms()), day(period.end.ms() - 1));
        let count = (last + YEAR_DAYS - first) % YEAR_DAYS;
        for own in first..=first + count {
            is_held[own % YEAR_DAYS] = true;
        }
    }
    // The year goes round: a gap over its end is one.
    let (mut longest, mut now) = (0, 0);
    for is_held in is_held.iter().chain(&is_held) {
        now = if *is_held { 0 } else { now + 1 };
        longest = longest.max(now);
    }
    longest.min(YEAR_DAYS)
}

/// What a fit found.
struct Fitted {
    mean: f64,
    /// Factors of cosine and sine of the year and of the half-year.
    waves: [f64; 4],
    /// What the fit leaves of each value.
    left: Vec<f64>,
    /// What mean and line alone leave.
    without: Vec<f64>,
}

fn with_line(periods: &[Period], values: &[f64], years: f64) -> Option<Fitted> {
    let (first, last) = (periods.first()?, periods.last()?);
    let middle_ms = 0.5 * (first.start.ms() + last.end.ms()) as f64;
    let line = |period: &Period| (period.mid().ms() as f64 - middle_ms) / YEAR_MS / years;
    let row = |period: &Period| {
        let [a, b, c, d] = waves_over(*period);
        [a, b, c, d, 1.0, line(period)]
    };
    let rows: Vec<[f64; FACTORS]> = periods.iter().map(row).collect();
    let lines: Vec<[f64; 2]> = periods.iter().map(|p| [1.0, line(p)]).collect();
    let ([a, b, c, d, mean, _], left) = fit(&rows, values)?;
    let (_, without) = fit(&lines, values)?;
    Some(Fitted {
        mean,
        waves: [a, b, c, d],
        left,
        without,
    })
}

fn without_line(periods: &[Period], values: &[f64]) -> Option<Fitted> {
    let row = |period: &Period| {
        let [a, b, c, d] = waves_over(*period);
        [a, b, c, d, 1.0]
    };
    let rows: Vec<[f64; 5]> = periods.iter().map(row).collect();
    let ([a, b, c, d, mean], left) = fit(&rows, values)?;
    let of_all = values.iter().sum::<f64>() / values.len() as f64;
    Some(Fitted {
        mean,
        waves: [a, b, c, d],
        left,
        without: values.iter().map(|value| value - of_all).collect(),
    })
}

/// Means of cosine and sine of the year and the half-year over a period.
fn waves_over(period: Period) -> [f64; 4] {
    let [[a, b], [c, d]] = [1.0, 2.0].map(|times| wave_over(period, times));
    [a, b, c, d]
}

/// Mean of cosine and sine of a wave that comes `times` times a year over a period.
fn wave_over(period: Period, times: f64) -> [f64; 2] {
    let turn = TAU * times / YEAR_MS;
    let angle = |ms: i64| turn * (ms as f64 - START_MS);
    let (start, end) = (angle(period.start.ms()), angle(period.end.ms()));
    // The mean over an interval is the value in its middle times sin(h) / h of half its angle.
    let (middle, half) = (0.5 * (start + end), 0.5 * (end - start));
    let flattened = half.sin() / half;
    [middle.cos() * flattened, middle.sin() * flattened]
}

/// Amplitude and the first highest time of a year.
fn harmonic([cosine, sine]: [f64; 2], times: f64) -> Harmonic {
    let turns = sine.atan2(cosine).rem_euclid(TAU) / TAU;
    Harmonic {
        amplitude: cosine.hypot(sine),
        highest_after_days: turns * 365.25 / times,
    }
}

#[cfg(test)]
mod tests;
