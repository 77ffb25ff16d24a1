use super::*;
use crate::analysis::reference::{SLOW, near};

fn months(count: u32) -> Vec<Period> {
    (0..count)
        .map(|m| Period::month(2001 + (m / 12) as i32, m % 12 + 1).unwrap())
        .collect()
}

/// A season of ten units and 0.3 a decade.
fn rising(count: u32) -> Vec<f64> {
    (0..count)
        .map(|m| 15.0 + 10.0 * f64::from(m % 12) + 0.03 * f64::from(m / 12))
        .collect()
}

#[test]
fn seasons_are_taken_off_before_slopes_are_sought() {
    // Ten years and a half: the warm half once more.
    let found = trend(&months(126), &rising(126), TimeStep::Month, "°C").unwrap();
    assert!(found.deseasonalised && found.step == TimeStep::Month);
    assert_eq!(
        (found.slope_unit.as_str(), found.count),
        ("°C per decade", 126)
    );
    // What rises in steps of a year is a line and a season.
    near(found.theil_sen.slope_per_decade, 0.3, 1e-3);
    near(found.least_squares.slope_per_decade, 0.3, 1e-3);
    // In steps of a year values go together: of those of a year none is one of its own.
    let test = &found.mann_kendall;
    assert!(test.p_value < 0.01 && test.tau > 0.8, "{test:?}");
    let yearly = trend(&months(120), &rising(120), TimeStep::Year, "").unwrap();
    assert_eq!(
        (yearly.count, yearly.slope_unit.as_str()),
        (10, "per decade")
    );
    assert!(!yearly.deseasonalised);
    near(yearly.theil_sen.slope_per_decade, 0.3, 1e-3);
    near(yearly.theil_sen.at_mid, yearly.mean, 1e-3);
}

/// Seasons are what months are: their means are taken off, and a season that begins or ends early is no trend.
#[test]
fn means_of_seasons_are_taken_off_too() {
    let years = middles_years(&months(126));
    let wave = |m: usize| 6.0 * ((m % 12) as f64 / 12.0 * std::f64::consts::TAU).cos();
    let of = |rise: f64| -> Vec<f64> { (0..126).map(|m| wave(m) + rise * years[m]).collect() };
    for rise in [0.0, 0.05] {
        let noise = |m: usize| ((m * 7) % 11) as f64 * 1e-3;
        let values: Vec<f64> = of(rise)
            .iter()
            .enumerate()
            .map(|(m, v)| v + noise(m))
            .collect();
        let found = trend(&months(126), &values, TimeStep::Season, "K").unwrap();
        assert!(found.deseasonalised && found.step == TimeStep::Season);
        let (by_rank, by_squares) = (
            found.theil_sen.slope_per_decade,
            found.least_squares.slope_per_decade,
        );
        for slope in [by_rank, by_squares] {
            assert!((slope - 10.0 * rise).abs() < 0.02, "{slope} {rise}");
        }
    }
    // Years of which a half is missing have no mean: the season would be a trend.
    let found = trend(&months(126), &of(0.0), TimeStep::Year, "K").unwrap();
    assert_eq!(found.count, 10);
    assert!(
        found.least_squares.slope_per_decade.abs() < 0.05,
        "{found:?}"
    );
}

/// Means of months take nothing of a line, however few years there are, and whichever months are missing.
#[test]
fn a_line_under_a_season_is_found_as_it_is() {
    for (count, gaps) in [(60, 0), (60, 7), (72, 0), (192, 5)] {
        let periods = months(count);
        let years = middles_years(&periods);
        let value = |(m, year): (usize, &f64)| {
            let is_missing = gaps > 0 && m % gaps == 3;
            let season = [
                3.0, -1.0, 0.5, 9.0, 2.0, 2.0, -7.0, 1.0, 0.0, 4.0, 5.0, -2.0,
            ][m % 12];
            // Noise that a line and twelve means know nothing of is not wanted here.
            if is_missing {
                f64::NAN
            } else {
                season - 0.4 * year
            }
        };
        let values: Vec<f64> = years.iter().enumerate().map(value).collect();
        let found = trend(&periods, &values, TimeStep::Month, "").unwrap();
        near(found.least_squares.slope_per_decade, -4.0, 1e-9);
        near(found.theil_sen.slope_per_decade, -4.0, 1e-9);
        let means: f64 = values.iter().filter(|v| !v.is_nan()).sum::<f64>() / found.count as f64;
        near(found.mean, means, 1e-9);
    }
}

/// Noise has no trend, however many values are missing: about as often one by chance as it says.
#[test]
fn noise_has_trends_as_often_as_chance_says() {
    let mut state = 11_u64;
    let mut next = || {
        state = state.wrapping_mul(25_214_903_917).wrapping_add(11) & ((1 << 48) - 1);
        state as f64 / (1_u64 << 48) as f64
    };
    for (count, kept) in [(60, 1.0), (60, 0.4), (120, 0.5), (240, 0.12)] {
        let periods = months(count);
        let steps = TrendSteps::of(&periods, TimeStep::Month);
        let (mut tested, mut by_rank, mut by_squares) = (0, 0, 0);
        for _ in 0..400 {
            let mut value = || {
                let noise: f64 = (0..12).map(|_| next()).sum();
                if next() <= kept { noise } else { f64::NAN }
            };
            let values: Vec<f64> = (0..count).map(|_| value()).collect();
            let Ok(found) = steps.trend(&values, "") else {
                continue;
            };
            tested += 1;
            by_rank += u32::from(found.mann_kendall.p_value < 0.05);
            by_squares += u32::from(found.least_squares.p_value.is_some_and(|p| p < 0.05));
        }
        assert!(tested > 100, "{count} {kept}: {tested}");
        let most = tested / 8;
        assert!(
            by_rank < most && by_squares < most,
            "{count} {kept}: {by_rank} {by_squares} of {tested}"
        );
        assert!(
            by_rank > tested / 100,
            "{count} {kept}: {by_rank} of {tested}"
        );
    }
    // Thirteen values in twelve months lie on a line whatever they are.
    let few: Vec<f64> = (0..60)
        .map(|m| if m < 12 || m == 59 { next() } else { f64::NAN })
        .collect();
    let refused = trend(&months(60), &few, TimeStep::Month, "").unwrap_err();
    assert_eq!(
        refused.to_string(),
        "a trend beside a season needs 15 values, and there are 13"
    );
}

#[test]
fn steps_longer_than_months_are_taken_as_they_are() {
    let years: Vec<Period> = (0..30).map(|y| Period::year(1980 + y).unwrap()).collect();
    let found = trend(&years, &SLOW, TimeStep::Month, "m").unwrap();
    assert!(found.step == TimeStep::Native && !found.deseasonalised);
    near(
        found.theil_sen.slope_per_decade,
        0.608_695_652_173_913,
        1e-3,
    );
    near(found.mann_kendall.p_value, 0.1880, 1e-2);
    // Its interval is the wider one of values that go together.
    assert!(found.theil_sen.lower_per_decade < 0.0 && found.theil_sen.upper_per_decade > 1.0);
    // Its residuals wander so that fewer than two of them are worth one of their own: nothing is said.
    assert!(found.least_squares.effective_count < 2.0, "{found:?}");
    assert_eq!(found.least_squares.p_value, None);
}

#[test]
fn what_has_no_trend_is_refused_with_the_reason() {
    let refused = |count: u32, values: &[f64], step| {
        trend(&months(count), values, step, "")
            .unwrap_err()
            .to_string()
    };
    let short = refused(48, &rising(48), TimeStep::Month);
    assert_eq!(short, "a trend needs 5 years of values, and they span 4.0");
    assert_eq!(
        refused(60, &[f64::NAN; 60], TimeStep::Month),
        "a trend needs 10 values, and there are 0"
    );
    assert_eq!(
        refused(60, &rising(60), TimeStep::Year),
        "a trend needs 10 values, and there are 5"
    );
    assert!(refused(60, &[3.0; 60], TimeStep::Month).contains("all 60 values are equal"));
    let mut one = vec![f64::NAN; 60];
    one[3] = 1.0;
    assert_eq!(
        refused(60, &one, TimeStep::Month),
        "a trend needs 10 values, and there are 1"
    );
    // Five years are enough, also where the last month is missing.
    let mut five = rising(60);
    five[59] = f64::NAN;
    assert!(trend(&months(60), &five, TimeStep::Month, "").is_ok());
    // Seasons alone, and nothing else: no trend, and nothing to tell it from.
    let seasons: Vec<f64> = (0..72).map(|m| f64::from(m % 12)).collect();
    assert!(refused(72, &seasons, TimeStep::Month).contains("equal"));
}

#[test]
fn parts_of_a_trend_are_those_of_the_whole_of_series_that_share_their_steps() {
    let periods = months(96);
    let steps = TrendSteps::of(&periods, TimeStep::Month);
    for seed in 0..5 {
        let value = |m: usize| rising(96)[m] + ((m * (7 + seed)) % 11) as f64 * 0.3;
        let mut values: Vec<f64> = (0..96).map(value).collect();
        for gap in (seed..96).step_by(9).take(4 * seed) {
            values[gap] = f64::NAN;
        }
        let whole = trend(&periods, &values, TimeStep::Month, "").unwrap();
        assert_eq!(steps.trend(&values, "").unwrap(), whole);
        let (slope, test) = steps.tested_slope(&values).unwrap();
        assert_eq!(
            (slope, &test),
            (whole.theil_sen.slope_per_decade, &whole.mann_kendall)
        );
        assert_eq!(steps.least_squares(&values).unwrap(), whole.least_squares);
    }
    let seasons: Vec<f64> = (0..96).map(|m| f64::from(m % 12)).collect();
    let why = trend(&periods, &seasons, TimeStep::Month, "").unwrap_err();
    assert_eq!(
        steps.least_squares(&seasons).unwrap_err().to_string(),
        why.to_string().replace("a test for a trend", "a trend")
    );
}

/// Months that a product lacks, as a series of its steps has them, beside the same months without data.
#[test]
fn steps_that_are_missing_are_steps_without_data() {
    let all = months(120);
    let is_missing = |m: usize| m % 9 == 4 || (40..46).contains(&m);
    // What goes on from month to month, so that it matters which ones are next to one another.
    let value = |m: usize| {
        let (slow, quick) = ((m as f64 / 4.0).sin(), ((m * m) % 7) as f64);
        rising(120)[m] + 2.0 * slow + 0.1 * quick
    };
    let with_gaps: Vec<f64> = (0..120)
        .map(|m| if is_missing(m) { f64::NAN } else { value(m) })
        .collect();
    let here = (0..120usize).filter(|m| !is_missing(*m));
    let (periods, values): (Vec<Period>, Vec<f64>) = here.map(|m| (all[m], value(m))).unzip();
    let expected = trend(&all, &with_gaps, TimeStep::Native, "").unwrap();
    let found = trend(&periods, &values, TimeStep::Native, "").unwrap();
    assert_eq!(found.count, values.len() as u64);
    assert_eq!(found, expected);
}
