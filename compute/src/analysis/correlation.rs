//! How two series on common steps go together, now and later.

use contract::analysis::CorrelationRow;

use super::autocorrelation::autocorrelation;
use super::distribution::student_two_sided;
use super::undefined::Undefined;

/// Pairs from which a correlation is one.
pub const LEAST_PAIRS: usize = 3;
/// What the sides of a correlation are called.
const FIRST: &str = "the first series";
const SECOND: &str = "the second series";
const BOTH: &str = "either series";
/// How far apart equal values may lie as means of different lengths are rounded, as a share of the largest.
const ROUNDING: f64 = 1e-12;

/// The correlation of two series at lags from `-max_lag` to `max_lag` steps; the second is read `lag` steps after the first.
///
/// Both hold one value for each of the same steps at equal distances, NaN no data, any unit. Pearson's over the pairs there
/// are, or the reason why there is none; effective pairs after Bretherton et al. (1999),
/// doi:10.1175/1520-0442(1999)012<1990:TENOSD>2.0.CO;2, equation 31.
pub fn correlations(first: &[f64], second: &[f64], max_lag: u32) -> Vec<CorrelationRow> {
    let together = together(first, second);
    let max_lag = i32::try_from(max_lag).unwrap_or(i32::MAX);
    let told = |lag: i32| {
        let (row, why) = at_lag(first, second, lag, together);
        let undefined = why.map(|why| why.to_string());
        CorrelationRow { undefined, ..row }
    };
    (-max_lag..=max_lag).map(told).collect()
}

/// The same at one lag alone, without the reason: of maps, nobody reads it in every cell.
pub fn correlation_at(first: &[f64], second: &[f64], lag: i32) -> CorrelationRow {
    at_lag(first, second, lag, together(first, second)).0
}

/// How both together go with their next steps.
fn together(first: &[f64], second: &[f64]) -> f64 {
    autocorrelation(first, 1) * autocorrelation(second, 1)
}

/// The row of a lag, and why it has no correlation.
fn at_lag(
    first: &[f64],
    second: &[f64],
    lag: i32,
    together: f64,
) -> (CorrelationRow, Option<Undefined>) {
    let by = lag.unsigned_abs() as usize;
    let (a, b) = if lag >= 0 {
        (first, second.get(by..).unwrap_or_default())
    } else {
        (first.get(by..).unwrap_or_default(), second)
    };
    let pairs: Vec<(f64, f64)> = a
        .iter()
        .copied()
        .zip(b.iter().copied())
        .filter(|(a, b)| !a.is_nan() && !b.is_nan())
        .collect();
    let found = pearson(&pairs);
    let correlation = found.as_ref().ok().copied();
    let together = together.max(0.0);
    let effective = pairs.len() as f64 * (1.0 - together) / (1.0 + together);
    let p_value = correlation.and_then(|r| {
        let freedom = effective - 2.0;
        let spread = 1.0 - r * r;
        if spread <= 0.0 {
            // All pairs lie on a line.
            return (freedom > 0.0).then_some(0.0);
        }
        student_two_sided(r * (freedom.max(0.0) / spread).sqrt(), freedom)
    });
    let row = CorrelationRow {
        lag_steps: lag,
        count: pairs.len() as u64,
        correlation,
        undefined: None,
        effective_count: correlation.map(|_| effective),
        p_value,
    };
    (row, found.err())
}

/// Pearson's correlation of pairs, none NaN.
///
/// # Errors
/// Fewer than three, or a side that does not vary.
fn pearson(pairs: &[(f64, f64)]) -> Result<f64, Undefined> {
    let n = pairs.len();
    if n < LEAST_PAIRS {
        return Err(Undefined::TooFew {
            what: "a correlation of pairs",
            needed: LEAST_PAIRS,
            found: n,
        });
    }
    let constant = |side| Undefined::ConstantSide { side, count: n };
    let varies = |of: fn(&(f64, f64)) -> f64| varies(pairs.iter().map(of));
    match (varies(|pair| pair.0), varies(|pair| pair.1)) {
        (true, true) => {}
        (false, true) => return Err(constant(FIRST)),
        (true, false) => return Err(constant(SECOND)),
        (false, false) => return Err(constant(BOTH)),
    }
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n as f64;
    let (mean_a, mean_b) = (mean(|p| p.0), mean(|p| p.1));
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a - mean_a, b - mean_b);
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    let spread = (aa * bb).sqrt();
    // Both vary by so little that the product of their squares is none.
    let is_told = spread > 0.0;
    let correlation = || (ab / spread).clamp(-1.0, 1.0);
    is_told.then(correlation).ok_or_else(|| constant(BOTH))
}

/// Are there two values, none NaN, that differ by more than rounding? The mean of equal values lies beside them by rounding, and squares of that are
/// no spread.
pub fn varies(values: impl Iterator<Item = f64>) -> bool {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    high - low > ROUNDING * low.abs().max(high.abs())
}

#[cfg(test)]
mod tests;
