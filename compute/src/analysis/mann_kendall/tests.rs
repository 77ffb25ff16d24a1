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
    near(correction, 2.375_111_329_939_134_7, 1e-9);
    let found = mann_kendall(&SERIES, &detrended(&SERIES, 0.095)).unwrap();
    near(found.z, 3.197_155_020_290_662_5, 1e-9);
    near(found.p_value, 0.001_387_903_159_439_2, 1e-8);
    near(found.tau, 0.636_781_609_195_402_3, 1e-12);
    // Values that go against their next ones count as if they stood on their own.
    let to_and_fro: Vec<f64> = (0..30)
        .map(|i| [0.0, 2.0][i % 2] + 0.1 * i as f64)
        .collect();
    let found = mann_kendall(&to_and_fro, &detrended(&to_and_fro, 0.1)).unwrap();
    near(found.variance_correction, 1.0, 1e-15);
}

/// The same script.
#[test]
fn autocorrelation_takes_significance_away() {
    let found = mann_kendall(&SLOW, &detrended(&SLOW, 0.060_869_565_217)).unwrap();
    assert_eq!(found.score, 173);
    near(found.variance_correction, 5.377_692_310_401_308, 1e-9);
    near(found.z, 1.324_119_160_166_555_6, 1e-9);
    near(found.p_value, 0.185_463_473_168_971_6, 1e-8);
}

/// Noise that keeps much of itself from step to step has trends nearly as often as chance says; with what is found at every lag 17 and 24 of a
/// hundred of these had one.
#[test]
fn noise_that_goes_together_has_few_trends() {
    let mut state = 3_u64;
    let mut next = || {
        state = state.wrapping_mul(25_214_903_917).wrapping_add(11) & ((1 << 48) - 1);
        state as f64 / (1_u64 << 48) as f64
    };
    for (kept, least, most) in [(0.0, 10, 32), (0.3, 10, 36), (0.6, 10, 44), (0.8, 10, 48)] {
        let mut found = 0;
        for _ in 0..400 {
            let mut value = 0.0;
            let mut step = || {
                value = kept * value + (0..12).map(|_| next() - 0.5).sum::<f64>();
                value
            };
            let series: Vec<f64> = (0..290).map(|_| step()).skip(50).collect();
            let years: Vec<f64> = (0..240).map(f64::from).collect();
            let slope = crate::analysis::theil_sen::Slopes::of(&years, &series)
                .unwrap()
                .median();
            let test = mann_kendall(&series, &detrended(&series, slope)).unwrap();
            found += u32::from(test.p_value < 0.05);
        }
        assert!((least..most).contains(&found), "{kept}: {found} of 400");
    }
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
