//! The test of Mann and Kendall for a trend, with the variance that autocorrelated values have.

use contract::analysis::MannKendall;

use super::autocorrelation::autocorrelation;
use super::distribution::{normal_quantile, normal_two_sided};
use super::undefined::Undefined;

/// Values from which the score is about normal (Kendall 1975).
pub const LEAST_VALUES: usize = 10;
/// Most values that are compared pair by pair: 0.1 s.
pub const MOST_VALUES: usize = 12_000;

/// The test over values at equal distances, NaN no data, any unit.
///
/// The variance is corrected as Hamed and Rao (1998), doi:10.1016/S0022-1694(97)00125-X, equation 16, do, with the autocorrelation of the ranks of the
/// `detrended` values (those less Sen's slope), one beside each, from one step to the next where it is beyond 95 % of chance, and at longer lags with its
/// powers, as noise has it that keeps so much of itself from step to step (Yue and Wang 2004, doi:10.1023/B:WARM.0000043140.61082.60). They take what is
/// found at each lag: negative values that chance makes at long lags then take back most of what the short ones add, and of series of 20 years without a trend,
/// whose months keep 0.6 or 0.8 of the one before, 17 and 24 in a hundred have one with p < 0.05. Never below 1: what few values seem to take away
/// from the variance is mostly chance.
///
/// Values that lie no farther apart than `rounding` are equal: which of them is larger would be decided by the unit that they are in.
///
/// # Errors
/// Fewer than ten values, more than 12 000, or all equal.
pub fn mann_kendall(
    values: &[f64],
    detrended: &[f64],
    rounding: f64,
) -> Result<MannKendall, Undefined> {
    const WHAT: &str = "a test for a trend";
    let present: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let found = present.len();
    if found < LEAST_VALUES {
        let (what, needed) = (WHAT, LEAST_VALUES);
        return Err(Undefined::TooFew {
            what,
            needed,
            found,
        });
    }
    if found > MOST_VALUES {
        let (what, most) = (WHAT, MOST_VALUES);
        return Err(Undefined::TooMany { what, found, most });
    }
    let variance = score_variance(&present, rounding);
    if variance <= 0.0 {
        let (what, count) = (WHAT, found);
        return Err(Undefined::Constant { what, count });
    }
    let score = score(&present, rounding);
    let correction = variance_correction(detrended, rounding).max(1.0);
    // One pair less, for the score moves in steps of two.
    let moved = (score - score.signum()) as f64;
    let z = moved / (variance * correction).sqrt();
    let n = found as f64;
    Ok(MannKendall {
        score,
        tau: score as f64 / (0.5 * n * (n - 1.0)),
        variance_correction: correction,
        z,
        p_value: normal_two_sided(z),
    })
}

/// Pairs that rise less pairs that fall; values in the order of time.
fn score(values: &[f64], rounding: f64) -> i64 {
    let mut score = 0;
    for (i, a) in values.iter().enumerate() {
        let (above, below) = (a + rounding, a - rounding);
        let later = values[i + 1..].iter();
        score += later
            .map(|b| i64::from(*b > above) - i64::from(*b < below))
            .sum::<i64>();
    }
    score
}

/// Variance of the score of values that do not go together, equal ones allowed for (Kendall 1975).
pub fn score_variance(values: &[f64], rounding: f64) -> f64 {
    let term = |n: f64| n * (n - 1.0) * (2.0 * n + 5.0);
    let ties: f64 = tied(values, rounding)
        .iter()
        .map(|run| term(*run as f64))
        .sum();
    (term(values.len() as f64) - ties) / 18.0
}

/// Lengths of the runs of equal values.
fn tied(values: &[f64], rounding: f64) -> Vec<usize> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
        .chunk_by(|a, b| b - a <= rounding)
        .map(<[f64]>::len)
        .collect()
}

/// What autocorrelation multiplies the variance of the score with; below 1 where values go against their next ones.
fn variance_correction(detrended: &[f64], rounding: f64) -> f64 {
    let ranks = ranks(detrended, rounding);
    let n = ranks.iter().filter(|rank| !rank.is_nan()).count() as f64;
    let next = autocorrelation(&ranks, 1);
    if next.abs() <= normal_quantile() / n.sqrt() {
        return 1.0;
    }
    let (mut sum, mut r, mut left) = (0.0, next, n - 1.0);
    while left > 2.0 {
        sum += left * (left - 1.0) * (left - 2.0) * r;
        r *= next;
        left -= 1.0;
    }
    1.0 + 2.0 / (n * (n - 1.0) * (n - 2.0)) * sum
}

/// Ranks from 1, equal values the mean of theirs; NaN stays NaN.
fn ranks(values: &[f64], rounding: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).filter(|i| !values[*i].is_nan()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![f64::NAN; values.len()];
    let mut before = 0;
    for equal in order.chunk_by(|a, b| values[*b] - values[*a] <= rounding) {
        let rank = before as f64 + 0.5 * (equal.len() as f64 + 1.0);
        for i in equal {
            ranks[*i] = rank;
        }
        before += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests;
