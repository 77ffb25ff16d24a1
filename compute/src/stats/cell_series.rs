//! Stored values of one cell at every step, read out of a product's time-major series.

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, SeriesSegment};
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::datatypes::Float32Type;

use crate::scan::{self, Layout};
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// One block of a time-major file, and of it one cell's run of steps.
const SERIES_AT: &str = "SELECT series_at(\"values\", CAST($cell AS BIGINT), CAST($steps AS BIGINT)) FROM series WHERE block = CAST($block AS INT UNSIGNED)";

/// Values of one cell of a version of a product, one for each of its steps, stored unit; NaN where there is no data.
pub(crate) async fn cell_values(
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
