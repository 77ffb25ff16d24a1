//! Means of series over time, and whether two of them differ by more than chance.

use contract::time::Period;

use super::autocorrelation::{autocorrelation, effective_count};
use super::distribution::student_two_sided;
use super::line::with_holes;

/// Mean of a series over time, and what is known of its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanOverTime {
    /// Steps with data.
    pub count: usize,
    /// Each step by its time in the period; none without data.
    pub mean: Option<f64>,
    /// Effective number of steps; none of fewer than two.
    pub effective_count: Option<f64>,
    /// Variance of the mean by the spread of `about`.
    variance: Option<f64>,
    /// Degrees of freedom of that.
    freedom: f64,
}

/// The mean of `values` (beside `periods`, NaN no data, any unit) over `window`: a step across an end of it counts by the time that it has
/// inside. Its error comes from the spread of `about`, one beside each value: the values less what is no chance in them, such as their seasons,
/// of which `means` were taken off: each takes a value's worth of the spread with it.
pub fn mean_over_time(
    periods: &[Period],
    values: &[f64],
    (about, means): (&[f64], usize),
    window: Period,
) -> MeanOverTime {
    let (mut sum, mut seconds, mut count) = (0.0, 0.0, 0);
    for (period, value) in periods.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
        let inside_ms = period.end.min(window.end).ms() - period.start.max(window.start).ms();
        let inside_s = inside_ms.max(0) as f64 / 1000.0;
        sum += value * inside_s;
        seconds += inside_s;
        count += 1;
    }
    let present: Vec<f64> = about.iter().copied().filter(|v| !v.is_nan()).collect();
    let spread = super::climatology::spread(&present);
    let next = || autocorrelation(&with_holes(periods, about), 1);
    let effective = spread.map(|_| effective_count(count, next()));
    let (n, further) = (count as f64, means.max(1) as f64 - 1.0);
    let left = n - 1.0 - further;
    let variance = spread.zip(effective).filter(|_| left > 0.0);
    MeanOverTime {
        count,
        mean: (count > 0).then(|| sum / seconds),
        effective_count: effective,
        variance: variance.map(|(spread, of)| spread * spread * ((n - 1.0) / left) / of),
        freedom: effective.map_or(0.0, |of| of - 1.0 - further * of / n),
    }
}

/// Standard error of the difference of two means, and the chance of one as large where there is none: Welch (1947),
/// doi:10.1093/biomet/34.1-2.28, with effective numbers. None where either side has fewer than two steps, or no degree of freedom.
pub fn welch(a: &MeanOverTime, b: &MeanOverTime) -> Option<(f64, Option<f64>)> {
    let (va, vb) = (a.variance?, b.variance?);
    let error = (va + vb).sqrt();
    let difference = a.mean? - b.mean?;
    if error <= 0.0 {
        return Some((0.0, None));
    }
    let freedom = (va + vb).powi(2) / (va * va / a.freedom + vb * vb / b.freedom);
    let p_value = (a.freedom > 0.0 && b.freedom > 0.0)
        .then(|| student_two_sided(difference / error, freedom))
        .flatten();
    Some((error, p_value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn months(count: u32) -> Vec<Period> {
        (0..count)
            .map(|m| Period::month(2001 + (m / 12) as i32, m % 12 + 1).unwrap())
            .collect()
    }

    /// A window that holds all steps of these tests.
    fn all() -> Period {
        let [start, end] = ["2001", "2011"].map(|year| year.parse().unwrap());
        Period::new(start, end).unwrap()
    }

    #[test]
    fn steps_count_by_their_length() {
        let year = months(12);
        let values: Vec<f64> = (0..12).map(|m| if m == 1 { 1.0 } else { 0.0 }).collect();
        let found = mean_over_time(&year, &values, (&values, 1), all());
        assert!((found.mean.unwrap() - 28.0 / 365.0).abs() < 1e-15);
        assert_eq!(
            mean_over_time(&year, &[f64::NAN; 12], (&[f64::NAN; 12], 1), all()).mean,
            None
        );
    }

    #[test]
    fn a_step_across_the_end_of_the_period_counts_by_its_time_inside() {
        let year = months(12);
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        // Ten days of February, all of March, one day of April.
        let [start, end] = ["2001-02-19", "2001-04-02"].map(|day| day.parse().unwrap());
        let window = Period::new(start, end).unwrap();
        let found = mean_over_time(&year[1..4], &values[1..4], (&values[1..4], 1), window);
        let mean = (10.0 * 1.0 + 31.0 * 2.0 + 3.0) / 42.0;
        assert!((found.mean.unwrap() - mean).abs() < 1e-12, "{found:?}");
    }

    /// By hand: 1, 1, _, 2, 2 about 1.5 has two pairs of 0.25, of four of five steps: 4/5 of the variance. Side by side it would
    /// have a third pair of -0.25.
    #[test]
    fn a_value_after_a_gap_is_not_the_next_one() {
        let year = months(12);
        let periods = [year[0], year[1], year[3], year[4]];
        let values = [1.0, 1.0, 2.0, 2.0];
        let found = mean_over_time(&periods, &values, (&values, 1), all());
        let expected = 4.0 * (1.0 - 0.8) / (1.0 + 0.8);
        assert!((found.effective_count.unwrap() - expected).abs() < 1e-12);
    }

    /// What `scipy.stats.ttest_ind(equal_var=False)` prints of the same values, alternating so that none is worth less than one:
    /// `tests/reference/series_statistics.py`.
    #[test]
    fn the_test_of_values_on_their_own_is_that_of_an_independent_library() {
        let days: Vec<Period> = (1..=8)
            .map(|d| {
                let start = format!("2001-01-{d:02}").parse().unwrap();
                let end = format!("2001-01-{:02}", d + 1).parse().unwrap();
                Period::new(start, end).unwrap()
            })
            .collect();
        let a = [1.0, 3.0, 0.5, 2.5, 1.5, 3.5, 0.0, 4.0];
        let b = [2.0, 5.0, 3.0, 6.0, 2.5, 4.5];
        let (a, b) = (
            mean_over_time(&days, &a, (&a, 1), all()),
            mean_over_time(&days[..6], &b, (&b, 1), all()),
        );
        let (error, p_value) = welch(&a, &b).unwrap();
        assert!(
            (error - WELCH.0).abs() < 1e-12 && (p_value.unwrap() - WELCH.1).abs() < 1e-9,
            "{error} {p_value:?}"
        );
    }

    /// Of two years' values less their twelve months' means 12 of 24 are left to tell their spread: noise has differences as often as chance says.
    #[test]
    fn means_that_were_taken_off_are_counted() {
        let mut state = 5_u64;
        let mut next = || {
            state = state.wrapping_mul(25_214_903_917).wrapping_add(11) & ((1 << 48) - 1);
            state as f64 / (1_u64 << 48) as f64
        };
        let periods = months(24);
        let mut side = || {
            let values: Vec<f64> = (0..24)
                .map(|_| (0..12).map(|_| next()).sum::<f64>())
                .collect();
            let about = crate::analysis::climatology::deseasonalised(&periods, &values);
            mean_over_time(&periods, &values, (&about, 12), all())
        };
        let (mut found, mut squares, mut told) = (0, 0.0, 0.0);
        for _ in 0..1000 {
            let (a, b) = (side(), side());
            let (error, p_value) = welch(&a, &b).unwrap();
            found += u32::from(p_value.is_some_and(|p| p < 0.05));
            squares += (a.mean.unwrap() - b.mean.unwrap()).powi(2);
            told += error * error;
        }
        assert!((25..80).contains(&found), "{found} of 1000");
        // Too large rather than too small: of few values some seem to go together.
        let apart = told / squares;
        assert!((0.9..1.6).contains(&apart), "{apart}");
        // Of twelve values less twelve means nothing is left that tells a spread.
        let few = months(12);
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        assert_eq!(
            mean_over_time(&few, &values, (&values, 12), all()).variance,
            None
        );
    }

    /// Error and chance.
    const WELCH: (f64, f64) = (0.823_995_299_724_612_5, 0.049_135_436_811_265_81);
}
