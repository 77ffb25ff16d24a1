//! The series of a product at one place.

use contract::digest::Digest;
use contract::grid::LonLatDeg;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId, SeriesSegment};
use contract::product::ProductId;
use contract::time::TimeMs;
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::datatypes::Float32Type;
use serde::{Deserialize, Serialize};

use crate::derive::{CellCounts, counts_at_cell};
use crate::scan::{self, Layout};
use crate::session::QueryContext;
use crate::{ComputeError, Engine, catalogue};

/// The cell that a place lies in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Row, 0 north.
    pub row: u32,
    /// Column, 0 west.
    pub col: u32,
    /// Longitude of its centre, degrees.
    pub lon: f64,
    /// Latitude of its centre, degrees.
    pub lat: f64,
}

/// One value of a series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PointValue {
    /// First instant that it covers.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// The middle.
    pub mid: TimeMs,
    /// Value in the answer's unit; none where the cell holds no data.
    pub value: Option<f64>,
    /// What a sum of accumulated carbon holds; none for other values, and where nobody can tell any more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contributed: Option<CellCounts>,
}

/// A series with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointAnswer {
    /// Product.
    pub product: ProductId,
    /// The version of the product that was read.
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Name of the quantity.
    pub quantity: String,
    /// Unit of the values.
    pub unit: String,
    /// Asked longitude, degrees, in [-180, 180).
    pub lon: f64,
    /// Asked latitude, degrees.
    pub lat: f64,
    /// The cell that holds the place: the values are its mean, not those of the very place.
    pub cell: Cell,
    /// Values in the order of time.
    pub series: Vec<PointValue>,
}

/// One block of a time-major file, and of it one cell's run of steps.
const SERIES_AT: &str = "SELECT series_at(\"values\", CAST($cell AS BIGINT), CAST($steps AS BIGINT)) FROM series WHERE block = CAST($block AS INT UNSIGNED)";

/// The series of the cell that holds a place.
pub async fn point_series(
    engine: &Engine,
    product: &ProductId,
    place: LonLatDeg,
) -> Result<PointAnswer, ComputeError> {
    let manifest = catalogue::product(engine.store(), product).await?;
    let Some((row, col)) = manifest.grid.cell_at(place) else {
        let bounds = catalogue::bounds_text(&manifest);
        return Err(ComputeError::PlaceOutside {
            product: product.clone(),
            place,
            bounds,
        });
    };
    let display = manifest.quantity.display();
    let shown = |value: f32| f64::from(value) * display.factor + display.offset;
    let values = cell_values(engine, &manifest, row, col).await?;
    let counts = counts_at_cell(engine, &manifest, row, col).await?;
    let point = |(index, step): (usize, &contract::manifest::Step)| PointValue {
        start: step.period.start,
        end: step.period.end,
        mid: step.period.mid(),
        value: (!values[index].is_nan()).then(|| shown(values[index])),
        contributed: counts.as_ref().map(|counts| counts[index]),
    };
    let center = manifest.grid.cell_center(row, col);
    Ok(PointAnswer {
        product: manifest.product.clone(),
        manifest: manifest.id(),
        title: manifest.title.clone(),
        source: manifest.source.clone(),
        synthetic: manifest.synthetic,
        quantity: manifest.quantity.title().to_owned(),
        unit: display.unit.to_owned(),
        lon: place.lon,
        lat: place.lat,
        cell: Cell {
            row,
            col,
            lon: center.lon,
            lat: center.lat,
        },
        series: manifest.steps.iter().enumerate().map(point).collect(),
    })
}

/// Values of one cell of a version of a product, one for each of its steps, stored unit; NaN where there is no data.
pub async fn cell_values(
    engine: &Engine,
    manifest: &Manifest,
    row: u32,
    col: u32,
) -> Result<Vec<f32>, ComputeError> {
    let mut values = Vec::with_capacity(manifest.steps.len());
    for segment in &manifest.series {
        values.extend(segment_values(engine, manifest, segment, row, col).await?);
    }
    if values.len() != manifest.steps.len() {
        let reason = format!(
            "{} values in its series for {} steps",
            values.len(),
            manifest.steps.len()
        );
        return Err(ComputeError::inconsistent(
            manifest.id().to_string(),
            reason,
        ));
    }
    Ok(values)
}

/// Stored values of one cell in one segment of time.
async fn segment_values(
    engine: &Engine,
    manifest: &Manifest,
    segment: &SeriesSegment,
    row: u32,
    col: u32,
) -> Result<Vec<f32>, ComputeError> {
    let (block, cell) = storage::series::block_of(&manifest.grid, row, col);
    let sql = SERIES_AT
        .replace("$cell", &cell.to_string())
        .replace("$steps", &segment.steps.to_string())
        .replace("$block", &block.to_string());
    let job = Digest::of_json(&("series", &segment.series, &sql));
    let answered = async {
        let asked = engine.answer(job, |context| ask(engine, context, &segment.series, &sql));
        only_row(&asked.await?).ok_or_else(|| {
            let reason = format!("no single block {block}");
            ComputeError::inconsistent(segment.series.to_string(), reason)
        })
    };
    scan::or_damaged(
        engine.store(),
        &[&segment.series],
        scan::caught(Box::pin(answered)).await,
    )
    .await
}

/// The values of an answer of one row.
fn only_row(batches: &[RecordBatch]) -> Option<Vec<f32>> {
    let mut with_rows = batches.iter().filter(|batch| batch.num_rows() > 0);
    let batch = with_rows.next().filter(|batch| batch.num_rows() == 1)?;
    let values = batch.column(0).as_list::<i32>().value(0);
    with_rows
        .next()
        .is_none()
        .then(|| values.as_primitive::<Float32Type>().values().to_vec())
}

async fn ask(
    engine: &Engine,
    context: QueryContext,
    series: &ObjectKey,
    sql: &str,
) -> Result<Vec<RecordBatch>, ComputeError> {
    let store = engine.store();
    scan::register(&context, "series", store, &[series], Layout::Series).await?;
    let failed = || ComputeError::engine("reading a series");
    let query = context.sql(sql).await.map_err(failed())?;
    query.collect().await.map_err(failed())
}
