//! [`EncodedGrid`] in, a [`Step`] of a manifest to come out: the field is durable, under a name that only its content could
//! have. All of a file's are a [`StoredGranule`].

pub(crate) mod reading;

use std::sync::Arc;

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Step;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use storage::domain::Cells;
use storage::{Store, fields};

use crate::encode::EncodedGrid;
use crate::error::IngestError;
use crate::fetch::RawGranule;
use crate::notice::PendingNotice;
use reading::Reading;

/// A file of which everything but the manifest is durable.
#[derive(Debug, Clone)]
pub(crate) struct StoredGranule {
    pub(crate) notice: Arc<PendingNotice>,
    pub(crate) product: ProductId,
    /// What it was read as: steps of a manifest to come.
    pub(crate) reading: Reading,
    /// What was masked in all steps of the file: those without any value are in no manifest.
    pub(crate) masked: MaskedCells,
    /// Cells that hold a value in some step of it, where that is known: its fields need not be read again for that.
    pub(crate) valued: Option<Arc<Cells>>,
}

/// Stores the file as it came.
pub(crate) async fn raw(
    store: &Store,
    product: &ProductId,
    raw: &RawGranule,
) -> Result<(), IngestError> {
    let key = ObjectKey::raw(product, &raw.sha256);
    if let Err(error) = store.put_new_content(&key, raw.content().await?).await {
        // It was compared with its digest on the way: that it changed is no fault of the store.
        raw.check_unchanged()?;
        return Err(IngestError::storage("store the file")(error));
    }
    Ok(())
}

/// Stores one field, unless the field that its product has for the period, if it has one, holds the same values.
pub(crate) async fn run(
    store: &Store,
    encoded: EncodedGrid,
    raw: &RawGranule,
    grid: &Grid,
    there: Option<&ObjectKey>,
) -> Result<Step, IngestError> {
    let EncodedGrid {
        period,
        key,
        field,
        valid_cells,
        masked,
    } = encoded;
    let settled = match there {
        Some(there) => fields::settle(store, there, &key, grid)
            .await
            .map_err(IngestError::storage("compare a field with the one before"))?,
        None => key.clone(),
    };
    if settled == key {
        store
            .put_new_content(&key, field)
            .await
            .map_err(IngestError::storage("store a field"))?;
    }
    Ok(Step {
        period,
        field: settled,
        raw_sha256: raw.sha256,
        origin: raw.file_name.clone(),
        valid_cells,
        contributed: None,
        masked: Some(masked),
    })
}
