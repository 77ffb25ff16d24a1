use super::*;
use crate::analysis::reference::near;

/// Months of 2001 to 2004 as `tests/reference/series_statistics.py` makes them.
fn months() -> (Vec<Period>, Vec<f64>) {
    const NOISE: [f64; 7] = [0.3, -0.2, 0.1, -0.4, 0.25, -0.05, 0.0];
    let periods: Vec<Period> = (0..48)
        .map(|m| Period::month(2001 + m / 12, (m % 12) as u32 + 1).unwrap())
        .collect();
    let middle = 0.5 * (periods[0].start.ms() + periods[47].end.ms()) as f64;
    let value = |(m, period): (usize, &Period)| {
        let [c1, s1] = wave_over(*period, 1.0);
        let [c2, s2] = wave_over(*period, 2.0);
        let middle_of = 0.5 * (period.start.ms() + period.end.ms()) as f64;
        let line = 0.2 * (middle_of - middle) / YEAR_MS;
        10.0 + line + 3.0 * c1 + 4.0 * s1 - 0.5 * c2 + 1.2 * s2 + NOISE[m % 7]
    };
    let mut values: Vec<f64> = periods.iter().enumerate().map(value).collect();
    for gap in [5, 6, 20] {
        values[gap] = f64::NAN;
    }
    (periods, values)
}

/// What numpy's `lstsq` gives.
#[test]
fn waves_are_those_of_an_independent_library() {
    let (periods, values) = months();
    let found = season(&periods, &values).unwrap();
    assert!(found.has_trend);
    near(found.annual.amplitude, 4.992_877_980_778_687, 1e-9);
    near(found.annual.highest_after_days, 53.953_542_997_474_8, 1e-9);
    near(found.semi_annual.amplitude, 1.286_592_542_369_639_2, 1e-9);
    near(
        found.semi_annual.highest_after_days,
        56.604_663_779_402_23,
        1e-9,
    );
    near(found.mean, 10.002_677_003_576_613, 1e-9);
    near(found.explained_percent, 99.542_632_713_579_04, 1e-9);
    near(found.residual_spread, 0.240_044_674_846_296_82, 1e-9);
    assert_eq!(found.count, 45);
}

/// The wave is highest on 2 April, and no step is as long as the next one.
#[test]
fn steps_of_any_length_give_the_wave_that_made_them() {
    let mut start = 946_684_800_000i64;
    let periods: Vec<Period> = (0..40)
        .map(|i| {
            let end = start + (5 + i * 7 % 40) * 86_400_000;
            let period = Period::new(
                contract::time::TimeMs::new(start).unwrap(),
                contract::time::TimeMs::new(end).unwrap(),
            );
            start = end;
            period.unwrap()
        })
        .collect();
    let values: Vec<f64> = periods
        .iter()
        .map(|p| 290.0 + 2.5 * wave_over(*p, 1.0)[1])
        .collect();
    let found = season(&periods, &values).unwrap();
    near(found.annual.amplitude, 2.5, 1e-9);
    near(found.annual.highest_after_days, 365.25 / 4.0, 1e-9);
    assert!(found.semi_annual.amplitude < 1e-9);
    // A wave's mean over a month is flatter than the wave: 1 - sin(h) / h with h half of a twelfth of a turn.
    let month = Period::month(2001, 1).unwrap();
    let [cosine, sine] = wave_over(month, 1.0);
    near(cosine.hypot(sine), 0.988_2, 1e-3);
}

/// Of what lies in a part of the year alone, every year the same, noise makes any amplitude.
#[test]
fn a_season_of_a_part_of_the_year_is_none() {
    let all: Vec<Period> = (0..120)
        .map(|m| Period::month(2001 + m / 12, (m % 12) as u32 + 1).unwrap())
        .collect();
    let of_months = |held: std::ops::Range<usize>| {
        let value = |m: usize| {
            let wave = 0.5 * ((m % 12) as f64 / 12.0 * std::f64::consts::TAU).cos();
            if held.contains(&(m % 12)) {
                wave + ((m * m) % 7) as f64 * 0.05
            } else {
                f64::NAN
            }
        };
        (0..120).map(value).collect::<Vec<f64>>()
    };
    for held in [0..4, 3..9, 2..9, 2..10] {
        let why = season(&all, &of_months(held)).unwrap_err().to_string();
        assert!(why.contains("too few parts of the year"), "{why}");
    }
    // Winters alone, over New Year.
    let mut winters = of_months(0..12);
    for m in (0..120).filter(|m| (4..9).contains(&(m % 12))) {
        winters[m] = f64::NAN;
    }
    assert!(season(&all, &winters).is_err());
    for held in [0..12, 0..9, 3..12] {
        let amplitude = season(&all, &of_months(held)).unwrap().annual.amplitude;
        assert!((amplitude - 0.5).abs() < 0.1, "{amplitude}");
    }
}

#[test]
fn what_has_no_season_is_refused_with_the_reason() {
    let (periods, values) = months();
    let refused =
        |periods: &[Period], values: &[f64]| season(periods, values).unwrap_err().to_string();
    assert_eq!(
        refused(&periods, &[f64::NAN; 48]),
        "a season needs 8 values, and there are 0"
    );
    let short = refused(
        &periods[..9],
        &[1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0],
    );
    assert!(
        short.contains("0.9 years of values, and they span 0.7"),
        "{short}"
    );
    assert!(refused(&periods, &[4.0; 48]).contains("all 48 values are equal"));
    let years: Vec<Period> = (0..48).map(|y| Period::year(1950 + y).unwrap()).collect();
    assert!(refused(&years, &values).contains("366 days"));
    // One month of each year says nothing of the others.
    let mut decembers = vec![f64::NAN; 480];
    let periods: Vec<Period> = (0..480u32)
        .map(|m| Period::month(1950 + (m / 12) as i32, m % 12 + 1).unwrap())
        .collect();
    for year in 0..40 {
        decembers[year * 12 + 11] = f64::from(year as u32 % 5);
    }
    assert!(refused(&periods, &decembers).contains("too few parts of the year"));
    // One year has no line beside its wave.
    let one = season(&periods[..12], &values[24..36]).unwrap();
    assert!(!one.has_trend);
}
