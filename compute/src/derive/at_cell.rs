//! How complete the sums of one cell are, told from the series of the flux that they were accumulated from.

use contract::manifest::Manifest;
use contract::series::CellCounts;
use storage::manifests;

use super::accumulated_from;
use super::source::steps_since;
use crate::stats::cell_values;
use crate::{ComputeError, Engine};

/// What the sums of a cell hold after each step of a version of accumulated carbon; none for other products, and where
/// the version that it was accumulated from is gone.
///
/// Counts are stored by map, which is slow to read for one cell; the series of the source, read once, says the same.
pub(crate) async fn counts_at_cell(
    engine: &Engine,
    manifest: &Manifest,
    row: u32,
    col: u32,
) -> Result<Option<Vec<CellCounts>>, ComputeError> {
    let (Some(id), Some(extent)) = (accumulated_from(manifest), manifest.extent()) else {
        return Ok(None);
    };
    let source = match manifests::load(engine.store(), id).await {
        Ok(source) => source,
        Err(e) if e.is_not_found() => return Ok(None),
        Err(e) => return Err(e.into()),
    };
    let steps = steps_since(&source, Some(extent.start))?;
    let values = cell_values(engine, &source, id, row, col).await?;
    // The first step of the source that is counted.
    let skipped = source.steps.len() - steps.len();
    let is_same = steps.iter().map(|step| step.period);
    if !is_same.eq(manifest.steps.iter().map(|step| step.period)) {
        let reason = format!("its steps are not those of {id}");
        return Err(ComputeError::inconsistent(
            manifest.id().to_string(),
            reason,
        ));
    }
    let (mut had_data, mut with_data_ms) = (0, 0);
    let counts = |(index, (step, value)): (usize, (&super::SourceStep<'_>, &f32))| {
        let (start, end) = (step.period.start.ms(), step.period.end.ms());
        if !value.is_nan() {
            had_data += 1;
            with_data_ms += end - start;
        }
        CellCounts {
            steps: had_data,
            of_steps: index as u32 + 1,
            time_percent: 100.0 * with_data_ms as f64 / (end - extent.start.ms()) as f64,
        }
    };
    let values = &values[skipped..];
    Ok(Some(
        steps.iter().zip(values).enumerate().map(counts).collect(),
    ))
}
