//! Sums of steps into sums of bins: a step that lies in several counts in each by the time that it has there.

use contract::time::Period;

use super::accumulator::{Accumulated, StepSums};

/// Sums of a bin of time. Weights count times the time that a step has in it, in units of `unit_ms`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BinSums {
    /// What it covers.
    pub(super) period: Period,
    /// Length of a unit of time, ms: the largest that all its times are multiples of.
    unit_ms: i64,
    /// Steps that reach into it.
    pub(super) step_count: u32,
    /// Time of those that hold data, in units.
    pub(super) data_time: i64,
    /// Sums over its steps; the count is of values, whatever time they have.
    pub(super) sums: StepSums,
    /// Index of the first step that holds the smallest value, and of the first that holds the largest.
    pub(super) found_at: Option<[u32; 2]>,
}

impl BinSums {
    /// Length of the bin in units of time.
    pub(super) fn length(&self) -> i64 {
        length_ms(self.period) / self.unit_ms
    }
}

fn length_ms(period: Period) -> i64 {
    period.end.ms() - period.start.ms()
}

/// Time that two periods share, ms.
fn shared_ms(a: Period, b: Period) -> i64 {
    (a.end.min(b.end).ms() - a.start.max(b.start).ms()).max(0)
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Steps that reach into a bin, by index, and the time of each in units, which are told.
pub(super) fn times(steps: &[Period], bin: Period) -> (i64, Vec<(u32, i64)>) {
    let first = steps.partition_point(|step| step.end <= bin.start);
    let after = steps.partition_point(|step| step.start < bin.end);
    let own = (first..after.max(first)).map(|at| (at as u32, shared_ms(steps[at], bin)));
    let own: Vec<(u32, i64)> = own.filter(|(_, shared)| *shared > 0).collect();
    let unit_ms = own
        .iter()
        .fold(length_ms(bin), |unit, (_, shared)| gcd(unit, *shared));
    let in_units = own
        .into_iter()
        .map(|(step, shared)| (step, shared / unit_ms));
    (unit_ms, in_units.collect())
}

/// Sums of every bin. None if one leaves 128 bits.
pub(super) fn bin_sums(
    steps: &[Period],
    bins: &[Period],
    accumulated: &Accumulated,
) -> Option<Vec<BinSums>> {
    bins.iter()
        .map(|&period| bin_sum(steps, period, accumulated))
        .collect()
}

fn bin_sum(steps: &[Period], period: Period, accumulated: &Accumulated) -> Option<BinSums> {
    let (unit_ms, times) = times(steps, period);
    let mut bin = BinSums {
        period,
        unit_ms,
        step_count: times.len() as u32,
        data_time: 0,
        sums: StepSums::default(),
        found_at: None,
    };
    for (step, time) in times {
        let Some(own) = accumulated.steps.get(&step) else {
            continue;
        };
        let weighed = |sum: i128| sum.checked_mul(i128::from(time));
        let [first_min, first_max] = bin.found_at.unwrap_or([step; 2]);
        bin.found_at = Some([
            if own.min < bin.sums.min {
                step
            } else {
                first_min
            },
            if own.max > bin.sums.max {
                step
            } else {
                first_max
            },
        ]);
        bin.sums.merge(&StepSums {
            weight: weighed(own.weight)?,
            covered: weighed(own.covered)?,
            sum: weighed(own.sum)?,
            squares: weighed(own.squares)?,
            ..*own
        })?;
        bin.data_time += time;
    }
    Some(bin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn sums(value: i128) -> StepSums {
        StepSums {
            count: 2,
            weight: 10,
            covered: 4,
            sum: value * 10,
            squares: value * value * 10,
            min: value as f32,
            max: value as f32,
        }
    }

    #[test]
    fn a_step_in_two_bins_counts_in_each_by_its_time() {
        let steps = [
            period("2000-01-28", "2000-02-02"),
            period("2000-02-02", "2000-02-07"),
            period("2000-02-07", "2000-02-12"),
        ];
        let accumulated = Accumulated {
            steps: [(0, sums(5)), (1, sums(20))].into(),
            ..Accumulated::default()
        };
        let bins = [
            period("2000-01-28", "2000-02-01"),
            period("2000-02-01", "2000-02-11"),
            period("2000-02-12", "2000-02-13"),
        ];
        let found = bin_sums(&steps, &bins, &accumulated).unwrap();
        // Four days of the first step.
        assert_eq!((found[0].unit_ms, found[0].length()), (4 * 86_400_000, 1));
        assert_eq!((found[0].sums.weight, found[0].sums.sum), (10, 50));
        // One day of the first step, five of the second, four of one without data.
        assert_eq!((found[1].unit_ms, found[1].length()), (86_400_000, 10));
        assert_eq!(found[1].sums.weight, 60);
        assert_eq!(found[1].sums.sum, 50 + 5 * 200);
        assert_eq!((found[1].data_time, found[1].step_count), (6, 3));
        assert_eq!(found[1].found_at, Some([0, 1]));
        assert_eq!(found[1].sums.count, 4);
        assert_eq!((found[2].step_count, found[2].found_at), (0, None));
    }

    #[test]
    fn of_equal_extremes_the_first_is_told() {
        let day = |day: u32| {
            let (from, to) = (
                format!("2000-01-{day:02}"),
                format!("2000-01-{:02}", day + 1),
            );
            period(&from, &to)
        };
        let steps: Vec<Period> = (1..=4).map(day).collect();
        let values = [3, 1, 3, 1];
        let accumulated = Accumulated {
            steps: (0..).zip(values.map(sums)).collect(),
            ..Accumulated::default()
        };
        let bin = period("2000-01-01", "2000-01-05");
        let found = bin_sums(&steps, &[bin], &accumulated).unwrap();
        assert_eq!(found[0].found_at, Some([1, 0]));
    }

    #[test]
    fn a_sum_that_leaves_its_bits_is_none() {
        let mut own = sums(1);
        own.sum = i128::MAX / 2;
        let accumulated = Accumulated {
            steps: [(0, own)].into(),
            ..Accumulated::default()
        };
        let steps = [period("2000-01-01", "2000-01-11")];
        let bin = period("2000-01-01", "2000-01-12");
        assert_eq!(bin_sums(&steps, &[bin], &accumulated), None);
    }
}
