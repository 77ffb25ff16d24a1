//! Median and tail of a series of times.

use serde::Serialize;

/// Times of repeated runs, ms.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Times {
    pub median_ms: f64,
    pub p99_ms: f64,
    pub runs: usize,
}

impl Times {
    /// Of times in seconds, in any order; zeros of none.
    pub fn of(mut seconds: Vec<f64>) -> Self {
        seconds.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let last = seconds.len().saturating_sub(1);
            let index = (last as f64 * share).round() as usize;
            seconds.get(index).map_or(0.0, |s| s * 1e3)
        };
        Self {
            median_ms: at(0.5),
            p99_ms: at(0.99),
            runs: seconds.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_and_the_tail_is_near_the_end() {
        let times = Times::of((0..=100).rev().map(|ms| f64::from(ms) * 1e-3).collect());
        assert!((times.median_ms - 50.0).abs() < 1e-9 && (times.p99_ms - 99.0).abs() < 1e-9);
        assert_eq!(Times::of(vec![]).runs, 0);
    }
}
