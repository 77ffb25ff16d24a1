//! One step of an attachment: sealed JSON in the place of a field.

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::product::ProductId;
use contract::time::Period;
use serde::{Deserialize, Serialize};

use super::attachment::SCHEMA;
use crate::StorageError;
use crate::attached_mark::is_attached;
use crate::sound::{damage, seal};

/// Largest reference: no field of more bytes is looked at as one.
pub(super) const MAX_REFERENCE_BYTES: u64 = 4 << 10;

/// One step of an attachment, in the place of its field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// [`SCHEMA`].
    attached: u32,
    /// Digest of the attachment's bytes.
    pub attachment: Digest,
    /// Index of the step along time there.
    pub time_index: u64,
    /// Its period.
    pub period: Period,
    /// Rows of the product's grid.
    pub rows: u32,
    /// Columns of it.
    pub cols: u32,
    /// Bit patterns of the factor and the offset that turn the source's unit into the stored one: they may depend on the period.
    pub conversion: [u64; 2],
}

impl Reference {
    /// A step of an attachment whose fields have so many rows and columns.
    pub fn new(
        attachment: Digest,
        (time_index, period): (u64, Period),
        [rows, cols]: [u32; 2],
        [factor, offset]: [f64; 2],
    ) -> Self {
        Self {
            attached: SCHEMA,
            attachment,
            time_index,
            period,
            rows,
            cols,
            conversion: [factor.to_bits(), offset.to_bits()],
        }
    }

    /// It as it is stored.
    pub(super) fn sealed(&self) -> Result<Vec<u8>, StorageError> {
        let text =
            serde_json::to_vec(self).map_err(|e| StorageError::damaged("reference to write", e))?;
        Ok(seal::json(text))
    }

    /// Bytes that are none are something else: a field.
    pub(super) fn of_bytes(key: &ObjectKey, content: &[u8]) -> Result<Option<Self>, StorageError> {
        if !is_attached(content) {
            return Ok(None);
        }
        if seal::of_json(content) != seal::Seal::Whole {
            return Err(damage::found(
                key,
                "its bytes are not those that were sealed",
            ));
        }
        let own: Self = serde_json::from_slice(&seal::opened(content))
            .map_err(|e| damage::found(key, e.to_string()))?;
        if own.attached != SCHEMA {
            let reason = format!(
                "it is a reference of version {}, of a newer program",
                own.attached
            );
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        Ok(Some(own))
    }
}

/// The product and the values of a key that may have a reference in its place.
pub(super) fn named(key: &ObjectKey) -> Option<(ProductId, Digest)> {
    let (Some(Kind::Field), Vouched::Values(digest)) = (Kind::of(key), key.vouches()) else {
        return None;
    };
    let product = key.as_str().split('/').nth(1)?.parse().ok()?;
    Some((product, digest))
}
