use super::*;
use crate::analysis::reference::SERIES;

fn months(first_year: i32, count: u32) -> Vec<Period> {
    (0..count)
        .map(|m| Period::month(first_year + (m / 12) as i32, m % 12 + 1).unwrap())
        .collect()
}

/// By hand: January 1, 3, 8 has mean 4 and spread sqrt((9 + 1 + 16) / 2).
#[test]
fn months_have_their_mean_spread_and_count() {
    let periods = months(2001, 36);
    let mut values = vec![5.0; 36];
    (values[0], values[12], values[24]) = (1.0, 3.0, 8.0);
    values[13] = f64::NAN;
    let found = climatology(&periods, &values, CalendarBins::Month, None).unwrap();
    assert_eq!(found.base.to_string(), "2001/2003");
    let january = &found.rows[0];
    assert_eq!(
        (january.mean, january.spread),
        (Some(4.0), Some(13f64.sqrt()))
    );
    assert_eq!((found.rows[1].count, found.rows[1].years), (2, 2));
    let found = anomalies(&periods, &values, &found);
    assert_eq!(found.rows[24].anomaly, Some(4.0));
    assert_eq!(found.rows[24].standardised, Some(4.0 / 13f64.sqrt()));
    // No spread, no standardised anomaly; no data, none at all.
    assert_eq!(
        (found.rows[2].anomaly, found.rows[2].standardised),
        (Some(0.0), None)
    );
    assert_eq!(
        (found.rows[13].normal, found.rows[13].anomaly),
        (Some(5.0), None)
    );
}

#[test]
fn a_base_period_is_what_normals_are_taken_over_and_seasons_end_in_february() {
    let periods = months(2001, 36);
    let values: Vec<f64> = (0..36).map(f64::from).collect();
    let base = "2002/2002".parse().ok();
    let found = climatology(&periods, &values, CalendarBins::Season, base).unwrap();
    let means: Vec<f64> = found.rows.iter().map(|row| row.mean.unwrap()).collect();
    // January, February and December of 2002 are steps 12, 13 and 23.
    assert_eq!(means, [16.0, 15.0, 18.0, 21.0]);
    assert_eq!(
        anomalies(&periods, &values, &found).rows[0].anomaly,
        Some(-16.0)
    );
}

#[test]
fn what_has_no_climatology_is_refused_with_the_reason() {
    let periods = months(2001, 12);
    let values = [1.0; 12];
    let of = |values: &[f64], bins, base: Option<&str>| {
        let base = base.map(|base| base.parse().unwrap());
        climatology(&periods, values, bins, base)
            .unwrap_err()
            .to_string()
    };
    let nothing = of(&[f64::NAN; 12], CalendarBins::Month, None);
    assert_eq!(nothing, "no step holds data");
    let elsewhere = of(&values, CalendarBins::Month, Some("1991/2000"));
    assert_eq!(
        elsewhere,
        "no step with data lies in 1991/2000; the series covers 2001/2001"
    );
    let too_long = of(&values, CalendarBins::Day, None);
    assert!(
        too_long.contains("steps of 31 days have no day"),
        "{too_long}"
    );
    assert_eq!(
        climatology(&[], &[], CalendarBins::Month, None),
        Err(Undefined::NoData)
    );
    let one = climatology(&periods[..1], &[2.0], CalendarBins::Month, None).unwrap();
    assert_eq!((one.rows[0].mean, one.rows[0].spread), (Some(2.0), None));
    assert_eq!((one.rows[1].mean, one.rows[1].count), (None, 0));
}

#[test]
fn days_of_leap_years_lie_in_their_own_bins() {
    let day = |text: &str| {
        let start: contract::time::TimeMs = text.parse().unwrap();
        let end = contract::time::TimeMs::new(start.ms() + 86_400_000).unwrap();
        Period::new(start, end).unwrap()
    };
    let periods = ["2003-03-01", "2004-02-29", "2004-03-01"].map(day);
    let found = climatology(&periods, &[1.0, 2.0, 5.0], CalendarBins::Day, None).unwrap();
    assert_eq!(
        (found.rows[59].mean, found.rows[60].mean),
        (Some(2.0), Some(3.0))
    );
    assert_eq!((found.rows.len(), found.rows[60].years), (366, 2));
}

/// `tests/reference/series_statistics.py`.
#[test]
fn mean_and_spread_are_those_of_an_independent_library() {
    assert!((mean(&SERIES).unwrap() - 3.503_333_333_333_333).abs() < 1e-14);
    assert!((spread(&SERIES).unwrap() - 0.975_734_324_119_208).abs() < 1e-14);
    // Large means cost no digits.
    let shifted: Vec<f64> = SERIES.iter().map(|v| v + 1e6).collect();
    assert!((spread(&shifted).unwrap() - 0.975_734_324_119_208).abs() < 1e-9);
}

/// The mean of many equal values lies beside them by rounding: what is measured in spreads of that is not anything.
#[test]
fn equal_values_have_no_spread_whatever_they_are() {
    let freezing = f64::from(271.35f32) - 273.15;
    for value in [freezing, 0.1, -1e-17, 3e13, 0.0] {
        assert_eq!(spread(&[value; 840]), Some(0.0), "{value}");
    }
    let periods = months(1951, 840);
    let mut values = vec![freezing; 840];
    values[839] = -1.5;
    let base = "1951/2019".parse().ok();
    let normal = climatology(&periods, &values, CalendarBins::Month, base).unwrap();
    let found = anomalies(&periods, &values, &normal);
    let last = &found.rows[839];
    let anomaly = -1.5 - freezing;
    assert!((last.anomaly.unwrap() - anomaly).abs() < 1e-12, "{last:?}");
    assert_eq!(last.standardised, None);
}

#[test]
fn a_series_of_seasons_alone_leaves_nothing() {
    let periods = months(2001, 36);
    let mut values: Vec<f64> = (0..36).map(|m| f64::from(m % 12)).collect();
    values[7] = f64::NAN;
    let left = deseasonalised(&periods, &values);
    assert!(left[7].is_nan());
    assert!(
        left.iter()
            .enumerate()
            .all(|(m, v)| m == 7 || v.abs() < 1e-12)
    );
}
