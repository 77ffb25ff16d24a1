//! What a derivation of a statistic reads and writes: steps in, steps out, each with the digest of what it is made of.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{AnalysisOptions, BasePeriod, CalendarBins, MapOptions, MapStatistic};
use contract::computed::Computed;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::quantity::Quantity;
use contract::region::Region;
use contract::time::{Period, TimeStep};
use serde::Serialize;

use super::kept::computed;
use super::means::MeanOf;
use super::pairs::Pairs;
use super::parts_of_year::PartsOfYear;
use super::quantity;
use super::ranges::{Ranges, extent, inside, of_steps};
use super::sources::SourcesOf;
use super::stored::Stored;
use crate::ComputeError;
use crate::analysis::timeline::longest_s;

/// Version of the way a statistic is made: it changes when its bits do.
fn method(statistic: MapStatistic) -> u32 {
    match statistic {
        // Means of months are found together with a line since 2; means of seasons too, and autocorrelation is that from step to step, since 3.
        MapStatistic::Trend
        | MapStatistic::TrendPValue
        | MapStatistic::LeastSquaresTrend
        | MapStatistic::LeastSquaresTrendPValue => 3,
        // Seasons and years have means where all of their months hold data, waves where data lie all the year round, and steps that never
        // landed are time without data, since 2.
        _ => 2,
    }
}

/// A step that is written.
#[derive(Debug, Clone)]
pub(super) struct Output {
    pub(super) period: Period,
    /// What it is, for people.
    pub(super) origin: String,
    /// Digest of everything that its values depend on.
    pub(super) made_of: Digest,
}

impl Output {
    /// What a manifest says of it.
    pub(super) fn step(&self, field: ObjectKey, valid_cells: u64) -> Step {
        Step {
            masked: None,
            period: self.period,
            field,
            raw_sha256: self.made_of,
            origin: self.origin.clone(),
            valid_cells,
            contributed: None,
        }
    }
}

/// What is read and written.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) statistic: MapStatistic,
    /// That climatologies and anomalies have.
    pub(super) parts: PartsOfYear,
    pub(super) least_share: f64,
    /// Means that trends are drawn through.
    pub(super) step: TimeStep,
    /// What a correlation is made by.
    pub(super) pairs: Option<Pairs>,
    /// How, and of what.
    pub(super) computed: Computed,
    /// Index of the first step that is read, and of the first one after.
    pub(super) read: Range<usize>,
    /// Means that the normals of anomalies are made of; none where steps are taken as they are.
    pub(super) normals_of: Option<Arc<[MeanOf]>>,
    /// Years that normals were asked to stand for; none where they are those of what there is.
    pub(super) base: Option<BasePeriod>,
    /// What each anomaly is of, one for each output; nothing of other statistics.
    pub(super) anomalies_of: Arc<[MeanOf]>,
    pub(super) outputs: Vec<Output>,
    pub(super) quantity: Quantity,
    /// What values of the product's unit are multiplied with.
    pub(super) factor: f64,
    /// What the title says after that of the product.
    pub(super) title: String,
}

#[derive(Serialize)]
struct MadeOf<'a> {
    kind: &'static str,
    /// That of [`method`].
    method: u32,
    options: &'a MapOptions,
    #[serde(skip_serializing_if = "Option::is_none")]
    region: Option<&'a Region>,
    base: BasePeriod,
    output: usize,
    read: &'a [(Period, &'a ObjectKey)],
    /// Of the second product.
    #[serde(skip_serializing_if = "Option::is_none")]
    with: Option<&'a [(Period, &'a ObjectKey)]>,
}

impl Plan {
    /// The plan for a version of a product, or of two.
    pub(super) fn of(sources: SourcesOf<'_>, options: &MapOptions) -> Result<Self, ComputeError> {
        let (source, statistic) = (sources.first, options.statistic);
        let second = sources.second.map(|second| second.quantity);
        let (quantity, factor) = quantity::of(source.quantity, second, statistic)?;
        if options.least_percent > 100 {
            let text = options.least_percent.to_string();
            return Err(ContractError::invalid("least percent", &text, "0 to 100").into());
        }
        let parts = PartsOfYear::of(options);
        let ranges = Ranges::of(source, options)?;
        let periods: Vec<Period> = match &ranges.normals_of {
            Some(means) => means.iter().map(|mean| mean.period).collect(),
            None => of_steps(source, &ranges.read).collect(),
        };
        check_steps(statistic, parts, &periods)?;
        let pairs = pairs(sources, options, &ranges)?;
        let over = match &pairs {
            Some(pairs) => pairs.extent(),
            None => extent(source, &ranges.read),
        };
        let title = title(options, ranges.base, over);
        let least = options.least_percent;
        Ok(Self {
            statistic,
            parts,
            least_share: f64::from(least) / 100.0,
            step: options.step,
            computed: computed(sources, options),
            outputs: outputs(sources, options, (&ranges, pairs.as_ref()))?,
            pairs,
            read: ranges.read,
            normals_of: ranges.normals_of,
            base: options.base.filter(|_| options.statistic.has_bins()),
            anomalies_of: ranges.anomalies_of,
            quantity,
            factor,
            title,
        })
    }

    /// Steps of the first product (0) or of the second that are read; none of a second that there is not.
    pub(super) fn reads(&self, side: usize) -> Option<Range<usize>> {
        match (&self.pairs, side) {
            (Some(pairs), side) => pairs.reads.get(side).cloned(),
            (None, 0) => Some(self.read.clone()),
            (None, _) => None,
        }
    }

    /// Steps of the first product that anomalies are of; none of a second.
    pub(super) fn anomaly_reads(&self, side: usize) -> Option<Range<usize>> {
        let ends = self.anomalies_of.first().zip(self.anomalies_of.last());
        let (first, last) = ends.filter(|_| side == 0)?;
        Some(first.steps.start..last.steps.end)
    }

    /// Was a version made of these very steps in this very way, for these very cells, so that its values are those that would be made?
    pub(super) fn has_values_of(&self, latest: &Manifest, stored: &Stored) -> bool {
        let made_of = latest.steps.iter().map(|step| step.raw_sha256);
        latest.grid == stored.grid
            && latest.quantity.is_same_kind(self.quantity)
            && made_of.eq(self.outputs.iter().map(|output| output.made_of))
    }

    /// Does a version say that it was made of these versions, as it is asked for now?
    pub(super) fn is_said_by(&self, latest: &Manifest, source: &Manifest) -> bool {
        latest.derived_from.as_ref() == Some(&source.id())
            && latest.computed.as_ref() == Some(&self.computed)
    }
}

/// What a correlation is made by.
fn pairs(
    sources: SourcesOf<'_>,
    options: &MapOptions,
    ranges: &Ranges,
) -> Result<Option<Pairs>, ContractError> {
    let (Some(second), Some(asked)) = (sources.second, &options.correlation) else {
        return Ok(None);
    };
    let reads = [ranges.read.clone(), inside(second, options)?];
    Pairs::of([sources.first, second], reads, options, asked).map(Some)
}

/// What a title says after that of the product.
fn title(options: &MapOptions, base: BasePeriod, over: Period) -> String {
    let (statistic, least) = (options.statistic, options.least_percent);
    let is_usual = options.step == AnalysisOptions::USUAL_STEP;
    let mut title = match statistic {
        MapStatistic::Climatology => format!("{} climatology {base}", adjective(options.bins)),
        MapStatistic::Anomaly => of_anomalies(options, base),
        _ if statistic.is_of_two() || (statistic.is_trend() && !is_usual) => {
            let (means, over) = (in_means(options.step), over.in_words());
            format!("{statistic} of {means} over {over}")
        }
        other => format!("{other} over {}", over.in_words()),
    };
    if let Some(correlation) = &options.correlation {
        if correlation.deseasonalise {
            title += ", seasons taken off";
        }
        let (lag, steps) = (correlation.lag_steps, correlation.lag_steps.unsigned_abs());
        if lag != 0 {
            let way = if lag > 0 { "later" } else { "earlier" };
            let word = if steps == 1 { "step" } else { "steps" };
            title = format!("{title}, the second {steps} {word} {way}");
        }
    }
    if let Some(asked) = &options.region {
        title = format!("{title} in {}", asked.name);
    }
    format!("{title}, where {least} % or more hold data")
}

/// What is said of anomalies.
fn of_anomalies(options: &MapOptions, base: BasePeriod) -> String {
    let of = options.anomaly_step.map_or_else(String::new, |step| {
        format!(" of means of {}", in_means(step))
    });
    match PartsOfYear::of(options) {
        PartsOfYear::Bins(bins) => format!("anomaly{of} from {base} by {bins}"),
        PartsOfYear::Whole => format!("anomaly{of} from {base}"),
    }
}

/// Means of a step, for people.
fn in_means(step: TimeStep) -> &'static str {
    match step {
        TimeStep::Native => "steps",
        TimeStep::Day => "days",
        TimeStep::Week => "weeks",
        TimeStep::Month => "months",
        TimeStep::Season => "seasons",
        TimeStep::Year => "years",
        TimeStep::Total => "all the time",
    }
}

/// Every step that is written.
fn outputs(
    sources: SourcesOf<'_>,
    options: &MapOptions,
    (ranges, pairs): (&Ranges, Option<&Pairs>),
) -> Result<Vec<Output>, ContractError> {
    let (source, statistic) = (sources.first, options.statistic);
    let (bins, base) = (options.bins, ranges.base);
    let inputs = fields(source, &ranges.read);
    let second = sources.second.zip(pairs);
    let with = second.map(|(second, pairs)| fields(second, &pairs.reads[1]));
    let made_of = |output: usize| {
        Digest::of_json(&MadeOf {
            kind: "statistic",
            method: method(statistic),
            options,
            region: options.region.as_ref().map(|asked| &asked.region),
            base,
            output,
            read: &inputs,
            with: with.as_deref(),
        })
    };
    Ok(match statistic {
        MapStatistic::Climatology => {
            let output = |(index, (bin, period)): (usize, (usize, Period))| Output {
                period,
                origin: format!("{} of {base}", bins.title(bin)),
                made_of: made_of(index),
            };
            let written = written_bins(bins, base)?.into_iter();
            written.enumerate().map(output).collect()
        }
        MapStatistic::Anomaly => {
            // One digest of the normals, then one a step: of thousands of steps each would name all others.
            let normals = made_of(0);
            let of_step = |mean: &MeanOf| {
                let step = &source.steps[mean.steps.start];
                Output {
                    period: step.period,
                    origin: format!("{} less {base}", step.origin),
                    made_of: Digest::of_json(&("anomaly", normals, step.period, &step.field)),
                }
            };
            let of_mean = |mean: &MeanOf| {
                let read = fields(source, &mean.steps);
                Output {
                    period: mean.period,
                    origin: format!("mean of {} steps less {base}", read.len()),
                    made_of: Digest::of_json(&("anomaly of a mean", normals, mean.period, read)),
                }
            };
            let all = ranges.anomalies_of.iter();
            match ranges.normals_of {
                None => all.map(of_step).collect(),
                Some(_) => all.map(of_mean).collect(),
            }
        }
        _ => {
            let (over, count) = match pairs {
                Some(pairs) => (pairs.extent(), format!("{} pairs", pairs.most())),
                None => (
                    extent(source, &ranges.read),
                    format!("{} steps", inputs.len()),
                ),
            };
            vec![Output {
                period: over,
                origin: format!("{statistic} of {count}, {over}"),
                made_of: made_of(0),
            }]
        }
    })
}

/// What some steps hold.
fn fields<'a>(source: &'a Manifest, read: &Range<usize>) -> Vec<(Period, &'a ObjectKey)> {
    let steps = source.steps[read.clone()].iter();
    steps.map(|step| (step.period, &step.field)).collect()
}

fn check_steps(
    statistic: MapStatistic,
    parts: PartsOfYear,
    periods: &[Period],
) -> Result<(), ContractError> {
    let refused = |reason: String| {
        Err(ContractError::invalid(
            "statistic",
            &statistic.to_string(),
            reason,
        ))
    };
    if let (true, PartsOfYear::Bins(bins)) = (statistic.has_bins(), parts) {
        if bins == CalendarBins::Day {
            return refused("maps are made of months and seasons".to_owned());
        }
        let step_s = longest_s(periods);
        if step_s > bins.longest_step_s() {
            return refused(format!(
                "steps of {:.0} days have no {bins}",
                step_s / 86_400.0
            ));
        }
    }
    if statistic == MapStatistic::Spread && periods.len() < 2 {
        return refused("one step has no spread".to_owned());
    }
    Ok(())
}

fn adjective(bins: CalendarBins) -> &'static str {
    match bins {
        CalendarBins::Month => "monthly",
        CalendarBins::Season => "seasonal",
        CalendarBins::Day => "daily",
    }
}

/// Bins in the order of their periods, which are those of the base period's middle year: winter ends in it.
fn written_bins(
    bins: CalendarBins,
    base: BasePeriod,
) -> Result<Vec<(usize, Period)>, ContractError> {
    let year = base.middle_year();
    match bins {
        CalendarBins::Month | CalendarBins::Day => (0..12)
            .map(|month| Ok((month, Period::month(year, month as u32 + 1)?)))
            .collect(),
        CalendarBins::Season => (0..4)
            .map(|season| {
                let first = match season {
                    0 => Period::month(year - 1, 12)?,
                    season => Period::month(year, 3 * season)?,
                };
                let last = Period::month(year, 3 * season + 2)?;
                Ok((season as usize, Period::new(first.start, last.end)?))
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_written_in_the_middle_year_and_winter_ends_in_it() {
        let base: BasePeriod = "1991/2020".parse().unwrap();
        let months = written_bins(CalendarBins::Month, base).unwrap();
        assert_eq!(
            (months.len(), months[1].1),
            (12, Period::month(2005, 2).unwrap())
        );
        let seasons = written_bins(CalendarBins::Season, base).unwrap();
        assert_eq!(seasons[0].1.start.to_string(), "2004-12-01T00:00:00Z");
        assert_eq!(seasons[0].1.end, seasons[1].1.start);
        assert_eq!(seasons[3].1.end.to_string(), "2005-12-01T00:00:00Z");
    }
}
