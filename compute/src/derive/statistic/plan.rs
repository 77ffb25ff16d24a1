//! What a derivation of a statistic reads and writes: steps in, steps out, each with the digest of what it is made of.

use std::ops::Range;

use contract::ContractError;
use contract::analysis::{AnalysisOptions, BasePeriod, CalendarBins, MapOptions, MapStatistic};
use contract::computed::{Computation, Computed, ComputedInput, Matching};
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::quantity::Quantity;
use contract::region::Region;
use contract::time::{Period, TimeStep};
use serde::Serialize;

use super::pairs::Pairs;
use super::quantity;
use super::sources::SourcesOf;
use crate::ComputeError;
use crate::analysis::timeline::longest_s;

/// Version of the way statistics are made: it changes when their bits do.
const METHOD: u32 = 1;

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
    pub(super) bins: CalendarBins,
    pub(super) least_share: f64,
    /// Means that trends are drawn through.
    pub(super) step: TimeStep,
    /// What a correlation is made by.
    pub(super) pairs: Option<Pairs>,
    /// How, of what is of two products.
    pub(super) computed: Option<Computed>,
    /// Index of the first step that is read, and of the first one after.
    pub(super) read: Range<usize>,
    /// Index of the first step that an anomaly is written of.
    pub(super) first_written: usize,
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
        let ranges = Ranges::of(source, options)?;
        let read = &source.steps[ranges.read.clone()];
        let periods: Vec<Period> = read.iter().map(|step| step.period).collect();
        check_steps(statistic, options.bins, &periods)?;
        let pairs = pairs(sources, options, &ranges)?;
        let over = match &pairs {
            Some(pairs) => pairs.extent(),
            None => extent(source, &ranges.read),
        };
        let title = title(options, ranges.base, over);
        let least = options.least_percent;
        Ok(Self {
            statistic,
            bins: options.bins,
            least_share: f64::from(least) / 100.0,
            step: options.step,
            computed: computed(sources, options),
            outputs: outputs(sources, options, (&ranges, pairs.as_ref()))?,
            pairs,
            read: ranges.read,
            first_written: ranges.inside.start,
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

    /// Steps that anomalies are written of.
    pub(super) fn written(&self) -> Range<usize> {
        self.first_written..self.first_written + self.outputs.len()
    }

    /// Was a version made of these very steps in this very way?
    pub(super) fn is_up_to_date(&self, latest: &Manifest, source: &Manifest) -> bool {
        let made_of = latest.steps.iter().map(|step| step.raw_sha256);
        latest.derived_from.as_ref() == Some(&source.id())
            && latest.computed == self.computed
            && latest.quantity.is_same_kind(self.quantity)
            && made_of.eq(self.outputs.iter().map(|output| output.made_of))
    }
}

/// Steps by their place.
struct Ranges {
    /// That are read.
    read: Range<usize>,
    /// That lie in the asked period.
    inside: Range<usize>,
    /// Years that normals stand for.
    base: BasePeriod,
}

impl Ranges {
    fn of(source: &Manifest, options: &MapOptions) -> Result<Self, ContractError> {
        let inside = inside(source, options)?;
        // Of bins the base period decides what is read; of anomalies the window what is written.
        let read = match (options.statistic, options.base) {
            (MapStatistic::Climatology | MapStatistic::Anomaly, Some(base)) => {
                in_base(source, base)?
            }
            (MapStatistic::Anomaly, None) => 0..source.steps.len(),
            _ => inside.clone(),
        };
        let base = options.base.filter(|_| options.statistic.has_bins());
        Ok(Self {
            base: base.unwrap_or_else(|| BasePeriod::around(extent(source, &read))),
            read,
            inside,
        })
    }
}

/// Steps that reach into the asked period: they follow each other.
fn inside(source: &Manifest, options: &MapOptions) -> Result<Range<usize>, ContractError> {
    let (window, _steps) = source.steps_inside(options.from, options.to)?;
    let touched = |step: &Step| step.period.overlaps(window);
    let first = source.steps.iter().position(touched).unwrap_or_default();
    let count = source.steps.iter().filter(|step| touched(step)).count();
    Ok(first..first + count)
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

/// How something of two products was made, and of what.
fn computed(sources: SourcesOf<'_>, options: &MapOptions) -> Option<Computed> {
    let (MapStatistic::Correlation(statistic), Some(second), Some(asked)) =
        (options.statistic, sources.second, &options.correlation)
    else {
        return None;
    };
    let input = |(name, manifest): (&str, &Manifest)| ComputedInput {
        name: name.to_owned(),
        manifest: manifest.id(),
        matching: Matching::SamePeriod,
    };
    Some(Computed {
        how: Computation::Correlation {
            statistic,
            lag_steps: asked.lag_steps,
            step: options.step,
            deseasonalised: asked.deseasonalise,
            least_percent: options.least_percent,
        },
        inputs: [("first", sources.first), ("second", second)]
            .map(input)
            .into(),
        from: options.from,
        to: options.to,
    })
}

/// What a title says after that of the product.
fn title(options: &MapOptions, base: BasePeriod, over: Period) -> String {
    let (statistic, least) = (options.statistic, options.least_percent);
    let is_usual = options.step == AnalysisOptions::USUAL_STEP;
    let mut title = match statistic {
        MapStatistic::Climatology => format!("{} climatology {base}", adjective(options.bins)),
        MapStatistic::Anomaly => format!("anomaly from {base} by {}", options.bins),
        _ if statistic.is_of_two() || (statistic.is_trend() && !is_usual) => {
            let (means, over) = (means(options.step), over.in_words());
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

/// Means of a step, for people.
fn means(step: TimeStep) -> &'static str {
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

/// From the first to the last of some steps.
fn extent(source: &Manifest, range: &Range<usize>) -> Period {
    Period {
        start: source.steps[range.start].period.start,
        end: source.steps[range.end - 1].period.end,
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
            method: METHOD,
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
            let output = |step: &Step| Output {
                period: step.period,
                origin: format!("{} less {base}", step.origin),
                made_of: Digest::of_json(&("anomaly", normals, step.period, &step.field)),
            };
            source.steps[ranges.inside.clone()]
                .iter()
                .map(output)
                .collect()
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

/// Steps whose middle lies in a base period: they follow each other.
fn in_base(source: &Manifest, base: BasePeriod) -> Result<Range<usize>, ContractError> {
    let window = base.period();
    let from = source
        .steps
        .partition_point(|step| step.period.mid() < window.start);
    let to = source
        .steps
        .partition_point(|step| step.period.mid() < window.end);
    if from < to {
        return Ok(from..to);
    }
    let covered = source
        .extent()
        .map_or_else(|| "nothing".to_owned(), |all| all.to_string());
    let reason = format!("{} has no step in it; it covers {covered}", source.product);
    Err(ContractError::invalid(
        "base period",
        &base.to_string(),
        reason,
    ))
}

fn check_steps(
    statistic: MapStatistic,
    bins: CalendarBins,
    periods: &[Period],
) -> Result<(), ContractError> {
    let refused = |reason: String| {
        Err(ContractError::invalid(
            "statistic",
            &statistic.to_string(),
            reason,
        ))
    };
    if statistic.has_bins() {
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
