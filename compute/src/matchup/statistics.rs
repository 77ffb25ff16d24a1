//! How far two series of values differ: pure maths.

use serde::{Deserialize, Serialize};

use crate::analysis::correlation::varies;

/// Difference of gridded and observed values over all pairs, unit of the values; none where it is not defined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Number of pairs.
    pub count: u64,
    /// Mean of gridded minus observed.
    pub bias: Option<f64>,
    /// Root of the mean of its square.
    pub rmse: Option<f64>,
    /// Pearson's correlation, -1 to 1; none with fewer than two pairs or where one side does not vary.
    pub correlation: Option<f64>,
    /// Mean of the observed values.
    pub observed_mean: Option<f64>,
    /// Mean of the gridded values.
    pub gridded_mean: Option<f64>,
}

impl Statistics {
    /// Statistics of pairs (observed, gridded), in two passes so that large means cost no digits of the spread.
    pub fn of(pairs: &(impl Iterator<Item = (f64, f64)> + Clone)) -> Self {
        let count = pairs.clone().count() as u64;
        let mean = |value: fn((f64, f64)) -> f64| {
            let sum: f64 = pairs.clone().map(value).sum();
            (count > 0).then(|| sum / count as f64)
        };
        let (observed_mean, gridded_mean) = (mean(|p| p.0), mean(|p| p.1));
        let correlation = observed_mean
            .zip(gridded_mean)
            .and_then(|means| correlation(pairs.clone(), means));
        Self {
            count,
            bias: mean(|(observed, gridded)| gridded - observed),
            rmse: mean(|(observed, gridded)| (gridded - observed).powi(2)).map(f64::sqrt),
            correlation: correlation.filter(|_| count > 1),
            observed_mean,
            gridded_mean,
        }
    }
}

fn correlation(
    pairs: impl Iterator<Item = (f64, f64)> + Clone,
    (mean_a, mean_b): (f64, f64),
) -> Option<f64> {
    let is_told = varies(pairs.clone().map(|(a, _)| a)) && varies(pairs.clone().map(|(_, b)| b));
    if !is_told {
        return None;
    }
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a - mean_a, b - mean_b);
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    let spread = (aa * bb).sqrt();
    (spread > 0.0).then(|| (ab / spread).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(pairs: &[(f64, f64)]) -> Statistics {
        Statistics::of(&pairs.iter().copied())
    }

    /// By hand: differences 1, 1, -1, 3; mean 1; squares 1, 1, 1, 9, mean 3. Deviations of the observed -1.5, -0.5, 0.5,
    /// 1.5 and of the gridded -1.5, -0.5, -1.5, 3.5: sums of products 5, 17, 7; 7 / sqrt(85).
    #[test]
    fn numbers_are_those_of_a_hand_calculation() {
        let s = of(&[(1.0, 2.0), (2.0, 3.0), (3.0, 2.0), (4.0, 7.0)]);
        assert_eq!(
            (s.count, s.bias, s.rmse),
            (4, Some(1.0), Some(3.0f64.sqrt()))
        );
        assert!((s.correlation.unwrap() - 7.0 / 85.0f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn what_is_not_defined_is_none() {
        assert_eq!(of(&[]).bias, None);
        let one = of(&[(1.0, 2.0)]);
        assert_eq!((one.bias, one.correlation), (Some(1.0), None));
        assert_eq!(of(&[(1.0, 2.0), (1.0, 3.0)]).correlation, None);
        assert_eq!(of(&[(1.0, -2.0), (2.0, -4.0)]).correlation, Some(-1.0));
    }

    /// The mean of many equal values lies beside them by rounding.
    #[test]
    fn a_side_of_equal_values_has_no_correlation_whatever_they_are() {
        let freezing = f64::from(271.35f32) - 273.15;
        let drift = |at: u32| f64::from(at) * 0.01;
        let constant: Vec<(f64, f64)> = (0..840).map(|at| (drift(at), freezing)).collect();
        assert_eq!(of(&constant).correlation, None);
        let turned: Vec<(f64, f64)> = constant.iter().map(|(a, b)| (*b, *a)).collect();
        assert_eq!(of(&turned).correlation, None);
    }
}
