use super::*;
use crate::analysis::reference::{OTHER, SERIES, near};

/// `tests/reference/series_statistics.py`.
#[test]
fn correlations_are_those_of_an_independent_library() {
    let rows = correlations(&SERIES, &OTHER, 3);
    assert_eq!(
        rows.iter().map(|r| r.lag_steps).collect::<Vec<_>>(),
        [-3, -2, -1, 0, 1, 2, 3]
    );
    for (index, count, r, effective, p) in [
        (
            0,
            27,
            0.213_372_220_274_124_1,
            11.616_130_355_766_101,
            0.514_202_400_773_813_1,
        ),
        (
            3,
            30,
            0.781_549_749_260_377_9,
            12.906_811_506_406_8,
            0.001_681_021_700_228_608_4,
        ),
        (
            4,
            29,
            0.856_850_008_790_639_3,
            12.476_584_456_193_22,
            0.000_264_476_573_004_581_2,
        ),
        (
            5,
            28,
            0.450_315_657_072_680_8,
            12.046_357_405_979_661,
            0.140_857_575_082_245_3,
        ),
    ] {
        let row = &rows[index];
        assert_eq!(row.count, count);
        near(row.correlation.unwrap(), r, 1e-12);
        near(row.effective_count.unwrap(), effective, 1e-12);
        near(row.p_value.unwrap(), p, 1e-8);
    }
}

#[test]
fn what_follows_is_found_at_its_lag_and_what_does_not_vary_has_none() {
    let mut later = vec![f64::NAN; 2];
    later.extend(&SERIES[..28]);
    let rows = correlations(&SERIES, &later, 4);
    let best = rows
        .iter()
        .max_by(|a, b| a.correlation.partial_cmp(&b.correlation).unwrap());
    let best = best.unwrap();
    assert_eq!((best.lag_steps, best.count), (2, 28));
    near(best.correlation.unwrap(), 1.0, 1e-12);
    assert_eq!(best.p_value, Some(0.0));
    let constant = correlations(&SERIES, &[1.0; 30], 0);
    assert_eq!((constant[0].correlation, constant[0].p_value), (None, None));
    let nothing = correlations(&SERIES, &[f64::NAN; 30], 40);
    assert!(
        nothing
            .iter()
            .all(|row| row.count == 0 && row.correlation.is_none())
    );
    assert!(correlations(&[], &[], 1).iter().all(|row| row.count == 0));
}

/// `tests/reference/series_statistics.py`.
#[test]
fn correlations_over_gaps_are_those_of_an_independent_library() {
    let without = |mut values: [f64; 30], gaps: &[usize]| {
        for at in gaps {
            values[*at] = f64::NAN;
        }
        values
    };
    let first = without(SERIES, &[3, 4, 17]);
    let second = without(OTHER, &[0, 9, 17, 28]);
    for (lag, count, r, effective, p) in [
        (
            -1,
            22,
            0.323_484_255_277_781_24,
            10.261_016_805_924_697,
            0.353_708_562_168_282_17,
        ),
        (
            0,
            24,
            0.744_891_889_190_348,
            11.193_836_515_554_215,
            0.007_816_738_755_573_84,
        ),
        (
            2,
            22,
            0.431_137_595_882_096_7,
            10.261_016_805_924_697,
            0.205_753_194_848_065_8,
        ),
    ] {
        let row = correlation_at(&first, &second, lag);
        assert_eq!((row.lag_steps, row.count), (lag, count));
        near(row.correlation.unwrap(), r, 1e-12);
        near(row.effective_count.unwrap(), effective, 1e-12);
        near(row.p_value.unwrap(), p, 1e-8);
        let all = correlations(&first, &second, 2);
        assert_eq!(all[(lag + 2) as usize], row);
    }
}

/// Thirty times a tenth is not three: the mean of equal values may lie beside them by rounding.
#[test]
fn equal_values_have_no_correlation_whatever_they_are() {
    let most = 0.1f64.next_up();
    let rounded: Vec<f64> = (0..30)
        .map(|at| if at % 3 == 0 { most } else { 0.1 })
        .collect();
    for equal in [vec![0.1; 30], vec![-1.7; 30], vec![0.0; 30], rounded] {
        assert_eq!(correlation_at(&SERIES, &equal, 0).correlation, None);
        assert_eq!(correlation_at(&equal, &SERIES, 1).p_value, None);
    }
    // What varies by little varies.
    let little: Vec<f64> = SERIES.iter().map(|value| 1e3 + 1e-6 * value).collect();
    near(
        correlation_at(&SERIES, &little, 0).correlation.unwrap(),
        1.0,
        1e-6,
    );
}

#[test]
fn why_there_is_no_correlation_is_told_at_each_lag() {
    let why = |first: &[f64], second: &[f64], max_lag: u32| -> Vec<Option<String>> {
        let rows = correlations(first, second, max_lag);
        rows.into_iter().map(|row| row.undefined).collect()
    };
    let told = |text: &str| Some(text.to_owned());
    let equal = [2.0; 30];
    let of_side = |count: usize, side: &str| {
        told(&format!(
            "all {count} values of {side} are equal: a correlation is not defined"
        ))
    };
    assert_eq!(
        why(&SERIES, &equal, 1),
        [29, 30, 29].map(|count| of_side(count, "the second series"))
    );
    assert_eq!(why(&equal, &SERIES, 0), [of_side(30, "the first series")]);
    assert_eq!(why(&equal, &equal, 0), [of_side(30, "either series")]);
    // At one lag alone: what varies lies beyond the other's end.
    let late = [1.0, 1.0, 1.0, 7.0];
    assert_eq!(
        why(&[1.0, 2.0, 4.0, 3.0], &late, 1),
        [of_side(3, "the second series"), None, None]
    );
    let few = told("a correlation of pairs needs 3 values, and there are 2");
    assert_eq!(why(&SERIES[..2], &OTHER[..2], 0), [few]);
}
