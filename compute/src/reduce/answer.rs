//! Statistics of a version over a geometry: what is asked put together, passes over the values, rows.

mod small_means;
mod small_stds;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use contract::cited::Cited;
use contract::digest::Digest;
use contract::geometry::{Geometry, Sampling};
use contract::manifest::{Manifest, ManifestId};
use contract::quantity::{Display, Quantity};
use contract::statistics::{
    Percentile, Statistic, StatisticNote, StatisticsAnswer, StatisticsQuery, StatisticsRow,
};
use contract::time::{Period, TimeStep};
use cube::Values;
use cube::scale::Scale;
use futures::future::BoxFuture;

use super::accumulator::{Accumulated, too_large};
use super::bins::{BinSums, bin_sums, times};
use super::percentiles::Searches;
use super::question::{Piece, Question, Wanted};
use super::run::{changed_meanwhile, opened, run};
use super::scales::{Extremes, between, small_bins};
use super::tasks::Version;
use super::weighed::Weighed;
use crate::budget::rows::coverage_percent;
use crate::complete_sums::told_of_sums;
use crate::summed::{check_averaged, check_averaged_in_a_cell, holds_codes};
use crate::{ComputeError, Engine, catalogue};

/// Statistics of the newest version of a product.
pub fn statistics<'a>(
    engine: &'a Engine,
    query: &'a StatisticsQuery,
) -> BoxFuture<'a, Result<StatisticsAnswer, ComputeError>> {
    Box::pin(async move {
        let manifest = catalogue::product(engine.store(), &query.product).await?;
        statistics_of(engine, query, &manifest, manifest.id()).await
    })
}

/// The same of one version; `id` is its name, which is costly to compute.
pub fn statistics_of<'a>(
    engine: &'a Engine,
    query: &'a StatisticsQuery,
    manifest: &'a Manifest,
    id: ManifestId,
) -> BoxFuture<'a, Result<StatisticsAnswer, ComputeError>> {
    Box::pin(async move {
        let are_codes = holds_codes(manifest);
        // The least and the greatest of codes are codes of these cells.
        let averages_none = |one: Statistic| match one {
            Statistic::Count | Statistic::Coverage => true,
            Statistic::Min | Statistic::Max => are_codes,
            _ => false,
        };
        let is_one_cell = matches!(
            query.geometry,
            Geometry::Point {
                sampling: Sampling::Cell,
                ..
            }
        );
        if !query.statistics.iter().all(averages_none) {
            match (is_one_cell, query.step) {
                (false, _) => check_averaged(manifest)?,
                (true, TimeStep::Native) => {}
                (true, _) => check_averaged_in_a_cell(manifest)?,
            }
        }
        let (window, inside) = manifest.steps_inside(query.from, query.to)?;
        let periods: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
        let bins = query.step.bins(window, periods.iter().copied())?;
        let mut weighed = Weighed::of(engine, manifest, query).await?;
        if let Some(last) = inside.last() {
            let told = told_of_sums(engine, manifest, &weighed.whole, last).await?;
            weighed.notes.extend(told);
        }
        let inside = (window, inside.len());
        let asked = Reduction::of(engine, (manifest, &id), &weighed, inside).await?;
        let (bins, scales) = asked.summed(&periods, &bins, wanted(query)).await?;
        let small_stds = asked.small_stds(query, (&bins, &scales), &periods);
        let small_stds = small_stds.await?;
        let percentiles = asked.percentiles(query, &bins, &periods).await?;
        let rows = Rows {
            query,
            weighed: &weighed,
            display: manifest.quantity.display(),
            scales: &scales,
            small_stds: &small_stds,
            steps: &periods,
            percentiles: &percentiles,
        };
        let rows = bins.iter().enumerate().map(|(at, bin)| rows.row(at, bin));
        let rows: Vec<StatisticsRow> = rows.collect();
        Ok(answer((manifest, id), query, weighed, rows))
    })
}

/// Which sums are asked for.
fn wanted(query: &StatisticsQuery) -> Wanted {
    let of_extremes = |one: Statistic| match one {
        // Percentiles are looked for between them.
        Statistic::Min | Statistic::Max | Statistic::Median | Statistic::Percentile(_) => true,
        Statistic::Mean
        | Statistic::Sum
        | Statistic::Std
        | Statistic::Count
        | Statistic::Coverage => false,
    };
    Wanted::Sums {
        with_squares: query.statistics.iter().any(|one| one == Statistic::Std),
        with_extremes: query.statistics.iter().any(of_extremes),
    }
}

fn answer(
    (manifest, id): (&Manifest, ManifestId),
    query: &StatisticsQuery,
    weighed: Weighed,
    rows: Vec<StatisticsRow>,
) -> StatisticsAnswer {
    let note = |statistic: Statistic| StatisticNote {
        name: statistic.to_string(),
        unit: unit_of(statistic, manifest.quantity, weighed.size_unit),
        what: statistic.what(),
    };
    StatisticsAnswer {
        cited: Cited::of(manifest, id),
        kind: query.geometry.kind().to_owned(),
        geometry: query.geometry_name.clone(),
        step: query.step,
        earth: query.earth,
        cells: query.cells,
        statistics: query.statistics.iter().map(note).collect(),
        coverage_basis: weighed.coverage_basis.to_owned(),
        size: weighed.size,
        size_unit: weighed.size_unit.to_owned(),
        min_coverage_percent: query.min_coverage.percent(),
        ocean_source: weighed.ocean_source,
        notes: weighed.notes,
        rows,
    }
}

fn unit_of(statistic: Statistic, quantity: Quantity, size_unit: &str) -> String {
    let unit = quantity.display().unit;
    match statistic {
        Statistic::Count => "1".to_owned(),
        Statistic::Coverage => "%".to_owned(),
        Statistic::Sum if size_unit != "1" => format!("{unit} {size_unit}").trim().to_owned(),
        // A difference of degrees Celsius is one of kelvins.
        Statistic::Std if quantity.display().offset != 0.0 => quantity.unit().to_owned(),
        Statistic::Mean
        | Statistic::Sum
        | Statistic::Min
        | Statistic::Max
        | Statistic::Std
        | Statistic::Median
        | Statistic::Percentile(_) => unit.to_owned(),
    }
}

/// What every pass over the values is about.
pub(super) struct Reduction<'a> {
    engine: &'a Engine,
    manifest: &'a Manifest,
    /// The name of the version, which is costly to compute.
    id: &'a ManifestId,
    /// The version along time, where it can be opened.
    values: Option<Values>,
    weighed: &'a Weighed,
    /// Steps that reach into the period.
    steps: Range<u32>,
    /// What values are summed in.
    scale: Scale,
    /// Of a quantity that says nothing of its values, where they lie in every step.
    extremes: Extremes,
}

impl<'a> Reduction<'a> {
    /// About the steps of a version that reach into a period, and how many do. Values are summed in the scale of their quantity, or in one of their own
    /// where it says nothing of them, which a pass over them finds.
    pub(super) async fn of(
        engine: &'a Engine,
        (manifest, id): (&'a Manifest, &'a ManifestId),
        weighed: &'a Weighed,
        (window, count): (Period, usize),
    ) -> Result<Self, ComputeError> {
        let steps = &manifest.steps;
        let first = steps.partition_point(|step| step.period.end <= window.start);
        let mut own = Self {
            engine,
            manifest,
            id,
            values: opened(engine, manifest, id).await?,
            weighed,
            steps: first as u32..(first + count) as u32,
            scale: Scale::of_all(),
            extremes: Extremes::new(),
        };
        if let Some(of_quantity) = Scale::of(manifest.quantity) {
            own.scale = of_quantity;
            return Ok(own);
        }
        own.extremes = own.found_extremes().await?;
        if let Some((low, high)) = between(own.extremes.values().copied()) {
            own.scale = Scale::over((low.into(), high.into()));
        }
        Ok(own)
    }

    /// Sums of every bin, and the scale that each is in: that of all values, or one of its own where its values are far below the largest of
    /// all, which takes another pass over their steps.
    pub(super) async fn summed(
        &self,
        periods: &[Period],
        bins: &[Period],
        wanted: Wanted,
    ) -> Result<(Vec<BinSums>, Vec<Scale>), ComputeError> {
        let found = self.accumulated(wanted.clone()).await?;
        let mut sums = bin_sums(periods, bins, &found).ok_or_else(too_large)?;
        let mut scales = vec![self.scale; bins.len()];
        let accumulates = self.manifest.quantity == Quantity::AccumulatedCarbon;
        if self.extremes.is_empty() && !accumulates {
            return Ok((sums, scales));
        }
        let steps_of = bins.iter().map(|bin| times(periods, *bin).1);
        let steps_of = steps_of.map(|times| times.into_iter().map(|(step, _)| step).collect());
        let steps_of: Vec<Vec<u32>> = steps_of.collect();
        let small = if accumulates {
            self.small_means(&sums, &steps_of).await?
        } else {
            small_bins(&self.extremes, &steps_of)
        };
        for small in small {
            let periods_of: Vec<Period> = small.bins.iter().map(|bin| bins[*bin]).collect();
            let asked = (small.scale, wanted.clone());
            let own = self.summed_again(asked, &small.steps, (periods, &periods_of));
            for (bin, own) in small.bins.into_iter().zip(own.await?) {
                (sums[bin], scales[bin]) = (own, small.scale);
            }
        }
        Ok((sums, scales))
    }

    /// Sums of some bins in a scale that holds all values of their `steps`.
    async fn summed_again(
        &self,
        (scale, wanted): (Scale, Wanted),
        steps: &BTreeSet<u32>,
        (periods, bins): (&[Period], &[Period]),
    ) -> Result<Vec<BinSums>, ComputeError> {
        let question = self.question(scale, wanted);
        // Runs along time are read whole, with larger values in them.
        let fields = self.fields_alone(steps.iter().copied());
        let found = self.of_fields(question, fields).await?;
        bin_sums(periods, bins, &found).ok_or_else(too_large)
    }

    fn version(&self) -> Version<'_> {
        Version {
            store: self.engine.store(),
            manifest: self.manifest,
            id: self.id,
            values: self.values.as_ref(),
        }
    }

    fn question(&self, scale: Scale, wanted: Wanted) -> Question {
        let weighed = self.weighed;
        let [whole, covered] = weighed.addresses.clone();
        Question {
            version: self.id.clone(),
            shape: weighed.shape,
            whole,
            covered,
            unit: weighed.unit,
            scale,
            wanted,
        }
    }

    /// Passes over the values. Sums of whole runs are remembered, and not asked for a second time.
    pub(super) async fn accumulated(&self, wanted: Wanted) -> Result<Accumulated, ComputeError> {
        let (version, question) = (self.version(), self.question(self.scale, wanted));
        let known = self.engine.objects().remembered();
        let (mut all, mut pieces, mut new) = (Accumulated::default(), vec![], vec![]);
        let (stored, own_name) = (question.in_stored_sums(), question.sums_name());
        for run in version.runs(self.steps.clone(), &self.weighed.cells(), stored) {
            let name = run.name.zip(own_name);
            let name = name.map(|names| Digest::of_json(&names));
            if let Some(sums) = name.and_then(|name| known.get(&name)) {
                let first = run.steps.start;
                let own = sums.iter().map(|(step, sums)| (first + step, *sums));
                all.steps.extend(own);
                continue;
            }
            pieces.extend(run.pieces);
            new.extend(name.map(|name| (name, run.steps)));
        }
        if !pieces.is_empty() {
            let values = self.values.clone();
            let Some(found) = run(self.engine, question.clone(), values, pieces).await? else {
                let fields = self.fields_alone(self.steps.clone());
                return self.of_fields(question, fields).await;
            };
            all.merge(found)?;
        }
        for (name, steps) in new {
            let own = all.steps.range(steps.clone());
            let own = own.map(|(step, sums)| (step - steps.start, *sums));
            known.insert(name, own.collect());
        }
        Ok(all)
    }

    fn fields_alone(&self, steps: impl Iterator<Item = u32>) -> Vec<Piece> {
        self.version().fields_alone(steps, &self.weighed.cells())
    }

    /// The same of fields alone, which never change.
    async fn of_fields(
        &self,
        question: Question,
        fields: Vec<Piece>,
    ) -> Result<Accumulated, ComputeError> {
        let found = run(self.engine, question, None, fields).await?;
        found.ok_or_else(changed_meanwhile)
    }

    /// Where the values of every step lie that there are, also of steps that are read along with those that were asked for.
    async fn found_extremes(&self) -> Result<Extremes, ComputeError> {
        let wanted = Wanted::Sums {
            with_squares: false,
            with_extremes: true,
        };
        Ok(extremes_of(&self.accumulated(wanted).await?))
    }

    /// The percentiles of every bin that are asked for, stored unit.
    async fn percentiles(
        &self,
        query: &StatisticsQuery,
        bins: &[BinSums],
        periods: &[Period],
    ) -> Result<BTreeMap<(usize, Percentile), f32>, ComputeError> {
        let wanted = query.statistics.iter().filter_map(Statistic::percentile);
        let mut searches = Searches::new(bins, &wanted.collect::<Vec<_>>());
        while let Some(pass) = searches.next_pass(bins, periods) {
            let found = self.accumulated(pass.wanted.clone()).await?;
            searches.narrow(&pass, &found.histograms).ok_or_else(|| {
                ComputeError::inconsistent("percentiles", "two passes read different values")
            })?;
        }
        Ok(searches.values())
    }
}

/// Where the values of steps lie that hold any.
fn extremes_of(found: &Accumulated) -> Extremes {
    let own = found.steps.iter();
    let own = own.map(|(step, sums)| (*step, (sums.min, sums.max)));
    own.filter(|(_, (min, max))| min <= max).collect()
}

/// What rows are made with.
struct Rows<'a> {
    query: &'a StatisticsQuery,
    weighed: &'a Weighed,
    display: Display,
    /// What each bin was summed in.
    scales: &'a [Scale],
    /// Standard deviations that this does not tell, stored unit, by the numbers of their bins.
    small_stds: &'a BTreeMap<usize, f64>,
    steps: &'a [Period],
    percentiles: &'a BTreeMap<(usize, Percentile), f32>,
}

impl Rows<'_> {
    fn row(&self, at: usize, bin: &BinSums) -> StatisticsRow {
        let coverage_percent = self.coverage_percent(bin);
        let has_data = bin.sums.count > 0;
        let is_withheld = has_data && !self.query.min_coverage.is_met(coverage_percent);
        let value = |statistic: Statistic| match statistic {
            Statistic::Count => Some(bin.sums.count as f64),
            Statistic::Coverage => Some(coverage_percent),
            _ if !has_data || is_withheld => None,
            other => self.value(other, at, bin),
        };
        let named = |statistic: Statistic| (statistic.to_string(), value(statistic));
        let found_at = bin.found_at.filter(|_| has_data && !is_withheld);
        let found = |statistic: Statistic| {
            let [min, max] = found_at?;
            let step = match statistic {
                Statistic::Min => min,
                Statistic::Max => max,
                _ => return None,
            };
            Some((statistic.to_string(), self.steps[step as usize].mid()))
        };
        StatisticsRow {
            start: bin.period.start,
            end: bin.period.end,
            mid: bin.period.mid(),
            values: self.query.statistics.iter().map(named).collect(),
            found_at: self.query.statistics.iter().filter_map(found).collect(),
            coverage_percent,
            step_count: bin.step_count,
            is_withheld,
        }
    }

    /// A statistic of a bin that holds data.
    fn value(&self, statistic: Statistic, at: usize, bin: &BinSums) -> Option<f64> {
        let (sums, scale) = (&bin.sums, self.scales[at]);
        let shown = |value: f64| value * self.display.factor + self.display.offset;
        let mean = || shown(scale.mean(sums.sum, sums.weight));
        match statistic {
            Statistic::Mean => Some(mean()),
            Statistic::Sum => {
                let with_data = sums.weight as f64 * self.weighed.unit.size();
                Some(mean() * with_data / bin.data_time as f64)
            }
            Statistic::Min => Some(shown(sums.min.into())),
            Statistic::Max => Some(shown(sums.max.into())),
            Statistic::Std => {
                let told = self.small_stds.get(&at).copied();
                let std = told.unwrap_or_else(|| scale.std(sums.squares, sums.sum, sums.weight));
                Some(std * self.display.factor.abs())
            }
            Statistic::Median | Statistic::Percentile(_) => {
                let found = self.percentiles.get(&(at, statistic.percentile()?));
                found.map(|value| shown(f64::from(*value)))
            }
            Statistic::Count | Statistic::Coverage => None,
        }
    }

    fn coverage_percent(&self, bin: &BinSums) -> f64 {
        let with_data = bin.sums.covered as f64 * self.weighed.unit.size();
        coverage_percent(with_data / bin.length() as f64, self.weighed.covered_size)
    }
}
