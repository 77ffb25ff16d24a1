//! Series as they are analysed: read from a product, as periods with values beside them.

use contract::analysis::{SeriesPlace, SeriesQuery};
use contract::cited::Cited;
use contract::manifest::{Manifest, ManifestId};
use contract::quantity::Quantity;
use contract::time::Period;

use crate::point::point_series_of;
use crate::stats::region_series_of;
use crate::{ComputeError, Engine};

/// Share of a region's sea below which a step is told of, percent.
const LITTLE_PERCENT: f64 = 50.0;

/// A version of a product with its name, which is costly to compute.
pub type Version<'a> = (&'a Manifest, &'a ManifestId);

/// A series and all that is needed to cite it.
#[derive(Debug, Clone)]
pub(crate) struct ReadSeries {
    pub(crate) cited: Cited,
    pub(crate) place: SeriesPlace,
    /// In the order of time.
    pub(crate) periods: Vec<Period>,
    /// Beside them, in the unit that people read, NaN no data.
    pub(crate) values: Vec<f64>,
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

    /// Steps with data.
    pub(crate) fn value_count(&self) -> usize {
        self.values.iter().filter(|value| !value.is_nan()).count()
    }
}

/// The series of a version of a product.
///
/// # Errors
/// No step in the asked period, a place or region outside the grid, and what reading meets.
pub(crate) async fn series(
    engine: &Engine,
    (manifest, id): Version<'_>,
    query: &SeriesQuery,
) -> Result<ReadSeries, ComputeError> {
    let (from, to) = query.window();
    let (window, _inside) = manifest.steps_inside(from, to)?;
    let mut read = ReadSeries {
        cited: Cited::of(manifest, id.clone()),
        place: SeriesPlace {
            region: None,
            cell: None,
        },
        periods: vec![],
        values: vec![],
        notes: vec![],
    };
    match query {
        SeriesQuery::Cell { place, .. } => {
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
        }
        SeriesQuery::Region(asked) => {
            let found = region_series_of(engine, asked, manifest).await?;
            read.place.region = Some(found.region);
            read.notes = found.notes;
            let mut little = 0;
            for step in &found.series {
                let (start, end) = (step.start, step.end);
                read.periods.push(Period { start, end });
                read.values.push(step.mean.unwrap_or(f64::NAN));
                little +=
                    usize::from(step.mean.is_some() && step.coverage_percent < LITTLE_PERCENT);
            }
            if little > 0 {
                let all = found.series.len();
                read.notes.push(format!(
                    "{little} of {all} steps hold data over less than half of the region's sea; each counts as much as the others"
                ));
            }
        }
    }
    if manifest.quantity == Quantity::AccumulatedCarbon {
        let note = "values are sums up to the end of each step, not means over it";
        read.notes.push(note.to_owned());
    }
    Ok(read)
}
