use super::*;
use crate::analysis::reference::{SERIES, near, steps};

/// `tests/reference/series_statistics.py`.
#[test]
fn slope_and_uncertainty_are_those_of_an_independent_library() {
    let found = least_squares(&steps(30), &SERIES, None).unwrap();
    near(found.slope_per_decade, 0.924_805_339_265_085, 1e-12);
    near(
        found.standard_error_per_decade.unwrap(),
        0.199_182_360_625_938_1,
        1e-12,
    );
    near(
        found.lower_per_decade.unwrap(),
        0.477_175_467_055_133_8,
        1e-8,
    );
    near(
        found.upper_per_decade.unwrap(),
        1.372_435_211_476_567_6,
        1e-8,
    );
    near(found.p_value.unwrap(), 0.001_079_581_179_414_189_7, 1e-8);
    near(found.lag1_autocorrelation, 0.449_042_122_085_043_9, 1e-12);
    near(found.effective_count, 11.406_663_812_964_451, 1e-12);
}

#[test]
fn a_line_is_found_whatever_is_missing() {
    let years: Vec<f64> = (0..40).map(|i| f64::from(i) / 12.0).collect();
    let mut values: Vec<f64> = years.iter().map(|x| 280.0 - 0.3 * x).collect();
    (values[3], values[17], values[39]) = (f64::NAN, f64::NAN, f64::NAN);
    let found = least_squares(&years, &values, None).unwrap();
    assert!((found.slope_per_decade + 3.0).abs() < 1e-10, "{found:?}");
    assert!(found.p_value.unwrap() < 1e-12);
    assert!(least_squares(&years, &[f64::NAN; 40], None).is_none());
    assert!(least_squares(&years[..2], &values[..2], None).is_none());
    assert!(least_squares(&[1.0; 5], &[1.0, 2.0, 3.0, 4.0, 5.0], None).is_none());
}

#[test]
fn values_that_all_go_together_leave_the_slope_without_an_uncertainty() {
    let years = steps(12);
    let values: Vec<f64> = years
        .iter()
        .map(|x| if *x < 6.0 { x * x } else { 36.0 + 3.0 * x })
        .collect();
    let found = least_squares(&years, &values, None).unwrap();
    assert!(found.effective_count < 12.0);
    let constant = least_squares(&years, &[2.0; 12], None).unwrap();
    assert!(constant.slope_per_decade.abs() < 1e-15);
    assert_eq!(constant.p_value, Some(1.0));
}
