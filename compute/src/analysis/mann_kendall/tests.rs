use super::*;
use crate::analysis::reference::{SERIES, SLOW, near};

fn detrended(values: &[f64], slope: f64) -> Vec<f64> {
    let less = |(i, v): (usize, &f64)| v - slope * i as f64;
    values.iter().enumerate().map(less).collect()
}

/// `tests/reference/series_statistics.py`.
#[test]
fn scores_and_variances_are_those_of_an_independent_library() {
    assert_eq!(score(&SERIES, 0.0), 277);
    near(score_variance(&SERIES, 0.0), 3_137.666_666_666_666_5, 1e-12);
    let correction = variance_correction(&detrended(&SERIES, 0.095), 0.0);
    near(correction, 2.375_111_329_939_134_7, 1e-9);
    let found = mann_kendall(&SERIES, &detrended(&SERIES, 0.095), 0.0).unwrap();
    near(found.z, 3.197_155_020_290_662_5, 1e-9);
    near(found.p_value, 0.001_387_903_159_439_2, 1e-8);
    near(found.tau, 0.636_781_609_195_402_3, 1e-12);
    // Values that go against their next ones count as if they stood on their own.
    let to_and_fro: Vec<f64> = (0..30)
        .map(|i| [0.0, 2.0][i % 2] + 0.1 * i as f64)
        .collect();
    let found = mann_kendall(&to_and_fro, &detrended(&to_and_fro, 0.1), 0.0).unwrap();
    near(found.variance_correction, 1.0, 1e-15);
}

/// The same script.
#[test]
fn autocorrelation_takes_significance_away() {
    let found = mann_kendall(&SLOW, &detrended(&SLOW, 0.060_869_565_217), 0.0).unwrap();
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
            let test = mann_kendall(&series, &detrended(&series, slope), 0.0).unwrap();
            found += u32::from(test.p_value < 0.05);
        }
        assert!((least..most).contains(&found), "{kept}: {found} of 400");
    }
}

#[test]
fn too_few_equal_and_too_many_values_are_refused_with_the_reason() {
    let refused = |values: &[f64]| mann_kendall(values, values, 0.0).unwrap_err().to_string();
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
    let found = mann_kendall(&gaps, &detrended(&gaps, 0.06), 0.0).unwrap();
    assert_eq!(found.score, score(&present, 0.0));
    assert!(found.variance_correction > 2.0, "{found:?}");
}

/// Of the same values in kelvins and in degrees Celsius, whose means are rounded at other digits.
#[test]
fn values_that_rounding_alone_tells_apart_are_equal() {
    // Many are equal once a line is taken off.
    let celsius = |i: usize| [4.3, 1.1, 2.7, 0.9, 3.3][i % 5] + 0.1 * (i / 5) as f64;
    let of = |offset: f64, rounding: f64| {
        let values: Vec<f64> = (0..20).map(|i| celsius(i) + offset).collect();
        let mean = values.iter().sum::<f64>() / 20.0;
        let less: Vec<f64> = values.iter().map(|value| value - mean).collect();
        mann_kendall(&less, &detrended(&less, 0.02), rounding).unwrap()
    };
    let (kelvins, celsius) = (of(273.15, 1e-9), of(0.0, 1e-9));
    assert_eq!(kelvins, celsius);
    let spaced: Vec<f64> = (0..20).map(|i| f64::from(i / 2)).collect();
    let shaken: Vec<f64> = (0..20)
        .map(|i| f64::from(i / 2) + f64::from(i % 2) * 1e-13)
        .collect();
    assert_eq!(score(&shaken, 1e-12), score(&spaced, 0.0));
    assert_eq!(ranks(&shaken, 1e-12), ranks(&spaced, 0.0));
    near(
        score_variance(&shaken, 1e-12),
        score_variance(&spaced, 0.0),
        1e-15,
    );
    assert_eq!(score(&shaken, 0.0), score(&spaced, 0.0) + 10);
}
