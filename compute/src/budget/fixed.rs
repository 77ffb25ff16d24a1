//! Fixed-point masses, areas and columns of carbon: integers whose sums do not depend on the order of adding.

/// Decimals of a mass in kg: 1 µg, far below what any product resolves.
pub const MASS_DECIMALS: u32 = 9;
/// Decimals of an area in m².
pub const AREA_DECIMALS: u32 = 6;
/// Steps of a column of carbon in 1 kg m⁻²: 1e-15 kg m⁻², so that the whole ocean is off by less than 1 kg a step.
pub const COLUMN_STEPS_PER_KG_M2: f64 = 1e15;

/// Largest size of one cell's share, in steps: 2^100 leaves room for 2^27 of them in an `i128`.
const LIMIT_STEPS: f64 = (1u128 << 100) as f64;
/// Below this size a share goes through `i64`, which is much cheaper than `i128`.
const SMALL_STEPS: f64 = (1u64 << 62) as f64;

/// A value that no sum may take: not finite, or larger than anything physical.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("a cell's share is {0}, beyond anything physical")]
pub struct OutOfRange(pub f64);

/// The largest number below one half: added to a number with its sign and cut to an integer, it rounds as `round` does
/// (halves away from zero, and 0.499... to 0), without the call to the mathematical library that `round` is.
const BELOW_HALF: f64 = 0.499_999_999_999_999_94;

/// The nearest integer of a number of steps, halves away from zero.
#[inline]
pub fn to_steps(steps: f64) -> Result<i128, OutOfRange> {
    if steps.abs() < SMALL_STEPS {
        Ok(i128::from((steps + BELOW_HALF.copysign(steps)) as i64))
    } else if steps.abs() < LIMIT_STEPS {
        Ok(steps as i128) // so large that it is an integer
    } else {
        Err(OutOfRange(steps)) // NaN comes here too: it is below nothing
    }
}

/// What of a value lies from `start` to `end` of its `whole` time: shares of parts that follow each other sum to the whole, to the
/// bit. None if a product leaves an `i128`.
pub fn share_between(value: i128, start: i64, end: i64, whole: i64) -> Option<i128> {
    share(value, end, whole)?.checked_sub(share(value, start, whole)?)
}

/// `value * part / whole` to the nearest integer, halves away from zero; none if the product leaves an `i128`.
pub fn share(value: i128, part: i64, whole: i64) -> Option<i128> {
    if part == whole {
        return Some(value);
    }
    let (product, whole) = (value.checked_mul(i128::from(part))?, i128::from(whole));
    let half = if product < 0 { -(whole / 2) } else { whole / 2 };
    Some((product + half) / whole)
}

/// An integer of `decimals` decimals as plain text, such as `-1404.000000001`.
pub fn decimal_text(value: i128, decimals: u32) -> String {
    let scale = 10u128.pow(decimals);
    let (whole, rest) = (value.unsigned_abs() / scale, value.unsigned_abs() % scale);
    let sign = if value < 0 { "-" } else { "" };
    format!("{sign}{whole}.{rest:0width$}", width = decimals as usize)
}

/// The integer of such a text; none of any other.
pub fn steps_of_text(text: &str, decimals: u32) -> Option<i128> {
    let (whole, rest) = text.split_once('.')?;
    if rest.len() != decimals as usize || !rest.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    format!("{whole}{rest}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_read_as_it_is_written() {
        for value in [0, 7, -5, 1_000_000_001, i128::MIN + 1, i128::MAX] {
            assert_eq!(steps_of_text(&decimal_text(value, 9), 9), Some(value));
        }
        for bad in ["", "1", "1.5", "1.12345678a", "x.123456789", "1.+23456789"] {
            assert_eq!(steps_of_text(bad, 9), None, "{bad}");
        }
    }

    #[test]
    fn steps_round_to_the_nearest_and_refuse_nonsense() {
        assert_eq!(to_steps(2.5), Ok(3));
        assert_eq!(to_steps(-2.5), Ok(-3));
        assert_eq!(to_steps(1e25), Ok(10_000_000_000_000_000_905_969_664)); // the f64 next to 1e25
        for bad in [f64::NAN, f64::INFINITY, 1e40] {
            assert!(to_steps(bad).is_err());
        }
    }

    #[test]
    fn rounding_is_that_of_the_mathematical_library() {
        let mut numbers = vec![0.0, 0.5, 0.499_999_999_999_999_94, 0.500_000_000_000_000_1];
        for exponent in 0..100 {
            let power = 2f64.powi(exponent);
            for beside in [power, power.next_down(), power.next_up()] {
                let halves = [0.5, 0.5f64.next_down(), 0.5f64.next_up(), 0.25, 0.75];
                numbers.extend(halves.map(|half| beside + half));
                numbers.push(beside);
            }
        }
        let mut random = 1u64;
        for _ in 0..100_000 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let mantissa = (random >> 11) as f64 / (1u64 << 53) as f64;
            numbers.push(mantissa * 2f64.powi((random % 70) as i32));
        }
        for number in numbers.iter().flat_map(|&number| [number, -number]) {
            assert_eq!(to_steps(number), Ok(number.round() as i128), "{number:e}");
        }
    }

    #[test]
    fn shares_round_to_the_nearest() {
        assert_eq!(share(10, 1, 3), Some(3));
        assert_eq!(share(20, 1, 3), Some(7));
        assert_eq!(share(-20, 1, 3), Some(-7));
        assert_eq!(share(i128::MAX, 5, 5), Some(i128::MAX));
        assert_eq!(share(i128::MAX, 2, 3), None);
    }

    #[test]
    fn parts_that_follow_each_other_sum_to_the_whole() {
        for value in [1, -1, 5, 10, -20, 1_234_567_890_123] {
            let cuts = [0, 1, 2, 5, 6, 7];
            let parts = cuts
                .windows(2)
                .map(|cut| share_between(value, cut[0], cut[1], 7).unwrap());
            assert_eq!(parts.sum::<i128>(), value);
        }
    }

    #[test]
    fn text_keeps_sign_and_zeros() {
        assert_eq!(decimal_text(-1_000_000_001, 9), "-1.000000001");
        assert_eq!(decimal_text(-5, 2), "-0.05");
        assert_eq!(decimal_text(0, 3), "0.000");
    }
}
