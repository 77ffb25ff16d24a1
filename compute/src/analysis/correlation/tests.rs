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
