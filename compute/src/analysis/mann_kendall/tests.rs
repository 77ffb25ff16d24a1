use super::*;
use crate::analysis::reference::{SERIES, SLOW, near};

fn detrended(values: &[f64], slope: f64) -> Vec<f64> {
    let less = |(i, v): (usize, &f64)| v - slope * i as f64;
    values.iter().enumerate().map(less).collect()
}

/// `tests/reference/series_statistics.py`.
#[test]
fn scores_and_variances_are_those_of_an_independent_library() {
    assert_eq!(score(&SERIES), 277);
    near(score_variance(&SERIES), 3_137.666_666_666_666_5, 1e-12);
    let correction = variance_correction(&detrended(&SERIES, 0.095));
    near(correction, 0.493_565_483_268_218_25, 1e-9);
    // Those values seem to go against their next ones; they count as if they stood on their own.
    let found = mann_kendall(&SERIES, &detrended(&SERIES, 0.095)).unwrap();
    near(found.variance_correction, 1.0, 1e-15);
    near(found.z, 4.927_262_274_717_066, 1e-12);
    near(found.p_value, 8.338_978_652_044_915e-7, 1e-6);
    near(found.tau, 0.636_781_609_195_402_3, 1e-12);
}

/// The same script.
#[test]
fn autocorrelation_takes_significance_away() {
    let found = mann_kendall(&SLOW, &detrended(&SLOW, 0.060_869_565_217_391_3)).unwrap();
    assert_eq!(found.score, 173);
    near(found.variance_correction, 3.062_138_226_929_757_7, 1e-9);
    near(found.z, 1.754_739_487_833_271_8, 1e-9);
    near(found.p_value, 0.079_303_878_351_921_72, 1e-8);
}

#[test]
fn too_few_equal_and_too_many_values_are_refused_with_the_reason() {
    let refused = |values: &[f64]| mann_kendall(values, values).unwrap_err().to_string();
    let mut few = vec![f64::NAN; 40];
    few[..9].copy_from_slice(&SERIES[..9]);
    assert_eq!(
        refused(&few),
        "a test for a trend needs 10 values, and there are 9"
    );
    assert_eq!(
        refused(&[1.0; 20]),
        "all 20 values are equal: a test for a trend is not defined"
    );
    let many: Vec<f64> = (0..=MOST_VALUES).map(|i| i as f64).collect();
    assert!(refused(&many).contains("of at most 12000"));
}

#[test]
fn gaps_leave_the_score_of_the_rest_and_wander_no_less() {
    let mut gaps = SLOW.to_vec();
    (gaps[4], gaps[12], gaps[13]) = (f64::NAN, f64::NAN, f64::NAN);
    let present: Vec<f64> = gaps.iter().copied().filter(|v| !v.is_nan()).collect();
    let found = mann_kendall(&gaps, &detrended(&gaps, 0.06)).unwrap();
    assert_eq!(found.score, score(&present));
    assert!(found.variance_correction > 2.0, "{found:?}");
}
