//! Means that anomalies are of: steps of a product in, which of them each mean is of and how long they lie in it out.

use std::ops::Range;

use contract::time::{Period, TimeStep};

use crate::analysis::timeline::{Bins, InBin};

/// A mean of steps that follow each other, each by the time of it that lies in the mean's; of a step that is taken as it is its value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MeanOf {
    pub(super) period: Period,
    /// Steps of the version that reach into it.
    pub(super) steps: Range<usize>,
    /// Seconds of each that lie in it.
    shared_s: Vec<f64>,
    /// Seconds that must hold data.
    least_s: f64,
    /// The same of each of its months; nothing of means that are no longer.
    month_least_s: Vec<f64>,
    /// Of each step its months, by their place, and the seconds that lie in them.
    in_months: Vec<Vec<(u16, f64)>>,
}

/// What a mean has come to, its steps added in the order of time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sum {
    /// Values times seconds.
    values_s: f64,
    with_data_s: f64,
    /// The month that was added to last, counted from 1, and how much of it holds data.
    month: u16,
    month_s: f64,
    /// Months before it that hold enough.
    held_months: u16,
}

impl Default for Sum {
    fn default() -> Self {
        Self {
            // Whatever is added to it stays what it is, -0.0 too.
            values_s: -0.0,
            with_data_s: 0.0,
            month: 0,
            month_s: 0.0,
            held_months: 0,
        }
    }
}

impl Sum {
    /// Months that hold enough, that which was added to last among them.
    fn held(&self, least_s: &[f64]) -> u16 {
        let last = usize::from(self.month).checked_sub(1);
        let is_held = last.is_some_and(|last| self.month_s >= least_s[last]);
        self.held_months + u16::from(is_held)
    }
}

impl MeanOf {
    /// A step as it is.
    pub(super) fn of_step(step: usize, period: Period) -> Self {
        Self {
            period,
            steps: step..step + 1,
            // Whatever is multiplied and divided with it stays what it is.
            shared_s: vec![1.0],
            least_s: 1.0,
            month_least_s: vec![],
            in_months: vec![],
        }
    }

    /// Adds the value of one of its steps, NaN no data.
    pub(super) fn add(&self, sum: &mut Sum, step: usize, value: f32) {
        let step = step - self.steps.start;
        // Most means are no longer than months, and this is done for every value.
        if !self.in_months.is_empty() {
            self.add_to_months(sum, step, value);
        }
        if !value.is_nan() {
            let shared_s = self.shared_s[step];
            sum.values_s += f64::from(value) * shared_s;
            sum.with_data_s += shared_s;
        }
    }

    fn add_to_months(&self, sum: &mut Sum, step: usize, value: f32) {
        for (month, shared_s) in &self.in_months[step] {
            if sum.month != month + 1 {
                sum.held_months = sum.held(&self.month_least_s);
                (sum.month, sum.month_s) = (month + 1, 0.0);
            }
            sum.month_s += if value.is_nan() { 0.0 } else { *shared_s };
        }
    }

    /// Does each of its months hold enough?
    fn has_months(&self, sum: Sum) -> bool {
        let least_s = &self.month_least_s;
        least_s.is_empty() || usize::from(sum.held(least_s)) == least_s.len()
    }

    /// The mean when all of its steps were added, NaN where too little of its time holds data.
    pub(super) fn mean(&self, sum: Sum) -> f64 {
        if sum.with_data_s >= self.least_s && self.has_months(sum) {
            sum.values_s / sum.with_data_s
        } else {
            f64::NAN
        }
    }

    /// The mean of values of which the first is that of step `first`.
    pub(super) fn of(&self, values: &[f32], first: usize) -> f64 {
        let mut sum = Sum::default();
        for step in self.steps.clone() {
            self.add(&mut sum, step, values[step - first]);
        }
        self.mean(sum)
    }
}

/// Means over whole bins of the calendar, of steps in the order of time: as trends are drawn through, with as much of a bin's time
/// that must hold data. Bins that steps cover less of are left out: no cell has a mean there.
pub(super) fn over(periods: &[Period], step: TimeStep) -> Vec<MeanOf> {
    let bins = Bins::over(periods, step);
    let mean = |(period, InBin { whole, months }): (Period, &InBin)| {
        let covered = |shared_s: &[f64], least_s: f64| shared_s.iter().sum::<f64>() >= least_s;
        let mut in_months = vec![vec![]; whole.shared_s.len()];
        for (number, month) in (0..).zip(months) {
            for (step, shared_s) in (month.from..).zip(&month.shared_s) {
                in_months[step - whole.from].push((number, *shared_s));
            }
        }
        let are_covered = covered(&whole.shared_s, whole.least_s)
            && months
                .iter()
                .all(|month| covered(&month.shared_s, month.least_s));
        are_covered.then(|| MeanOf {
            period,
            steps: whole.from..whole.from + whole.shared_s.len(),
            shared_s: whole.shared_s.clone(),
            least_s: whole.least_s,
            month_least_s: months.iter().map(|month| month.least_s).collect(),
            in_months: if months.is_empty() { vec![] } else { in_months },
        })
    };
    bins.inside().filter_map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::timeline::means_over;

    fn days(count: i64, of_days: i64) -> Vec<Period> {
        let at = |day: i64| contract::time::TimeMs::new(day * 86_400_000).unwrap();
        let step = |step: i64| Period::new(at(10 + step * of_days), at(10 + (step + 1) * of_days));
        (0..count).map(|at| step(at).unwrap()).collect()
    }

    #[test]
    fn means_are_those_that_trends_are_drawn_through() {
        for (of_days, step) in [
            (1, TimeStep::Week),
            (1, TimeStep::Month),
            (8, TimeStep::Month),
            (8, TimeStep::Season),
            (1, TimeStep::Season),
            (1, TimeStep::Year),
        ] {
            let periods = days(1200 / of_days, of_days);
            let value = |at: usize| {
                let gap = at % 7 == 3 || (40..90).contains(&at);
                if gap { f32::NAN } else { at as f32 * 0.37 }
            };
            let values: Vec<f32> = (0..periods.len()).map(value).collect();
            let wide: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
            let (bins, means) = means_over(&periods, &wide, step);
            let own = over(&periods, step);
            let mut left = bins.iter().zip(&means).filter(|(bin, mean)| {
                let there = own.iter().find(|own| own.period == **bin);
                let found = there.map_or(f64::NAN, |own| own.of(&values, 0));
                assert_eq!(found.to_bits(), mean.to_bits(), "{bin} {step:?}");
                there.is_none()
            });
            // The first week and month begin before the first step, and hold enough of it or not.
            assert!(left.all(|(_bin, mean)| mean.is_nan()));
            assert!(own.len() >= 3);
        }
    }

    #[test]
    fn a_step_as_it_is_is_its_value() {
        let own = MeanOf::of_step(7, days(1, 1)[0]);
        for value in [0.1f32, -0.0, f32::NAN] {
            let mean = own.of(&[value], 7);
            assert_eq!((mean as f32).to_bits(), value.to_bits());
        }
    }
}
