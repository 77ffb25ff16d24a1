use super::*;
use crate::analysis::correlation::correlation_at;
use crate::analysis::reference::{OTHER, SERIES, near};

fn month(month: u32) -> Period {
    Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap()
}

fn months(of: std::ops::Range<u32>) -> Vec<Period> {
    of.map(month).collect()
}

/// Common steps of two products.
fn common(a: &[Period], b: &[Period], step: TimeStep) -> Result<CommonSteps, ContractError> {
    let (first, second): (ProductId, ProductId) = ("a".parse()?, "b".parse()?);
    let sides = [(&first, a), (&second, b)];
    CommonSteps::of(
        sides.map(|(product, periods)| Covered { product, periods }),
        step,
    )
}

/// `tests/reference/series_statistics.py`.
#[test]
fn correlations_with_seasons_off_are_those_of_an_independent_library() {
    let without = |mut values: [f64; 30], gaps: &[usize]| {
        for at in gaps {
            values[*at] = f64::NAN;
        }
        values
    };
    let first = without(SERIES, &[3, 4, 17]);
    let second = without(OTHER, &[0, 9, 17, 28]);
    // A month more before and after is common to nobody.
    let (own, longer) = (months(0..30), months(0..34));
    let mut second = second.to_vec();
    second.extend([7.0, -3.0, f64::NAN, 2.0]);
    let common = common(&own, &longer, TimeStep::Month).unwrap();
    let common = common.without_seasons().unwrap();
    assert_eq!([0, 2, -40].map(|lag| common.most_pairs(lag)), [30, 28, 0]);
    let [first, second] = common.beside([&first, &second]);
    for (lag, count, r, effective, p) in [
        (
            -1,
            22,
            0.738_971_634_455_810_5,
            12.547_426_800_574_387,
            0.004_752_762_086_243_259,
        ),
        (
            0,
            24,
            0.793_312_806_310_752_4,
            13.688_101_964_262_97,
            0.000_837_862_412_373_411_2,
        ),
        (
            2,
            22,
            0.597_164_182_255_323,
            12.547_426_800_574_387,
            0.035_016_448_974_177_74,
        ),
    ] {
        let row = correlation_at(&first, &second, lag);
        assert_eq!(row.count, count);
        near(row.correlation.unwrap(), r, 1e-10);
        near(row.effective_count.unwrap(), effective, 1e-10);
        near(row.p_value.unwrap(), p, 1e-8);
    }
}

#[test]
fn a_season_and_nothing_else_leaves_nothing_that_goes_together() {
    let periods = months(0..120);
    let season = |month: usize| 0.1 + 0.3 * ((month % 12) as f64).sin();
    let season: Vec<f64> = (0..120).map(season).collect();
    let noise: Vec<f64> = (0..120).map(|at| f64::from((at * 7919) % 101)).collect();
    let common = common(&periods, &periods, TimeStep::Month).unwrap();
    let [a, b] = common.beside([&season, &noise]);
    assert!(correlation_at(&a, &b, 0).correlation.is_some());
    let common = common.without_seasons().unwrap();
    let [a, b] = common.beside([&season, &noise]);
    assert!(a.iter().all(|value| value.abs() < f64::MIN_POSITIVE));
    assert_eq!(correlation_at(&a, &b, 0).correlation, None);
}

#[test]
fn a_month_that_neither_has_keeps_its_place_and_one_that_one_has_too() {
    let of = |list: &[u32]| -> Vec<Period> { list.iter().map(|at| month(*at)).collect() };
    let (a, b) = (of(&[0, 1, 2, 4, 5, 7]), of(&[1, 2, 3, 4, 7, 8]));
    let common = common(&a, &b, TimeStep::Native).unwrap();
    let [first, second] = common.beside([
        &[0.0, 1.0, 2.0, 4.0, 5.0, 7.0],
        &[1.0, 2.0, 3.0, 4.0, 7.0, 8.0],
    ]);
    assert_eq!(common.extent().start, month(1).start);
    let places = |values: Vec<f64>| -> Vec<i64> {
        let place = |value: f64| if value.is_nan() { -1 } else { value as i64 };
        values.into_iter().map(place).collect()
    };
    // From month 1 to 7: 3 is the second's alone, 5 the first's, 6 nobody's.
    assert_eq!(places(first), [1, 2, -1, 4, 5, -1, 7]);
    assert_eq!(places(second), [1, 2, 3, 4, -1, -1, 7]);
    assert_eq!(common.most_pairs(-3), 4);
    assert!(common.check_lag(3).is_ok());
}

#[test]
fn what_has_no_common_steps_says_why() {
    let said = |found: Result<CommonSteps, ContractError>| found.unwrap_err().to_string();
    let (early, late) = (months(0..12), months(24..36));
    let refused = said(common(&early, &late, TimeStep::Month));
    assert!(refused.contains("a covers 2001"), "{refused}");
    assert!(refused.contains("b covers 2003"), "{refused}");
    let refused = said(common(&early, &early, TimeStep::Total));
    assert!(refused.contains("does not vary"), "{refused}");
    let refused = said(common(&early, &early, TimeStep::Day));
    assert!(refused.contains("the steps of a are longer"), "{refused}");
    let years = common(&months(0..48), &months(0..48), TimeStep::Year).unwrap();
    let refused = said(years.without_seasons());
    assert!(refused.contains("months or shorter"), "{refused}");
}
