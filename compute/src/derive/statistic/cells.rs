//! Statistics of one cell: its values at all steps in, one value for each step that is written out.
//!
//! Several statistics of a cell share what they have in common: a trend, its test and its season are worked out once.

use std::ops::Range;
use std::sync::Arc;

use contract::analysis::{CalendarBins, LeastSquaresTrend, MannKendall, MapStatistic, Season};
use contract::statistics::Percentile;
use contract::time::{Period, TimeStep};

use super::plan::Plan;
use crate::analysis::climatology::spread;
use crate::analysis::harmonics::season;
use crate::analysis::trend::TrendSteps;
use crate::reduce::least_part;

const DAY_MS: f64 = 86_400_000.0;

/// Statistics of a cell, each over its own steps, what they need made once.
pub(super) struct OfCells(Vec<OfCell>);

impl OfCells {
    /// Those of some plans over the steps of these periods.
    pub(super) fn new(plans: &[Plan], periods: &[Period]) -> Self {
        let mut each: Vec<OfCell> = vec![];
        for plan in plans {
            let mut own = OfCell::new(plan, periods);
            if is_trend(own.statistic) {
                let mut same = each.iter().filter(|other| other.read == own.read);
                let there = same.find_map(|other| other.trend_steps.clone());
                let find = || Arc::new(TrendSteps::of(&own.periods, TimeStep::Month));
                own.trend_steps = Some(there.unwrap_or_else(find));
            }
            each.push(own);
        }
        Self(each)
    }

    /// Values that a cell has of each statistic: bins of those that have them, else one.
    pub(super) fn output_counts(&self) -> Vec<usize> {
        self.0.iter().map(OfCell::output_count).collect()
    }

    /// The statistics of a cell, one after the other, NaN where too little holds data; `values` are one for each step of the
    /// version, stored unit, NaN no data.
    pub(super) fn write(&self, values: &[f32], mut out: &mut [f64]) {
        let mut shared = Shared::default();
        for own in &self.0 {
            let (first, rest) = out.split_at_mut(own.output_count());
            own.write(&values[own.read.clone()], first, &mut shared);
            out = rest;
        }
    }
}

/// What several statistics of one cell are read from, by the steps that it is of.
#[derive(Default)]
struct Shared {
    /// Slope a decade, and its test.
    trend: Kept<(f64, MannKendall)>,
    least_squares: Kept<LeastSquaresTrend>,
    season: Kept<Season>,
}

/// What was found of some steps, if it was sought, and if it was there.
type Kept<T> = Option<(Range<usize>, Option<T>)>;

/// What was found of some steps, found now if it was not.
fn once<'a, T>(
    kept: &'a mut Kept<T>,
    steps: &Range<usize>,
    find: impl FnOnce() -> Option<T>,
) -> Option<&'a T> {
    if kept.as_ref().is_none_or(|(of, _)| of != steps) {
        *kept = Some((steps.clone(), find()));
    }
    kept.as_ref().and_then(|(_, found)| found.as_ref())
}

/// Is it found through the steps that trends are found over?
fn is_trend(statistic: MapStatistic) -> bool {
    matches!(
        statistic,
        MapStatistic::Trend
            | MapStatistic::TrendPValue
            | MapStatistic::LeastSquaresTrend
            | MapStatistic::LeastSquaresTrendPValue
    )
}

/// One statistic of a cell.
struct OfCell {
    statistic: MapStatistic,
    bins: CalendarBins,
    least_share: f64,
    /// Steps of the version that are read.
    read: Range<usize>,
    /// Of the steps that are read.
    periods: Vec<Period>,
    /// Bin of each of them.
    bin_of: Vec<usize>,
    /// Steps of each bin.
    steps_of: Vec<usize>,
    /// Seconds of each step that is read.
    seconds: Vec<f64>,
    /// Of all of them.
    all_s: f64,
    /// For trends.
    trend_steps: Option<Arc<TrendSteps>>,
}

impl OfCell {
    fn new(plan: &Plan, periods: &[Period]) -> Self {
        let periods = periods[plan.read.clone()].to_vec();
        let bin_of: Vec<usize> = periods.iter().map(|period| plan.bins.of(*period)).collect();
        let mut steps_of = vec![0; plan.bins.count()];
        for bin in &bin_of {
            steps_of[*bin] += 1;
        }
        let seconds: Vec<f64> = periods.iter().map(|period| period.seconds()).collect();
        Self {
            all_s: seconds.iter().fold(0.0, |all, own| all + own),
            seconds,
            trend_steps: None,
            statistic: plan.statistic,
            bins: plan.bins,
            least_share: plan.least_share,
            read: plan.read.clone(),
            periods,
            bin_of,
            steps_of,
        }
    }

    /// Values that a cell has: bins of those that have them, else one.
    fn output_count(&self) -> usize {
        if self.statistic.has_bins() {
            self.bins.count()
        } else {
            1
        }
    }

    /// The statistic of a cell, `out` one for each output.
    fn write(&self, values: &[f32], out: &mut [f64], shared: &mut Shared) {
        out.fill(f64::NAN);
        if self.statistic.has_bins() {
            self.bin_means(values, out);
            return;
        }
        let share = self.time_share(values);
        out[0] = match self.statistic {
            // These say how little there is.
            MapStatistic::Coverage if share > 0.0 => 100.0 * share,
            MapStatistic::Count if share > 0.0 => {
                values.iter().filter(|value| !value.is_nan()).count() as f64
            }
            _ if share >= self.least_share => self.single(values, shared).unwrap_or(f64::NAN),
            _ => f64::NAN,
        };
    }

    /// Share of the time of all steps that holds data.
    fn time_share(&self, values: &[f32]) -> f64 {
        let mut with_data_s = 0.0;
        for (seconds, value) in self.seconds.iter().zip(values) {
            // Adding nothing is quicker than asking whether to add.
            with_data_s += if value.is_nan() { 0.0 } else { *seconds };
        }
        with_data_s / self.all_s
    }

    fn bin_means(&self, values: &[f32], out: &mut [f64]) {
        let mut counts = vec![0usize; out.len()];
        out.fill(0.0);
        for (bin, value) in self.bin_of.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
            out[*bin] += f64::from(*value);
            counts[*bin] += 1;
        }
        for ((sum, count), all) in out.iter_mut().zip(&counts).zip(&self.steps_of) {
            let is_held = *count > 0 && *count as f64 >= self.least_share * *all as f64;
            *sum = if is_held {
                *sum / *count as f64
            } else {
                f64::NAN
            };
        }
    }

    fn single(&self, values: &[f32], shared: &mut Shared) -> Option<f64> {
        match self.statistic {
            MapStatistic::Mean => {
                let (mut sum, mut seconds) = (0.0, 0.0);
                for (period, value) in self.periods.iter().zip(values).filter(|(_, v)| !v.is_nan())
                {
                    sum += f64::from(*value) * period.seconds();
                    seconds += period.seconds();
                }
                (seconds > 0.0).then(|| sum / seconds)
            }
            MapStatistic::Spread => {
                let held = values.iter().filter(|value| !value.is_nan());
                spread(&held.map(|value| f64::from(*value)).collect::<Vec<_>>())
            }
            MapStatistic::Amplitude | MapStatistic::Phase => {
                let find = || season(&self.periods, &as_f64(values)).ok();
                let annual = &once(&mut shared.season, &self.read, find)?.annual;
                Some(match self.statistic {
                    MapStatistic::Phase => annual.highest_after_days,
                    _ => annual.amplitude,
                })
            }
            MapStatistic::Trend
            | MapStatistic::TrendPValue
            | MapStatistic::LeastSquaresTrend
            | MapStatistic::LeastSquaresTrendPValue => {
                let steps = self.trend_steps.as_ref()?;
                self.trend(steps, values, shared)
            }
            MapStatistic::Min | MapStatistic::MinTime => self.lowest(values, |value| value),
            MapStatistic::Max | MapStatistic::MaxTime => self.lowest(values, |value| -value),
            MapStatistic::Percentile(percentile) => self.percentile(values, percentile),
            MapStatistic::Count
            | MapStatistic::Coverage
            | MapStatistic::Climatology
            | MapStatistic::Anomaly => None,
        }
    }

    fn trend(&self, steps: &TrendSteps, values: &[f32], shared: &mut Shared) -> Option<f64> {
        match self.statistic {
            MapStatistic::LeastSquaresTrend | MapStatistic::LeastSquaresTrendPValue => {
                let find = || steps.least_squares(&as_f64(values)).ok();
                let found = once(&mut shared.least_squares, &self.read, find)?;
                match self.statistic {
                    MapStatistic::LeastSquaresTrend => Some(found.slope_per_decade),
                    _ => found.p_value,
                }
            }
            _ => {
                let find = || steps.tested_slope(&as_f64(values)).ok();
                let (slope, test) = once(&mut shared.trend, &self.read, find)?;
                Some(match self.statistic {
                    MapStatistic::TrendPValue => test.p_value,
                    _ => *slope,
                })
            }
        }
    }

    /// The value of the step that is lowest by some measure, or its middle in days of 1970; of equal ones the first.
    fn lowest(&self, values: &[f32], by: impl Fn(f32) -> f32) -> Option<f64> {
        let steps = self.periods.iter().zip(values);
        let held = steps.filter(|(_, value)| !value.is_nan());
        let (period, value) = held.min_by(|(_, a), (_, b)| by(**a).total_cmp(&by(**b)))?;
        Some(match self.statistic {
            MapStatistic::MinTime | MapStatistic::MaxTime => period.mid().ms() as f64 / DAY_MS,
            // One zero: which of two comes first says nothing.
            _ => f64::from(*value + 0.0),
        })
    }

    /// The least value at or below which so much of the time with data lies, as statistics of a place have it.
    fn percentile(&self, values: &[f32], percentile: Percentile) -> Option<f64> {
        let steps = self.periods.iter().zip(values);
        let held = steps.filter(|(_, value)| !value.is_nan());
        let mut held: Vec<(f32, i128)> = held
            .map(|(period, value)| (value + 0.0, i128::from(period.end.ms() - period.start.ms())))
            .collect();
        held.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        let all: i128 = held.iter().map(|(_, ms)| ms).sum();
        let target = least_part(all, percentile);
        let mut below = 0;
        let found = held.iter().find(|(_, ms)| {
            below += ms;
            below >= target
        });
        found.map(|(value, _)| f64::from(*value))
    }
}

fn as_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}
