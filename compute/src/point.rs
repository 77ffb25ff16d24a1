//! The series of a product at one place.

use contract::cited::Cited;
use contract::grid::{LonLatDeg, rounded_deg};
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::series::{Cell, PointSeries, PointValue};
use futures::future::BoxFuture;

use crate::derive::counts_at_cell;
use crate::stats::cell_values;
use crate::{ComputeError, Engine, catalogue};

/// The series of the cell that holds a place.
pub fn point_series<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    place: LonLatDeg,
) -> BoxFuture<'a, Result<PointSeries, ComputeError>> {
    Box::pin(async move {
        let manifest = catalogue::product(engine.store(), product).await?;
        point_series_of(engine, &manifest, manifest.id(), place).await
    })
}

/// The same of one version of a product; `id` is its name, which is costly to compute.
pub fn point_series_of<'a>(
    engine: &'a Engine,
    manifest: &'a Manifest,
    id: ManifestId,
    place: LonLatDeg,
) -> BoxFuture<'a, Result<PointSeries, ComputeError>> {
    Box::pin(async move {
        let (row, col) = manifest.cell_inside(place)?;
        let display = manifest.quantity.display();
        let shown = |value: f32| f64::from(value) * display.factor + display.offset;
        let values = cell_values(engine, manifest, &id, row, col).await?;
        let counts = counts_at_cell(engine, manifest, row, col).await?;
        let point = |(index, step): (usize, &contract::manifest::Step)| PointValue {
            start: step.period.start,
            end: step.period.end,
            mid: step.period.mid(),
            value: (!values[index].is_nan()).then(|| shown(values[index])),
            contributed: counts.as_ref().map(|counts| counts[index]),
        };
        let center = manifest.grid.cell_center(row, col);
        Ok(PointSeries {
            cited: Cited::of(manifest, id),
            lon_deg: rounded_deg(place.lon),
            lat_deg: rounded_deg(place.lat),
            cell: Cell {
                row,
                col,
                lon_deg: rounded_deg(center.lon),
                lat_deg: rounded_deg(center.lat),
            },
            series: manifest.steps.iter().enumerate().map(point).collect(),
        })
    })
}
