//! Statistics of one cell: its values at all steps in, one value for each step that is written out.

use contract::analysis::{CalendarBins, MapStatistic};
use contract::time::{Period, TimeStep};

use super::plan::Plan;
use crate::analysis::climatology::spread;
use crate::analysis::harmonics::season;
use crate::analysis::trend::trend;

/// What every cell needs, made once.
pub(super) struct OfCell {
    statistic: MapStatistic,
    bins: CalendarBins,
    least_share: f64,
    /// Of the steps that are read.
    periods: Vec<Period>,
    /// Bin of each of them.
    bin_of: Vec<usize>,
    /// Steps of each bin.
    steps_of: Vec<usize>,
}

impl OfCell {
    pub(super) fn new(plan: &Plan, periods: Vec<Period>) -> Self {
        let bin_of: Vec<usize> = periods.iter().map(|period| plan.bins.of(*period)).collect();
        let mut steps_of = vec![0; plan.bins.count()];
        for bin in &bin_of {
            steps_of[*bin] += 1;
        }
        Self {
            statistic: plan.statistic,
            bins: plan.bins,
            least_share: plan.least_share,
            periods,
            bin_of,
            steps_of,
        }
    }

    /// Values that a cell has: bins of those that have them, else one.
    pub(super) fn output_count(&self) -> usize {
        if self.statistic.has_bins() {
            self.bins.count()
        } else {
            1
        }
    }

    /// The statistic of a cell, `out` one for each output, NaN where too little holds data; `values` are one for each period,
    /// stored unit, NaN no data.
    pub(super) fn write(&self, values: &[f32], out: &mut [f64]) {
        out.fill(f64::NAN);
        if self.statistic.has_bins() {
            self.bin_means(values, out);
        } else if self.time_share(values) >= self.least_share {
            out[0] = self.single(values).unwrap_or(f64::NAN);
        }
    }

    /// Share of the time of all steps that holds data.
    fn time_share(&self, values: &[f32]) -> f64 {
        let (mut with_data_s, mut all_s) = (0.0, 0.0);
        for (period, value) in self.periods.iter().zip(values) {
            all_s += period.seconds();
            if !value.is_nan() {
                with_data_s += period.seconds();
            }
        }
        with_data_s / all_s
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

    fn single(&self, values: &[f32]) -> Option<f64> {
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
                let annual = season(&self.periods, &as_f64(values)).ok()?.annual;
                Some(match self.statistic {
                    MapStatistic::Phase => annual.highest_after_days,
                    _ => annual.amplitude,
                })
            }
            MapStatistic::Trend | MapStatistic::TrendPValue => {
                let found = trend(&self.periods, &as_f64(values), TimeStep::Month, "").ok()?;
                Some(match self.statistic {
                    MapStatistic::TrendPValue => found.mann_kendall.p_value,
                    _ => found.theil_sen.slope_per_decade,
                })
            }
            MapStatistic::Climatology | MapStatistic::Anomaly => None,
        }
    }
}

fn as_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|value| f64::from(*value)).collect()
}
