//! Values of a field about their mean in units of a power of two, so that sums of them lose nothing to their size.

use crate::stages::layout::{MISSING, is_missing};

/// A field's values between -1 and 1 and how to get back.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaled {
    /// `[row, col]`; [`MISSING`] where there is no data.
    pub values: Vec<f32>,
    center: f64,
    unit: f64,
}

impl Scaled {
    /// Scales values (NaN, infinite or [`MISSING`] where there is no data); none if there is no data at all.
    pub fn of(values: &[f32]) -> Option<Self> {
        let held = || {
            values
                .iter()
                .filter(|value| holds(**value))
                .map(|value| f64::from(*value))
        };
        let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
        for value in held() {
            (low, high) = (low.min(value), high.max(value));
            sum += value;
            count += 1.0;
        }
        if count == 0.0 {
            return None;
        }
        let center = sum / count;
        let widest = (high - center).max(center - low);
        // The next power of two: dividing by it is exact.
        let unit = if widest > 0.0 {
            2f64.powi(widest.log2().ceil() as i32)
        } else {
            1.0
        };
        let scale = |value: &f32| {
            if holds(*value) {
                ((f64::from(*value) - center) / unit) as f32
            } else {
                MISSING
            }
        };
        Some(Self {
            values: values.iter().map(scale).collect(),
            center,
            unit,
        })
    }

    /// The value of a scaled one.
    pub fn value(&self, scaled: f32) -> f32 {
        (self.center + f64::from(scaled) * self.unit) as f32
    }

    /// The standard deviation of a scaled variance, which rounding may have made negative.
    pub fn deviation(&self, variance: f32) -> f32 {
        (f64::from(variance.max(0.0)).sqrt() * self.unit) as f32
    }
}

/// Is there a value?
pub fn holds(value: f32) -> bool {
    value.is_finite() && !is_missing(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_and_small_ones_are_not_lost_beside_their_mean() {
        let values = [301.0f32, 301.5, f32::NAN, 302.25, MISSING, f32::INFINITY];
        let scaled = Scaled::of(&values).unwrap();
        for (value, small) in values.iter().zip(&scaled.values) {
            if holds(*value) {
                assert!(small.abs() <= 1.0);
                assert_eq!(scaled.value(*small).to_bits(), value.to_bits());
            } else {
                assert_eq!(small.to_bits(), MISSING.to_bits());
            }
        }
        assert!(Scaled::of(&[f32::NAN, MISSING]).is_none());
        assert_eq!(
            Scaled::of(&[4.0, 4.0]).unwrap().value(0.0).to_bits(),
            4.0f32.to_bits()
        );
        let tiny = Scaled::of(&[1e-38, 3e-38]).unwrap();
        assert!(
            tiny.values.iter().all(|v| v.abs() >= 0.5),
            "no denormal numbers"
        );
    }
}
