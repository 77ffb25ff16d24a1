//! Series as they are analysed: read from a product, as periods with values beside them.

use contract::analysis::{SeriesPlace, SeriesQuery};
use contract::cited::Cited;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::quantity::Quantity;
use contract::series::RegionValue;
use contract::statistics::{MinCoverage, Statistic, StatisticsAnswer};
use contract::time::Period;

use crate::point::point_series_of;
use crate::reduce::statistics_of;
use crate::stats::region_series_of;
use crate::summed::check_averaged_in_a_cell;
use crate::{ComputeError, Engine};

/// Share of a region's sea, or of a line, below which a step is told of, percent.
const LITTLE_PERCENT: f64 = 50.0;

/// A version of a product with its name, which is costly to compute.
pub type Version<'a> = (&'a Manifest, &'a ManifestId);

/// A series and all that is needed to cite it.
#[derive(Debug, Clone)]
pub(crate) struct ReadSeries {
    pub(crate) cited: Cited,
    pub(crate) place: SeriesPlace,
    /// The asked period; all that the version covers where its ends are left open.
    pub(crate) window: Period,
    /// In the order of time; steps across the ends of the asked period are whole, at places, over regions and along lines.
    pub(crate) periods: Vec<Period>,
    /// Beside them, in the unit that people read, NaN no data.
    pub(crate) values: Vec<f64>,
    /// Steps that hold data over less of a region or line than asked for: they are NaN.
    pub(crate) left_out: usize,
    pub(crate) notes: Vec<String>,
}

impl ReadSeries {
    /// All that was read.
    pub(crate) fn extent(&self) -> Period {
        let (first, last) = (self.periods.first(), self.periods.last());
        let (first, last) = (
            first.expect("steps were asked for"),
            last.expect("the same"),
        );
        Period {
            start: first.start,
            end: last.end,
        }
    }

    /// What of a step lies in the asked period.
    pub(crate) fn within(&self, step: Period) -> Period {
        Period {
            start: step.start.max(self.window.start),
            end: step.end.min(self.window.end),
        }
    }

    /// Means over something, without those over less of it than `least`; `of_what` is what coverage is a share of.
    fn take_means(&mut self, series: &[CoveredMean], least: MinCoverage, of_what: &str) {
        let (all, mut little) = (series.len(), 0);
        for step in series {
            let is_out = step.mean.is_some() && !least.is_met(step.coverage_percent);
            let mean = step.mean.filter(|_mean| !is_out);
            self.periods.push(step.period);
            self.values.push(mean.unwrap_or(f64::NAN));
            self.left_out += usize::from(is_out);
            little += usize::from(mean.is_some() && step.coverage_percent < LITTLE_PERCENT);
        }
        if self.left_out > 0 {
            self.notes.push(format!(
                "{} of {all} steps hold data over less than {} % of the {of_what} and are left out",
                self.left_out,
                least.percent()
            ));
        }
        if little > 0 {
            self.notes.push(format!(
                "{little} of {all} steps hold data over less than half of the {of_what}; each counts as much as the others"
            ));
        }
    }

    /// Says of a cell how many steps hold data, where some do not.
    fn tell_gaps(&mut self) {
        let (all, held) = (self.values.len(), self.value_count());
        if held < all {
            self.notes
                .push(format!("{held} of {all} steps hold data in this cell"));
        }
    }

    /// Steps with data.
    pub(crate) fn value_count(&self) -> usize {
        self.values.iter().filter(|value| !value.is_nan()).count()
    }
}

/// The mean of a step, and how much it is a mean of.
struct CoveredMean {
    period: Period,
    mean: Option<f64>,
    coverage_percent: f64,
}

impl CoveredMean {
    fn over_region(step: &RegionValue) -> Self {
        let (start, end) = (step.start, step.end);
        Self {
            period: Period { start, end },
            mean: step.mean,
            coverage_percent: step.coverage_percent,
        }
    }

    /// Of native steps that reach into the asked period, each of which has a row that ends with the period.
    fn along_line(answer: &StatisticsAnswer, steps: &[&Step]) -> Vec<Self> {
        let means = answer.series(Statistic::Mean).into_iter();
        let rows = means.zip(&answer.rows).zip(steps);
        rows.map(|(((_cut, mean), row), step)| Self {
            period: step.period,
            mean,
            coverage_percent: row.coverage_percent,
        })
        .collect()
    }
}

/// The series of a version of a product, without steps that hold data over less of a region's sea, or of a line, than `least`.
///
/// # Errors
/// No step in the asked period, a place, region or line outside the grid, codes of a mask, and what reading meets.
pub(crate) async fn series(
    engine: &Engine,
    (manifest, id): Version<'_>,
    query: &SeriesQuery,
    least: MinCoverage,
) -> Result<ReadSeries, ComputeError> {
    let (from, to) = query.window();
    let (window, inside) = manifest.steps_inside(from, to)?;
    let mut read = ReadSeries {
        cited: Cited::of(manifest, id.clone()),
        place: SeriesPlace {
            region: None,
            line: None,
            cell: None,
        },
        window,
        periods: vec![],
        values: vec![],
        left_out: 0,
        notes: vec![],
    };
    match query {
        SeriesQuery::Cell { place, .. } => {
            check_averaged_in_a_cell(manifest)?;
            let found = point_series_of(engine, manifest, id.clone(), *place).await?;
            read.place.cell = Some(found.cell);
            for step in found.series {
                let (start, end) = (step.start, step.end);
                let period = Period { start, end };
                if period.overlaps(window) {
                    read.periods.push(period);
                    read.values.push(step.value.unwrap_or(f64::NAN));
                }
            }
            read.tell_gaps();
        }
        SeriesQuery::Region(asked) => {
            let found = region_series_of(engine, asked, manifest).await?;
            read.place.region = Some(found.region);
            read.notes = found.notes;
            let means: Vec<_> = found.series.iter().map(CoveredMean::over_region).collect();
            read.take_means(&means, least, "region's sea");
        }
        SeriesQuery::Line(asked) => {
            let found = statistics_of(engine, &asked.statistics(), manifest, id.clone()).await?;
            let means = CoveredMean::along_line(&found, &inside);
            read.place.line = Some(found.geometry);
            read.notes = found.notes;
            read.take_means(&means, least, "line");
        }
    }
    if manifest.quantity == Quantity::AccumulatedCarbon {
        let note = "values are sums up to the end of each step, not means over it";
        read.notes.push(note.to_owned());
    }
    Ok(read)
}
