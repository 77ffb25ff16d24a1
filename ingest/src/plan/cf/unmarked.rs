//! Numbers that mean no data in many files, and of which this file says nothing. What a built-in quantity can be tells them
//! from values; of any other variable they must be told by where they stand.

use contract::event::RejectReason;

use crate::error::Rejection;

/// Numbers that people write for no data.
const USUAL: [f64; 18] = [
    -1e20, -1e10, -99_999.0, -32_768.0, -32_767.0, -9_999.9, -9_999.0, -999.9, -999.0, -128.0,
    255.0, 999.0, 9_999.0, 32_767.0, 65_535.0, 99_999.0, 1e10, 1e20,
];
/// How near in float32 a number is the one that was meant.
const SAME: f64 = 1e-6;

/// Refuses values of which one usual number for no data, several times there, lies further from all others than these
/// from each other.
///
/// `values`: stored numbers that are not said to be no data; NaN is passed over.
#[expect(clippy::float_cmp, reason = "a number for no data is one exact number")]
pub(crate) fn check(variable: &str, values: &[f64]) -> Result<(), Rejection> {
    let (lowest, highest, _) = range(values, f64::NAN);
    for end in [lowest, highest] {
        let is_usual = USUAL
            .iter()
            .any(|usual| (end - usual).abs() <= SAME * usual.abs());
        if !is_usual {
            continue;
        }
        let (low, high, count) = range(values, end);
        let there = values.iter().filter(|value| **value == end).count();
        let gap = (low - end).max(end - high);
        if count > 0 && there > 1 && gap > high - low {
            let detail = format!(
                "has {there} cells of {end} and all others are {low} to {high}, but no _FillValue or missing_value says that it means no data; say fill_values = [{end}] in a profile, or [] if it is a value"
            );
            return Err(Rejection::new(RejectReason::Values, variable, detail));
        }
    }
    Ok(())
}

/// Lowest and highest number but one, and how many there are.
#[expect(clippy::float_cmp, reason = "one exact number is left out")]
fn range(values: &[f64], without: f64) -> (f64, f64, usize) {
    let others = values.iter().filter(|v| !v.is_nan() && **v != without);
    others.fold(
        (f64::INFINITY, f64::NEG_INFINITY, 0),
        |(low, high, count), v| (low.min(*v), high.max(*v), count + 1),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_for_no_data_that_nothing_marks_is_seen_by_its_distance() {
        for fill in [-999.0, f64::from(-999.9f32), 1e20, 255.0] {
            let refused = check("v", &[1.0, fill, 4.0, fill, f64::NAN]).unwrap_err();
            assert!(refused.to_string().contains("fill_values"), "{refused}");
        }
    }

    #[test]
    fn numbers_among_others_single_ones_and_unusual_ones_are_values() {
        for values in [
            vec![-2000.0, -999.0, -999.0, 500.0],
            vec![-999.0, -999.0, 500.0, -400.0],
            vec![1.0, 4.0, -999.0],
            vec![1.0, 4.0, 90.0, 90.0],
            vec![-999.0, -999.0],
            vec![],
            vec![f64::NAN],
        ] {
            check("v", &values).unwrap();
        }
    }
}
