//! [`CheckedGrid`] in, [`EncodedGrid`] out: the bytes of a frame and the key that its digest gives it.

use bytes::Bytes;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::Period;

use crate::check::CheckedGrid;
use crate::error::IngestError;

/// One step as the bytes of a frame.
#[derive(Debug, Clone)]
pub(crate) struct EncodedGrid {
    pub(crate) period: Period,
    pub(crate) key: ObjectKey,
    pub(crate) frame: Bytes,
    pub(crate) valid_cells: u64,
    pub(crate) masked: MaskedCells,
}

pub(crate) fn run(
    checked: &CheckedGrid,
    product: &ProductId,
    grid: &Grid,
) -> Result<EncodedGrid, IngestError> {
    let frame = storage::frames::encode(grid, &checked.values, checked.period)
        .map_err(IngestError::storage("encode a frame"))?;
    let key = ObjectKey::frame(product, &Digest::of(&frame));
    Ok(EncodedGrid {
        period: checked.period,
        key,
        frame,
        valid_cells: checked.valid_cells,
        masked: checked.masked,
    })
}
