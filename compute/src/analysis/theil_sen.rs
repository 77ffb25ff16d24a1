//! The median of the slopes of all pairs of values, exact, with Sen's interval.

use super::distribution::normal_quantile;
use super::mann_kendall::score_variance;
use super::selection::{SORTED_AT_MOST, at_ranks};

/// The slopes of all pairs of values at different times, unit of the values a year.
///
/// Of up to a million pairs they are sorted; of more none is kept, and what is asked for is selected digit by digit in four
/// passes over all pairs: exact in bounded memory either way. The slope of Theil (1950) and Sen (1968),
/// doi:10.1080/01621459.1968.10480934.
#[derive(Debug, Clone, Copy)]
pub struct Slopes<'a> {
    /// Rising.
    years: &'a [f64],
    /// Beside them, any unit, none NaN.
    values: &'a [f64],
    count: usize,
    sorted_at_most: usize,
}

impl<'a> Slopes<'a> {
    /// Those of values at rising times, none NaN; none of fewer than two values at different times.
    pub fn of(years: &'a [f64], values: &'a [f64]) -> Option<Self> {
        Self::sorted_at_most(years, values, SORTED_AT_MOST)
    }

    fn sorted_at_most(years: &'a [f64], values: &'a [f64], sorted_at_most: usize) -> Option<Self> {
        let mut slopes = Self {
            years,
            values,
            count: 0,
            sorted_at_most,
        };
        slopes.count = slopes.each().count();
        (slopes.count > 0).then_some(slopes)
    }

    fn each(self) -> impl Iterator<Item = f64> {
        (0..self.years.len()).flat_map(move |i| {
            let (x, y) = (self.years[i], self.values[i]);
            let later = self.years[i + 1..].iter().zip(&self.values[i + 1..]);
            later
                .filter(move |(later, _)| **later > x)
                .map(move |(later, value)| (value - y) / (later - x))
        })
    }

    /// The one in their middle, the mean of two where there is none.
    pub fn median(self) -> f64 {
        let middle = [(self.count - 1) / 2, self.count / 2];
        let found = at_ranks(|| self.each(), self.count, &middle, self.sorted_at_most);
        0.5 * (found[0] + found[1])
    }

    /// Lower and upper end of the interval that holds the slope with 95 %: Sen's equation 2.6 with the variance of the score
    /// times `variance_correction`, which is 1 for values that do not go together.
    pub fn interval(self, variance_correction: f64) -> (f64, f64) {
        let variance = score_variance(self.values) * variance_correction.max(0.0);
        let reach = normal_quantile() * variance.sqrt();
        let n = self.count as f64;
        // As scipy rounds it: half a rank to the even one.
        let rank = |at: f64| at.round_ties_even() as usize;
        let upper = rank(0.5 * (n + reach)).min(self.count - 1);
        let lower = rank(0.5 * (n - reach)).saturating_sub(1);
        let ends = [lower, upper];
        let found = at_ranks(|| self.each(), self.count, &ends, self.sorted_at_most);
        (found[0], found[1])
    }
}

#[cfg(test)]
mod tests;
