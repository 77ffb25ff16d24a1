//! Stored values of one cell at every step of a version of a product.

use contract::manifest::{Manifest, ManifestId};

use crate::{ComputeError, Engine};

/// Values of one cell of a version of a product, one for each of its steps, stored unit; NaN where there is no data. `id` is
/// the version's name.
pub(crate) async fn cell_values(
    engine: &Engine,
    manifest: &Manifest,
    id: &ManifestId,
    row: u32,
    col: u32,
) -> Result<Vec<f32>, ComputeError> {
    let values = engine.values(manifest, id).await?;
    match values.cell(row, col).await {
        Ok(values) => Ok(values),
        // What it was found in may have been made anew and cleaned up since.
        Err(_gone) if engine.forget_values(id) => {
            let values = engine.values(manifest, id).await?;
            Ok(values.cell(row, col).await?)
        }
        Err(error) => Err(error.into()),
    }
}
