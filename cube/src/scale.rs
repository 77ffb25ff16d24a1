//! Fixed-point numbers that values are summed in, whatever the quantity: by questions, and in sums that are stored.

use contract::quantity::Quantity;
use serde::{Deserialize, Serialize};

/// Steps of a value in the unit of its scale, as a power of two.
const VALUE_BITS: i32 = 44;
/// The same of the square of a value.
const SQUARE_BITS: i32 = 48;
/// Least standard deviation in units of the scale that sums of squares tell, as a power of two. Each square is rounded by half a step or less, 2⁻⁴⁹: of a
/// variance of 2⁻⁴⁰ that is a five-hundredth.
const LEAST_STD_BITS: i32 = 20;
/// Least mean distance from a zero at 0 that sums of values tell, in steps, as a power of two. Each value is rounded by half a step or less: half a millionth.
const LEAST_MEAN_BITS: i32 = 20;
/// Largest value in units of the scale: twice what can be true.
const LIMIT: f64 = 2.0;
/// Added to a number below 2⁵¹, it leaves the nearest integer in the lowest bits (halves to even).
const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// Where a quantity's fixed-point numbers have their zero, and how large their steps are.
///
/// The zero is 0, or the middle of what can be true where that is far from 0 (kelvins, pascals): then the variance is not the
/// small difference of two large numbers. Steps are 2⁻⁴⁴ of the largest distance from it that can be true, next power of
/// two: 2 pK of a temperature, 5e-20 kg m⁻² s⁻¹ of a flux, far below what 24 bits of a stored value tell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Value that is summed as 0, stored unit.
    #[serde(with = "bits")]
    pub(crate) zero: f64,
    /// The unit of the scale as a power of two, stored unit.
    exponent: i32,
}

/// A number by its bits: readers of decimal numbers may differ in the last one.
mod bits {
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
    pub(super) fn serialize<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(number.to_bits())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        u64::deserialize(from).map(f64::from_bits)
    }
}

impl Scale {
    /// That of a quantity; none of one whose values are not known to lie in any range.
    pub fn of(quantity: Quantity) -> Option<Self> {
        match quantity {
            Quantity::Open(_) => None,
            other => Some(Self::over(other.plausible().into_inner())),
        }
    }

    /// One that tells nothing but which values there are.
    pub fn of_all() -> Self {
        Self::over((f32::MIN.into(), f32::MAX.into()))
    }

    /// That of values between two.
    pub fn over((low, high): (f64, f64)) -> Self {
        let is_far = low > 0.0 || high < 0.0;
        let zero = if is_far { 0.5 * (low + high) } else { 0.0 };
        let largest = (high - zero).max(zero - low);
        // Of a single value the distance from 0, so that its steps are not nothing.
        let largest = if largest > 0.0 { largest } else { high.abs() };
        let exponent = largest.max(f32::MIN_POSITIVE.into()).log2().ceil();
        Self {
            zero,
            exponent: exponent as i32,
        }
    }

    /// What a value in units of 1 has, stored unit: a power of two.
    fn unit(self) -> f64 {
        f64::from(self.exponent).exp2()
    }

    /// The largest distance from the zero that it was made for, stored unit.
    pub fn largest(self) -> f64 {
        self.unit()
    }

    /// Value that is summed as 0, stored unit.
    pub fn zero(self) -> f64 {
        self.zero
    }

    /// Steps of the largest distance from the zero that can be summed.
    pub fn most_steps() -> f64 {
        LIMIT * f64::from(VALUE_BITS).exp2()
    }

    /// What a value less the zero is multiplied with.
    #[inline]
    pub fn steps_per_value(self) -> f64 {
        f64::from(VALUE_BITS).exp2() / self.unit()
    }

    /// What the square of a number of steps is multiplied with to be one of squares.
    #[inline]
    pub fn squares_per_step() -> f64 {
        f64::from(SQUARE_BITS - 2 * VALUE_BITS).exp2()
    }

    /// A value as the nearest number of steps. What cannot be summed gives some number: [`Scale::holds`] tells.
    #[inline]
    pub fn steps(self, value: f32) -> i64 {
        nearest((f64::from(value) - self.zero) * self.steps_per_value())
    }

    /// Its square as the nearest number of steps of squares.
    #[inline]
    pub fn square_steps(self, value: f32) -> i64 {
        let steps = (f64::from(value) - self.zero) * self.steps_per_value();
        nearest(steps * steps * Self::squares_per_step())
    }

    /// The same of many values: what is equal for all is computed once.
    pub(crate) fn counter(self) -> Counter {
        Counter {
            zero: self.zero,
            steps_per_value: self.steps_per_value(),
            squares_per_step: Self::squares_per_step(),
        }
    }

    /// Can a value be summed? Infinite ones cannot.
    pub fn holds(self, value: f32) -> bool {
        (f64::from(value) - self.zero).abs() <= LIMIT * self.unit()
    }

    /// The mean of some values, stored unit: their weighted sum in steps over their weight.
    pub fn mean(self, sum: i128, weight: i128) -> f64 {
        self.zero + self.deviation(sum, weight)
    }

    /// Do their sum and weight tell this mean, to half a millionth? Of smaller values it is in part what rounding made of them.
    pub fn tells_mean(self, sum: i128, weight: i128) -> bool {
        let steps = (sum as f64 / weight as f64).abs();
        self.zero.abs() > 0.0 || steps >= f64::from(LEAST_MEAN_BITS).exp2()
    }

    /// The mean distance from the zero, stored unit.
    fn deviation(self, sum: i128, weight: i128) -> f64 {
        sum as f64 / weight as f64 / self.steps_per_value()
    }

    /// Standard deviation of the population, √(Σ w (x - m)² / Σ w), stored unit.
    pub fn std(self, squares: i128, sum: i128, weight: i128) -> f64 {
        let of_squares = squares as f64 / weight as f64 * self.unit() * self.unit()
            / f64::from(SQUARE_BITS).exp2();
        let mean = self.deviation(sum, weight);
        // Rounding may leave a constant a hair below zero.
        (of_squares - mean * mean).max(0.0).sqrt()
    }

    /// Do sums of squares tell this standard deviation, to a thousandth? Of values that differ by less it is mostly what rounding made of them.
    pub fn tells_std(self, std: f64) -> bool {
        std >= self.unit() * f64::from(-LEAST_STD_BITS).exp2()
    }
}

/// Counts values in steps of a scale.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Counter {
    zero: f64,
    steps_per_value: f64,
    squares_per_step: f64,
}

impl Counter {
    /// What [`Scale::steps`] and [`Scale::square_steps`] are of a value.
    #[inline]
    pub(crate) fn of(self, value: f32) -> [i64; 2] {
        let steps = (f64::from(value) - self.zero) * self.steps_per_value;
        [
            nearest(steps),
            nearest(steps * steps * self.squares_per_step),
        ]
    }
}

/// The nearest integer, halves to even; the number must lie below 2⁵¹.
#[inline]
pub fn nearest(number: f64) -> i64 {
    let bits = (number + MAGIC).to_bits() as i64;
    bits.wrapping_sub(MAGIC.to_bits() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_has_steps_far_below_what_is_stored() {
        for quantity in Quantity::ALL {
            let scale = Scale::of(quantity).unwrap();
            let (low, high) = quantity.plausible().into_inner();
            for value in [low, high, 0.5 * (low + high)] {
                assert!(scale.holds(value as f32), "{quantity:?}");
                let steps = (value - scale.zero) * scale.steps_per_value();
                assert!(steps.abs() <= f64::from(VALUE_BITS).exp2());
                let back = scale.mean(i128::from(nearest(steps)) * 3, 3);
                assert!((back - value).abs() <= high.abs() * 1e-13, "{quantity:?}");
            }
            assert!(!scale.holds(f32::INFINITY) && !scale.holds(f32::NAN));
            assert!(!scale.holds((scale.zero + 3.0 * scale.unit()) as f32));
        }
    }

    #[test]
    fn scales_of_values_hold_them_and_one_value_too() {
        for (low, high) in [
            (2.0, 3.0),
            (-7.5e-20, 1e-19),
            (5e8, 5e8),
            (0.0, 0.0),
            (-9.0, -8.0),
        ] {
            let scale = Scale::over((low, high));
            let json = serde_json::to_string(&scale).unwrap();
            assert_eq!(serde_json::from_str::<Scale>(&json).unwrap(), scale);
            for value in [low, high] {
                assert!(scale.holds(value as f32), "{low} {high}");
                let steps = nearest((value - scale.zero) * scale.steps_per_value());
                let back = scale.mean(steps.into(), 1);
                assert!(
                    (back - value).abs() <= 1e-12 * value.abs(),
                    "{value} {back}"
                );
            }
        }
        let all = Scale::of_all();
        assert!(all.holds(f32::MAX) && all.holds(f32::MIN) && !all.holds(f32::INFINITY));
    }

    #[test]
    fn numbers_round_to_the_nearest() {
        for number in [
            0.0,
            0.5,
            1.5,
            -2.5,
            0.499_999_999,
            1e15 + 0.25,
            -7.0e14,
            2.25e15,
        ] {
            assert_eq!(nearest(number), number.round_ties_even() as i64, "{number}");
        }
    }

    #[test]
    fn a_counter_counts_as_its_scale_does() {
        for quantity in Quantity::ALL {
            let scale = Scale::of(quantity).unwrap();
            let (low, high) = quantity.plausible().into_inner();
            for share in 0..50 {
                let value = (low + (high - low) * f64::from(share) / 49.0) as f32;
                let own = [scale.steps(value), scale.square_steps(value)];
                assert_eq!(scale.counter().of(value), own, "{quantity:?} {value}");
            }
        }
    }

    #[test]
    fn a_constant_has_no_deviation_and_two_values_have_theirs() {
        let scale = Scale::of(Quantity::SeaSurfaceTemperature).unwrap();
        let of = |values: &[f64]| {
            let (mut sum, mut squares) = (0, 0);
            for value in values {
                let steps = (value - scale.zero) * scale.steps_per_value();
                sum += i128::from(nearest(steps));
                squares += i128::from(nearest(steps * steps * Scale::squares_per_step()));
            }
            let count = values.len() as i128;
            (scale.mean(sum, count), scale.std(squares, sum, count))
        };
        let (mean, std) = of(&[290.0, 292.0]);
        assert!((mean - 291.0).abs() < 1e-9 && (std - 1.0).abs() < 1e-9);
        assert!(scale.tells_std(std));
        let (_mean, std) = of(&[271.25; 7]);
        assert!(std < 1e-4 && !scale.tells_std(std), "{std}");
    }

    #[test]
    fn means_of_few_steps_are_not_told_unless_their_zero_is_elsewhere() {
        let scale = Scale::of(Quantity::AccumulatedCarbon).unwrap();
        for (mean, is_told) in [(1.0, true), (-1e-3, true), (1e-6, false), (0.0, false)] {
            let sum = i128::from(nearest(mean * scale.steps_per_value())) * 7;
            assert_eq!(scale.tells_mean(sum, 7), is_told, "{mean}");
        }
        let kelvins = Scale::of(Quantity::SeaSurfaceTemperature).unwrap();
        assert!(kelvins.tells_mean(0, 7));
    }
}
