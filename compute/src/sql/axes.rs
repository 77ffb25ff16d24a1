//! What every step, row and column of a product has in its table: instants, latitudes, areas, longitudes.

use std::sync::Arc;

use contract::earth::Earth;
use contract::grid::rounded_deg;
use contract::manifest::Manifest;
use datafusion::arrow::array::{ArrayRef, Float64Array, RecordBatch, TimestampMillisecondArray};
use datafusion::arrow::datatypes::{DataType, Field, Schema};
use datafusion::common::Result;

use super::columns::{Column, instant};

/// One of the three directions of a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axis {
    Steps,
    Rows,
    Cols,
}

impl Axis {
    /// The one along which a column changes, and no other; none for values.
    pub(super) fn of(column: Column) -> Option<Self> {
        match column {
            Column::TimeStart | Column::TimeEnd => Some(Self::Steps),
            Column::Latitude | Column::Area => Some(Self::Rows),
            Column::Longitude => Some(Self::Cols),
            Column::Value => None,
        }
    }
}

/// The axes of a version.
#[derive(Debug)]
pub(super) struct Axes {
    /// Milliseconds since 1970, of each step.
    pub(super) starts_ms: Vec<i64>,
    /// The same of its end.
    pub(super) ends_ms: Vec<i64>,
    /// Centres of rows, degrees north.
    pub(super) latitudes_deg: Vec<f64>,
    /// Area of a cell of each row on WGS84, km².
    pub(super) areas_km2: Vec<f64>,
    /// Centres of columns, degrees east, -180 to 180.
    pub(super) longitudes_deg: Vec<f64>,
}

impl Axes {
    pub(super) fn of(manifest: &Manifest) -> Self {
        let grid = &manifest.grid;
        let instants = |at: fn(&contract::manifest::Step) -> i64| manifest.steps.iter().map(at);
        let area_km2 = |row| grid.cell_area_m2(row, Earth::Wgs84) / 1e6;
        Self {
            starts_ms: instants(|step| step.period.start.ms()).collect(),
            ends_ms: instants(|step| step.period.end.ms()).collect(),
            latitudes_deg: (0..grid.rows)
                .map(|row| rounded_deg(grid.cell_center(row, 0).lat))
                .collect(),
            areas_km2: (0..grid.rows).map(area_km2).collect(),
            longitudes_deg: (0..grid.cols)
                .map(|col| rounded_deg(grid.cell_center(0, col).lon))
                .collect(),
        }
    }

    pub(super) fn len(&self, axis: Axis) -> usize {
        match axis {
            Axis::Steps => self.starts_ms.len(),
            Axis::Rows => self.latitudes_deg.len(),
            Axis::Cols => self.longitudes_deg.len(),
        }
    }

    /// The columns that change along an axis, a row for each of its places.
    pub(super) fn batch(&self, axis: Axis) -> Result<RecordBatch> {
        let own = Column::ALL.into_iter();
        let own = own.filter(|column| Axis::of(*column) == Some(axis));
        let (mut fields, mut columns) = (vec![], vec![]);
        for column in own {
            let (kind, values): (DataType, ArrayRef) = match column {
                Column::TimeStart => (instant(), instants(&self.starts_ms)),
                Column::TimeEnd => (instant(), instants(&self.ends_ms)),
                Column::Latitude => (DataType::Float64, numbers(&self.latitudes_deg)),
                Column::Longitude => (DataType::Float64, numbers(&self.longitudes_deg)),
                Column::Area => (DataType::Float64, numbers(&self.areas_km2)),
                Column::Value => continue,
            };
            fields.push(Field::new(column.name(), kind, false));
            columns.push(values);
        }
        Ok(RecordBatch::try_new(
            Arc::new(Schema::new(fields)),
            columns,
        )?)
    }
}

fn instants(ms: &[i64]) -> ArrayRef {
    Arc::new(TimestampMillisecondArray::from(ms.to_vec()).with_timezone("UTC"))
}

fn numbers(values: &[f64]) -> ArrayRef {
    Arc::new(Float64Array::from(values.to_vec()))
}
