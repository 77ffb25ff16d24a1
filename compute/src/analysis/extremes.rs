//! Highest and lowest steps, and percentiles.

use contract::analysis::{Extreme, Extremes, Percentile};
use contract::time::Period;

use super::undefined::Undefined;

/// Steps that are listed at either end.
pub const LISTED: usize = 5;
/// Percentiles that are said.
pub const PERCENTS: [f64; 9] = [1.0, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 99.0];

/// The ends of a series: `values` beside `periods` in the order of time, NaN no data, any unit.
///
/// # Errors
/// No data.
pub fn extremes(periods: &[Period], values: &[f64]) -> Result<Extremes, Undefined> {
    let both = periods.iter().zip(values).filter(|(_, v)| !v.is_nan());
    let mut steps: Vec<Extreme> = both
        .map(|(period, value)| Extreme {
            start: period.start,
            end: period.end,
            value: *value,
        })
        .collect();
    if steps.is_empty() {
        return Err(Undefined::NoData);
    }
    // Stable: of equal ones the earliest stays first.
    steps.sort_by(|a, b| a.value.total_cmp(&b.value));
    let sorted: Vec<f64> = steps.iter().map(|step| step.value).collect();
    let lowest = steps.iter().take(LISTED).copied().collect();
    steps.sort_by(|a, b| b.value.total_cmp(&a.value).then(a.start.cmp(&b.start)));
    let percentile = |percent: f64| Percentile {
        percent,
        value: percentile(&sorted, percent),
    };
    Ok(Extremes {
        highest: steps.into_iter().take(LISTED).collect(),
        lowest,
        percentiles: PERCENTS.map(percentile).to_vec(),
    })
}

/// What `percent` of some values lie below: straight between the two values around rank percent (n - 1) / 100, definition 7 of
/// Hyndman and Fan (1996), doi:10.1080/00031305.1996.10473566, and numpy's `linear`.
///
/// `sorted` is not empty, rises, and holds no NaN; `percent` is 0 to 100.
pub fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let rank = percent / 100.0 * (sorted.len() - 1) as f64;
    let below = rank.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    let share = rank - below as f64;
    sorted[below] + share * (sorted[above] - sorted[below])
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn the_ends_come_with_their_dates_and_the_earliest_of_equal_ones_first() {
        let months: Vec<Period> = (1..=8).map(|m| Period::month(2001, m).unwrap()).collect();
        let values = [3.0, f64::NAN, -1.0, 7.0, 3.0, 7.0, -1.0, 0.5];
        let found = extremes(&months, &values).unwrap();
        let of = |ends: &[Extreme]| -> Vec<(u32, f64)> {
            ends.iter()
                .map(|e| (e.start.year_month().1, e.value))
                .collect()
        };
        assert_eq!(
            of(&found.highest),
            [(4, 7.0), (6, 7.0), (1, 3.0), (5, 3.0), (8, 0.5)]
        );
        assert_eq!(
            of(&found.lowest),
            [(3, -1.0), (7, -1.0), (8, 0.5), (1, 3.0), (5, 3.0)]
        );
        assert_eq!(found.percentiles[4].value, 3.0);
        assert_eq!(extremes(&months, &[f64::NAN; 8]), Err(Undefined::NoData));
        let one = extremes(&months[..1], &[2.0]).unwrap();
        assert!(one.percentiles.iter().all(|p| p.value == 2.0));
    }

    /// What numpy's `percentile` prints: `tests/reference/series_statistics.py`.
    #[test]
    fn percentiles_are_those_of_an_independent_library() {
        let sorted = [-2.5, -1.0, 0.0, 0.25, 4.0, 9.0, 11.5];
        for (percent, value) in [
            (0.0, -2.5),
            (5.0, -2.05),
            (50.0, 0.25),
            (90.0, 10.0),
            (99.0, 11.35),
            (100.0, 11.5),
        ] {
            assert!(
                (percentile(&sorted, percent) - value).abs() < 1e-12,
                "{percent}"
            );
        }
    }
}
