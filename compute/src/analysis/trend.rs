//! The trend of a series: seasons off, two slopes, a test.

use std::cmp::Ordering;

use contract::analysis::{
    CalendarBins, LeastSquaresTrend, MannKendall, TheilSenTrend, Trend, TrendValue,
};
use contract::time::{Period, TimeMs, TimeStep};

use super::climatology::{Seasonless, mean, months_of, rounding_of};
use super::extremes::percentile;
use super::linear_trend::least_squares;
use super::mann_kendall::{LEAST_VALUES, MOST_VALUES, mann_kendall};
use super::theil_sen::Slopes;
use super::timeline::{Bins, YEAR_MS, longest_s, middles_years, no_shorter};
use super::undefined::Undefined;

/// What an answer about a trend is called.
const WHAT: &str = "a trend";
/// Years of values that a trend needs: of fewer, each month's own mean takes more than a fifth of the noise that it is taken off from.
pub const LEAST_YEARS: f64 = 5.0;
/// Beside the length of a bin, of which one may lack at either end: rounding, years.
const ROUNDING_YEARS: f64 = 0.006;
/// Shortest three months, s: of two steps that are shorter both may lie in one season.
const LEAST_SEASON_S: f64 = 88.0 * 86_400.0;
/// Years in a decade.
const DECADE: f64 = 10.0;

/// The trend of a series through means of `step`, or through steps as they are where those are longer.
///
/// `periods` are in the order of time, `values` beside them in `unit`, NaN no data. Where steps are no longer than months, or are seasons, the
/// season is taken off first: the mean of each calendar month or season, found together with a line.
///
/// # Errors
/// Fewer than ten values or five years, more than 12 000 values, or all equal.
pub fn trend(
    periods: &[Period],
    values: &[f64],
    step: TimeStep,
    unit: &str,
) -> Result<Trend, Undefined> {
    TrendSteps::of(periods, step).trend(values, unit)
}

/// Steps that trends are found over: what all series over the same steps have in common.
#[derive(Debug)]
pub struct TrendSteps {
    step: TimeStep,
    bins: Bins,
    /// Calendar month or season of each bin, from 0; none where bins are longer.
    parts: Option<Vec<usize>>,
    /// Middle of each bin, years after the first one's.
    years: Vec<f64>,
}

impl TrendSteps {
    /// Steps in the order of time, gathered in means of `step` where they are no longer.
    pub fn of(periods: &[Period], step: TimeStep) -> Self {
        let step = no_shorter(periods, step);
        let bins = Bins::over(periods, step);
        let own = bins.periods();
        Self {
            step,
            parts: parts_of_year(own),
            years: middles_years(own),
            bins,
        }
    }

    /// The trend of a series over these steps, as [`trend`] tells it.
    ///
    /// # Errors
    /// As there.
    pub fn trend(&self, values: &[f64], unit: &str) -> Result<Trend, Undefined> {
        let basis = self.basis(values)?;
        let Basis {
            here,
            means,
            values: of_basis,
            years_here,
            values_here,
            ..
        } = &basis;
        let (slopes, slope, test) = basis.tested(&self.years)?;
        let (lower, upper) = slopes.interval(test.variance_correction * basis.less_known());
        let constant = || basis.constant();
        let periods = self.bins.periods();
        let mid_years = mean(years_here).ok_or_else(constant)?;
        let means_here: Vec<f64> = here.iter().map(|i| means[*i]).collect();
        let mean_of_all = mean(&means_here).ok_or_else(constant)?;
        let mean_of_basis = mean(values_here).ok_or_else(constant)?;
        let about_mid = |(x, v): (&f64, &f64)| v - slope * (x - mid_years);
        let mut about: Vec<f64> = years_here.iter().zip(values_here).map(about_mid).collect();
        about.sort_unstable_by(f64::total_cmp);
        let value = |i: &usize| TrendValue {
            start: periods[*i].start,
            end: periods[*i].end,
            value: of_basis[*i] - mean_of_basis + mean_of_all,
        };
        let mid_ms = periods[0].mid().ms() + (mid_years * YEAR_MS).round() as i64;
        Ok(Trend {
            slope_unit: format!("{unit} per decade").trim_start().to_owned(),
            step: self.step,
            deseasonalised: self.parts.is_some(),
            count: here.len() as u64,
            years: basis.spanned_years,
            mid: TimeMs::new(mid_ms).unwrap_or_else(|_| periods[0].mid()),
            mean: mean_of_all,
            least_squares: least_squares(&self.years, of_basis, basis.season.as_ref())
                .ok_or_else(constant)?,
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

    /// Theil and Sen's slope alone, a decade, and the test of it: those of [`Self::trend`].
    ///
    /// # Errors
    /// As there.
    pub fn tested_slope(&self, values: &[f64]) -> Result<(f64, MannKendall), Undefined> {
        let basis = self.basis(values)?;
        let (_slopes, slope, test) = basis.tested(&self.years)?;
        Ok((slope * DECADE, test))
    }

    /// The trend by least squares alone: that of [`Self::trend`].
    ///
    /// # Errors
    /// As there.
    pub fn least_squares(&self, values: &[f64]) -> Result<LeastSquaresTrend, Undefined> {
        let basis = self.basis(values)?;
        // Seasons and nothing else: the test refuses what is left of them.
        let first = basis.values_here[0];
        let is_first = |value: &f64| value.partial_cmp(&first).is_some_and(Ordering::is_eq);
        if basis.values_here.iter().all(is_first) {
            return Err(basis.constant());
        }
        let found = least_squares(&self.years, &basis.values, basis.season.as_ref());
        found.ok_or_else(|| basis.constant())
    }

    /// What slopes are sought in.
    fn basis(&self, values: &[f64]) -> Result<Basis, Undefined> {
        let means = self.bins.means(values);
        let here: Vec<usize> = (0..means.len()).filter(|i| !means[*i].is_nan()).collect();
        let spanned_years = years_of(self.bins.periods(), &means, &here)?;
        let parts = self.parts.as_ref();
        let season = parts.map(|parts| Seasonless::of(parts, &self.years, &means));
        if let Some(season) = &season {
            // The mean of each part of the year takes a value, and a line two.
            let needed = season.part_count + 3;
            if here.len() < needed {
                return Err(Undefined::TooFew {
                    what: "a trend beside a season",
                    needed,
                    found: here.len(),
                });
            }
        }
        let with_line = season.as_ref().map(|season| season.with_line.clone());
        let values = with_line.unwrap_or_else(|| means.clone());
        let of_here = |all: &[f64]| -> Vec<f64> { here.iter().map(|i| all[*i]).collect() };
        Ok(Basis {
            years_here: of_here(&self.years),
            values_here: of_here(&values),
            here,
            means,
            values,
            season,
            spanned_years,
        })
    }
}

/// The calendar month of each bin, or its season where all are as long as one; none where they are longer.
fn parts_of_year(bins: &[Period]) -> Option<Vec<usize>> {
    if longest_s(bins) <= CalendarBins::Month.longest_step_s() {
        return Some(months_of(bins));
    }
    let season = |period: &Period| CalendarBins::Season.of(*period);
    let is_season = |period: &Period| {
        (LEAST_SEASON_S..=CalendarBins::Season.longest_step_s()).contains(&period.seconds())
    };
    bins.iter()
        .all(is_season)
        .then(|| bins.iter().map(season).collect())
}

/// A series that slopes are sought in.
struct Basis {
    /// Bins with data.
    here: Vec<usize>,
    /// Of every bin, NaN no data.
    means: Vec<f64>,
    /// The same, seasons off, rising as they do.
    values: Vec<f64>,
    /// What was taken off, and the same not rising by it; none where bins are longer than seasons.
    season: Option<Seasonless>,
    /// Middles of the bins with data, years.
    years_here: Vec<f64>,
    /// Their values, seasons off.
    values_here: Vec<f64>,
    /// Years that they span.
    spanned_years: f64,
}

impl Basis {
    fn constant(&self) -> Undefined {
        Undefined::Constant {
            what: WHAT,
            count: self.here.len(),
        }
    }

    /// All slopes, their median, and the test; `years` are the middles of all bins.
    fn tested(&self, years: &[f64]) -> Result<(Slopes<'_>, f64, MannKendall), Undefined> {
        let slopes = Slopes::of(&self.years_here, &self.values_here);
        let slopes = slopes.ok_or_else(|| self.constant())?;
        let slope = slopes.median();
        let less = |(v, x): (&f64, &f64)| v - slope * x;
        let detrended: Vec<f64> = self.values.iter().zip(years).map(less).collect();
        // A line that was put back is one that noise has too: of what it was taken off from there is no more of it than chance has.
        let tested = self
            .season
            .as_ref()
            .map_or(&self.values, |season| &season.less);
        // The two values that Sen's slope lies between are equal without it, but for rounding; so are others where values have few digits.
        let test = mann_kendall(tested, &detrended, rounding_of(&self.means))?;
        Ok((slopes, slope, test))
    }

    /// How many times as large the variance of a slope is as without means of parts of the year beside it: times vary by less beside them, and each takes a
    /// part of the scatter.
    fn less_known(&self) -> f64 {
        let Some(season) = self.season.as_ref().filter(|own| own.squared_years > 0.0) else {
            return 1.0;
        };
        let middle = mean(&self.years_here).unwrap_or_default();
        let squares = self.years_here.iter().map(|x| (x - middle).powi(2));
        let count = self.values_here.len() as f64;
        let scatter = (count - 2.0) / (count - season.part_count as f64 - 1.0);
        squares.sum::<f64>() / season.squared_years * scatter
    }
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
    let bin_years = longest_s(periods) * 1e3 / YEAR_MS;
    if found_years < LEAST_YEARS - bin_years - ROUNDING_YEARS {
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
