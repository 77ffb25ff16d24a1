//! [`CheckedGrid`] in, [`EncodedGrid`] out: the bytes of a field and the key that the digest of its values gives it.

use bytes::Bytes;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::Period;

use crate::check::CheckedGrid;
use crate::error::IngestError;

/// One step as the bytes of a field.
#[derive(Debug, Clone)]
pub(crate) struct EncodedGrid {
    pub(crate) period: Period,
    pub(crate) key: ObjectKey,
    pub(crate) field: Bytes,
    pub(crate) valid_cells: u64,
    pub(crate) masked: MaskedCells,
}

pub(crate) fn run(
    checked: &CheckedGrid,
    product: &ProductId,
    grid: &Grid,
) -> Result<EncodedGrid, IngestError> {
    let field = storage::fields::encode(grid, &checked.values, checked.period)
        .map_err(IngestError::storage("encode a field"))?;
    Ok(EncodedGrid {
        period: checked.period,
        key: ObjectKey::field(product, &field.values_sha256),
        field: field.content,
        valid_cells: checked.valid_cells,
        masked: checked.masked,
    })
}
