//! The median of the slopes of all pairs of values, exact, with Sen's interval.

use super::distribution::normal_quantile;
use super::mann_kendall::score_variance;
use super::selection::{HELD_AT_MOST, at_ranks, key_of, of_keys};

/// The slopes of all pairs of values at different times, unit of the values a year.
///
/// Of up to a million pairs they are held and selected from; of more none is kept, and what is asked for is selected digit by digit
/// in four passes over all pairs: exact in bounded memory either way. The slope of Theil (1950) and Sen (1968),
/// doi:10.1080/01621459.1968.10480934.
#[derive(Debug, Clone, Copy)]
pub struct Slopes<'a> {
    /// Rising.
    years: &'a [f64],
    /// Beside them, any unit, none NaN.
    values: &'a [f64],
    count: usize,
    /// Are no two values of one time? Then every pair has a slope.
    is_rising: bool,
    held_at_most: usize,
}

impl<'a> Slopes<'a> {
    /// Those of values at rising times, none NaN; none of fewer than two values at different times.
    pub fn of(years: &'a [f64], values: &'a [f64]) -> Option<Self> {
        Self::held_at_most(years, values, HELD_AT_MOST)
    }

    fn held_at_most(years: &'a [f64], values: &'a [f64], held_at_most: usize) -> Option<Self> {
        let n = years.len();
        let is_rising = n == values.len() && years.is_sorted_by(|earlier, later| earlier < later);
        let mut slopes = Self {
            years,
            values,
            count: n * n.saturating_sub(1) / 2,
            is_rising,
            held_at_most,
        };
        if !is_rising {
            slopes.count = slopes.each().count();
        }
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

    /// Those of some ranks.
    fn ranked(self, ranks: &[usize]) -> Vec<f64> {
        if !self.is_rising || self.count > self.held_at_most {
            return at_ranks(|| self.each(), self.count, ranks, self.held_at_most);
        }
        // The same slopes in the same order, in loops that processors have wide instructions for.
        let mut keys = Vec::with_capacity(self.count);
        for (i, (x, y)) in self.years.iter().zip(self.values).enumerate() {
            let later = self.years[i + 1..].iter().zip(&self.values[i + 1..]);
            keys.extend(later.map(|(later, value)| key_of((value - y) / (later - x))));
        }
        of_keys(&mut keys, ranks)
    }

    /// The one in their middle, the mean of two where there is none.
    pub fn median(self) -> f64 {
        let middle = [(self.count - 1) / 2, self.count / 2];
        let found = self.ranked(&middle);
        0.5 * (found[0] + found[1])
    }

    /// Lower and upper end of the interval that holds the slope with 95 %: Sen's equation 2.6 with the variance of the score
    /// times `variance_correction`, which is 1 for values that do not go together.
    pub fn interval(self, variance_correction: f64) -> (f64, f64) {
        let variance = score_variance(self.values, 0.0) * variance_correction.max(0.0);
        let reach = normal_quantile() * variance.sqrt();
        let n = self.count as f64;
        // As scipy rounds it: half a rank to the even one.
        let rank = |at: f64| at.round_ties_even() as usize;
        let upper = rank(0.5 * (n + reach)).min(self.count - 1);
        let lower = rank(0.5 * (n - reach)).saturating_sub(1);
        let ends = [lower, upper];
        let found = self.ranked(&ends);
        (found[0], found[1])
    }
}

#[cfg(test)]
mod tests;
