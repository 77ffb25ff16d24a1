//! Statistics of one cell: its values at all steps in, those of two products where it is of two; one value for each step that is
//! written out.
//!
//! Several statistics of a cell share what they have in common: a trend, its test, its season and its correlation are worked out once.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use contract::analysis::{
    CorrelationRow, CorrelationStatistic, LeastSquaresTrend, MannKendall, MapStatistic, Season,
};
use contract::statistics::Percentile;
use contract::time::{Period, TimeStep};

use super::held::Anomalies;
use super::means::MeanOf;
use super::pairs::Pairs;
use super::plan::Plan;
use crate::analysis::climatology::spread;
use crate::analysis::harmonics::season;
use crate::analysis::trend::TrendSteps;
use crate::reduce::least_part;

const DAY_MS: f64 = 86_400_000.0;

/// Statistics of a cell, each over its own steps, what they need made once.
pub(super) struct OfCells {
    each: Vec<OfCell>,
    /// Of each statistic the anomalies that are made with it.
    anomalies: Vec<Option<Anomalies>>,
    /// What correlations are made by.
    pairs: Vec<Pairs>,
}

impl OfCells {
    /// Those of some plans over the steps of these periods, with the anomalies of those of which they are held.
    pub(super) fn new(plans: &[Plan], are_held: &[bool], periods: &[Period]) -> Self {
        let mut each: Vec<OfCell> = vec![];
        let mut pairs: Vec<Pairs> = vec![];
        for plan in plans {
            let mut own = OfCell::new(plan, periods);
            if own.statistic.is_trend() {
                let mut same = each.iter().filter(|other| other.over == own.over);
                let there = same.find_map(|other| other.trend_steps.clone());
                let find = || Arc::new(TrendSteps::of(&own.periods, own.over.step));
                own.trend_steps = Some(there.unwrap_or_else(find));
            }
            if let Some(of_plan) = &plan.pairs {
                let there = pairs.iter().position(|other| other.is_same(of_plan));
                own.pairs = Some(there.unwrap_or(pairs.len()));
                if there.is_none() {
                    pairs.push(of_plan.clone());
                }
            }
            each.push(own);
        }
        let anomalies = plans.iter().zip(are_held);
        let anomalies = anomalies.map(|(plan, is_held)| is_held.then(|| Anomalies::new(plan)));
        Self {
            anomalies: anomalies.collect(),
            each,
            pairs,
        }
    }

    /// Anomalies that a cell has of each statistic.
    pub(super) fn anomaly_counts(&self) -> impl Iterator<Item = usize> {
        let anomalies = self.anomalies.iter();
        anomalies.map(|own| own.as_ref().map_or(0, Anomalies::count))
    }

    /// Values that a cell has of each statistic: bins of those that have them, else one.
    pub(super) fn output_counts(&self) -> Vec<usize> {
        self.each.iter().map(OfCell::output_count).collect()
    }

    /// The statistics of a cell, one after the other, NaN where too little holds data; `values` of each product are one for each
    /// step of its version, stored unit, NaN no data; of the second product none where no statistic is of two. Anomalies come apart from
    /// their normals.
    pub(super) fn write(
        &self,
        values: [&[f32]; 2],
        mut out: &mut [f64],
        mut anomalies: &mut [f32],
    ) {
        let mut shared = Shared::default();
        for (own, of_own) in self.each.iter().zip(&self.anomalies) {
            let (first, rest) = out.split_at_mut(own.output_count());
            match own.pairs {
                Some(at) => {
                    let row = shared.correlation(at, || self.pairs[at].row(values));
                    first[0] = own.of_pairs(row, self.pairs[at].most());
                }
                None => own.write(&values[0][own.over.read.clone()], first, &mut shared),
            }
            if let Some(of_own) = of_own {
                let (of_cell, rest) = anomalies.split_at_mut(of_own.count());
                of_own.write(values[0], first, of_cell);
                anomalies = rest;
            }
            out = rest;
        }
    }
}

/// What several statistics of one cell are read from, by the steps that it is of.
#[derive(Default)]
struct Shared {
    /// Share of the time that holds data.
    time_share: Option<(Range<usize>, f64)>,
    /// Slope a decade, and its test.
    trend: Kept<(f64, MannKendall)>,
    least_squares: Kept<LeastSquaresTrend>,
    season: Kept<Season>,
    /// By the number of what it is made by.
    correlation: Option<(usize, CorrelationRow)>,
}

impl Shared {
    fn correlation(&mut self, at: usize, find: impl FnOnce() -> CorrelationRow) -> &CorrelationRow {
        let kept = self.correlation.take().filter(|(of, _)| *of == at);
        let kept = kept.unwrap_or_else(|| (at, find()));
        &self.correlation.insert(kept).1
    }
}

/// What a statistic is found over.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Over {
    /// Steps of the version that are read.
    read: Range<usize>,
    /// Means that trends are drawn through.
    step: TimeStep,
}

/// What was found of some steps, if it was sought, and if it was there.
type Kept<T> = Option<(Over, Option<T>)>;

/// What was found of some steps, found now if it was not.
fn once<'a, T>(
    kept: &'a mut Kept<T>,
    over: &Over,
    find: impl FnOnce() -> Option<T>,
) -> Option<&'a T> {
    if kept.as_ref().is_none_or(|(of, _)| of != over) {
        *kept = Some((over.clone(), find()));
    }
    kept.as_ref().and_then(|(_, found)| found.as_ref())
}

/// One statistic of a cell.
struct OfCell {
    statistic: MapStatistic,
    /// Parts of the year of what has them.
    bins: usize,
    /// Means that are gathered in them; none where steps are.
    means: Option<Arc<[MeanOf]>>,
    least_share: f64,
    over: Over,
    /// Of the steps that are read.
    periods: Vec<Period>,
    /// Bin of each of them, or of each mean.
    bin_of: Vec<usize>,
    /// Steps, or means, of each bin that there would be if none of a year that was asked for were missing.
    steps_of: Vec<f64>,
    /// Seconds of each step that is read.
    seconds: Vec<f64>,
    /// From the first of them to the last: what never landed is time without data.
    all_s: f64,
    /// For trends.
    trend_steps: Option<Arc<TrendSteps>>,
    /// Which of what correlations are made by, of one.
    pairs: Option<usize>,
}

impl OfCell {
    fn new(plan: &Plan, periods: &[Period]) -> Self {
        let periods = periods[plan.read.clone()].to_vec();
        let bin_of = |period: Period| plan.parts.of_period(period);
        let each: Vec<Period> = match &plan.normals_of {
            None => periods.clone(),
            Some(means) => means.iter().map(|mean| mean.period).collect(),
        };
        let bin_of: Vec<usize> = each.iter().map(|period| bin_of(*period)).collect();
        let seconds: Vec<f64> = periods.iter().map(|period| period.seconds()).collect();
        let ends = periods.first().zip(periods.last());
        Self {
            all_s: ends.map_or(0.0, |(first, last)| {
                Period {
                    start: first.start,
                    end: last.end,
                }
                .seconds()
            }),
            steps_of: steps_of(plan, &each, &bin_of),
            seconds,
            trend_steps: None,
            pairs: None,
            statistic: plan.statistic,
            bins: plan.parts.count(),
            means: plan.normals_of.clone(),
            least_share: plan.least_share,
            over: Over {
                read: plan.read.clone(),
                step: plan.step,
            },
            periods,
            bin_of,
        }
    }

    /// Values that a cell has: bins of those that have them, else one.
    fn output_count(&self) -> usize {
        if self.statistic.has_bins() {
            self.bins
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
        let kept = shared.time_share.take();
        let kept = kept.filter(|(of, _)| *of == self.over.read);
        let (_, share) = shared
            .time_share
            .insert(kept.unwrap_or_else(|| (self.over.read.clone(), self.time_share(values))));
        let share = *share;
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

    /// What is said of a correlation; `most` are the pairs of a cell that lacks nothing.
    fn of_pairs(&self, row: &CorrelationRow, most: usize) -> f64 {
        let MapStatistic::Correlation(of) = self.statistic else {
            return f64::NAN;
        };
        let is_enough = row.count as f64 >= self.least_share * most as f64;
        let value = match of {
            // This says how little there is.
            CorrelationStatistic::Pairs => (row.count > 0).then_some(row.count as f64),
            _ if !is_enough => None,
            CorrelationStatistic::Coefficient => row.correlation,
            CorrelationStatistic::PValue => row.p_value,
            CorrelationStatistic::EffectivePairs => row.effective_count,
        };
        value.unwrap_or(f64::NAN)
    }

    /// Share of the time from the first step to the last that holds data.
    fn time_share(&self, values: &[f32]) -> f64 {
        let mut with_data_s = 0.0;
        for (seconds, value) in self.seconds.iter().zip(values) {
            // Adding nothing is quicker than asking whether to add.
            with_data_s += if value.is_nan() { 0.0 } else { *seconds };
        }
        with_data_s / self.all_s
    }

    fn bin_means(&self, values: &[f32], out: &mut [f64]) {
        match &self.means {
            None => self.means_of(values.iter().map(|value| f64::from(*value)), out),
            Some(means) => {
                let first = self.over.read.start;
                self.means_of(means.iter().map(|mean| mean.of(values, first)), out);
            }
        }
    }

    /// Means of the bins of some values, each of which counts once.
    fn means_of(&self, values: impl Iterator<Item = f64>, out: &mut [f64]) {
        let mut counts = vec![0usize; out.len()];
        out.fill(0.0);
        for (bin, value) in self.bin_of.iter().zip(values).filter(|(_, v)| !v.is_nan()) {
            out[*bin] += value;
            counts[*bin] += 1;
        }
        for ((sum, count), all) in out.iter_mut().zip(&counts).zip(&self.steps_of) {
            let is_held = *count > 0 && *count as f64 >= self.least_share * all;
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
                let annual = &once(&mut shared.season, &self.over, find)?.annual;
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
            | MapStatistic::Anomaly
            | MapStatistic::Correlation(_) => None,
        }
    }

    fn trend(&self, steps: &TrendSteps, values: &[f32], shared: &mut Shared) -> Option<f64> {
        match self.statistic {
            MapStatistic::LeastSquaresTrend | MapStatistic::LeastSquaresTrendPValue => {
                let find = || steps.least_squares(&as_f64(values)).ok();
                let found = once(&mut shared.least_squares, &self.over, find)?;
                match self.statistic {
                    MapStatistic::LeastSquaresTrend => Some(found.slope_per_decade),
                    _ => found.p_value,
                }
            }
            _ => {
                let find = || steps.tested_slope(&as_f64(values)).ok();
                let (slope, test) = once(&mut shared.trend, &self.over, find)?;
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

/// Steps of each bin of some periods, in whose bins they lie; of a base period that was asked for as many as there would be if there were some in each of
/// its years that has the bin.
fn steps_of(plan: &Plan, periods: &[Period], bin_of: &[usize]) -> Vec<f64> {
    let mut steps_of = vec![0.0; plan.parts.count()];
    let mut years_of = vec![BTreeSet::new(); plan.parts.count()];
    for (period, bin) in periods.iter().zip(bin_of) {
        steps_of[*bin] += 1.0;
        years_of[*bin].insert(period.mid().year_month().0);
    }
    let Some(base) = plan.base else {
        return steps_of;
    };
    for (bin, (steps, years)) in steps_of.iter_mut().zip(&years_of).enumerate() {
        let wanted = base
            .years()
            .filter(|year| plan.parts.is_in_year(bin, *year));
        // In this order whole numbers stay whole.
        *steps = *steps * wanted.count() as f64 / years.len().max(1) as f64;
    }
    steps_of
}

fn as_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}
