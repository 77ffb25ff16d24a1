use super::*;
use crate::analysis::reference::{SERIES, near, steps};

/// `tests/reference/series_statistics.py`.
#[test]
fn slopes_and_intervals_are_those_of_an_independent_library() {
    for held_at_most in [HELD_AT_MOST, 0] {
        let years = steps(30);
        let slopes = Slopes::held_at_most(&years, &SERIES, held_at_most).unwrap();
        near(slopes.median(), 0.095, 1e-12);
        let (lower, upper) = slopes.interval(1.0);
        near(lower, 0.068_421_052_631_578_97, 1e-12);
        near(upper, 0.119_999_999_999_999_98, 1e-12);
    }
    let here: Vec<usize> = (0..30).filter(|i| ![3, 4, 17].contains(i)).collect();
    let years: Vec<f64> = here.iter().map(|i| *i as f64).collect();
    let values: Vec<f64> = here.iter().map(|i| SERIES[*i]).collect();
    let slopes = Slopes::of(&years, &values).unwrap();
    near(slopes.median(), 0.083_333_333_333_333_33, 1e-12);
    let (lower, upper) = slopes.interval(1.0);
    near(lower, 0.056_000_000_000_000_015, 1e-12);
    near(upper, 0.115_384_615_384_615_42, 1e-12);
}

#[test]
fn a_line_with_a_few_wild_values_keeps_its_slope() {
    let years = steps(200);
    let mut values: Vec<f64> = years.iter().map(|x| 2.0 + 0.25 * x).collect();
    for i in (0..200).step_by(9) {
        values[i] = 1e6;
    }
    let slopes = Slopes::of(&years, &values).unwrap();
    assert!((slopes.median() - 0.25).abs() < 1e-9);
    // What goes together has a wider interval.
    let thirty = steps(30);
    let (lower, upper) = Slopes::of(&thirty, &SERIES).unwrap().interval(3.0);
    assert!(lower < 0.0684 && upper > 0.12, "{lower} {upper}");
    assert!(Slopes::of(&[1.0], &[1.0]).is_none());
    assert!(Slopes::of(&[1.0, 1.0], &[1.0, 2.0]).is_none());
    let constant = [4.0; 200];
    let constant = Slopes::of(&years, &constant).unwrap();
    assert!(constant.median().abs() < 1e-15 && constant.interval(1.0).1.abs() < 1e-15);
}

/// Daily values of 16 years: 17 million pairs, 1.5 MiB of counts.
#[test]
fn seventeen_million_pairs_are_selected_from() {
    let years: Vec<f64> = (0..5844).map(|day| f64::from(day) / 365.25).collect();
    let values: Vec<f64> = (0..5844u32)
        .map(|day| {
            0.1 * years[day as usize] + f64::from(day.wrapping_mul(2_654_435_761) >> 8) / 1e8
        })
        .collect();
    let slopes = Slopes::of(&years, &values).unwrap();
    assert_eq!(slopes.count, 17_073_246);
    let median = slopes.median();
    // As many lie above as below, those that equal it aside.
    let below = slopes.each().filter(|slope| *slope < median).count();
    let above = slopes.each().filter(|slope| *slope > median).count();
    let half = slopes.count / 2;
    assert!(
        below <= half && above <= half && below + above < slopes.count,
        "{below} {above}"
    );
    assert!(half - below < 100 && half - above < 100, "{below} {above}");
}
