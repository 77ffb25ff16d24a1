//! [`EncodedGrid`] in, [`StoredGrid`] out: the frame is durable, under a name that only its content could have.

pub(crate) mod reading;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Step;
use contract::masked::MaskedCells;
use contract::notice::NoticeOrder;
use contract::product::ProductId;
use contract::topic::Origin;
use storage::{Store, frames};

use crate::encode::EncodedGrid;
use crate::error::IngestError;
use crate::fetch::RawGranule;
use crate::plan::Target;

/// A frame that is durable, as a step of a manifest to come.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StoredGrid {
    pub(crate) step: Step,
}

/// A file of which everything but the manifest is durable.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StoredGranule {
    pub(crate) target: Target,
    pub(crate) grid: Grid,
    pub(crate) raw_sha256: Digest,
    /// In the order of time.
    pub(crate) grids: Vec<StoredGrid>,
    /// What was taken for granted when it was read. One line each.
    pub(crate) assumptions: Vec<String>,
    /// What was masked in all steps of the file: those without any value are in no manifest.
    pub(crate) masked: MaskedCells,
    /// The notice that it came with; none for files that no notice came for.
    pub(crate) asked_by: Option<Origin>,
    /// Its place in the order of notices.
    pub(crate) order: Option<NoticeOrder>,
}

/// Stores the file as it came.
pub(crate) async fn raw(
    store: &Store,
    product: &ProductId,
    raw: &RawGranule,
) -> Result<(), IngestError> {
    let key = ObjectKey::raw(product, &raw.sha256);
    store
        .put_new(&key, raw.content().await?)
        .await
        .map_err(IngestError::storage("store the file"))?;
    Ok(())
}

/// Stores one frame, unless the frame that its product has for the period, if it has one, holds the same values.
pub(crate) async fn run(
    store: &Store,
    encoded: EncodedGrid,
    raw: &RawGranule,
    grid: &Grid,
    there: Option<&ObjectKey>,
) -> Result<StoredGrid, IngestError> {
    let EncodedGrid {
        period,
        key,
        frame,
        valid_cells,
        masked,
    } = encoded;
    let settled = match there {
        Some(there) => frames::settle(store, there, &key, grid)
            .await
            .map_err(IngestError::storage("compare a frame with the one before"))?,
        None => key.clone(),
    };
    if settled == key {
        store
            .put_new(&key, frame)
            .await
            .map_err(IngestError::storage("store a frame"))?;
    }
    let (raw_sha256, origin) = (raw.sha256, raw.file_name.clone());
    Ok(StoredGrid {
        step: Step {
            period,
            frame: settled,
            raw_sha256,
            origin,
            valid_cells,
            contributed: None,
            masked: Some(masked),
        },
    })
}
