//! Where the values of an attached product lie and how they become stored ones: JSON, named by the digest of its bytes.

use contract::key::ObjectKey;
use contract::product::ProductId;
use serde::{Deserialize, Serialize};

use crate::StorageError;
use crate::sound::damage;

/// Version of the JSON of references and attachments as it is written.
pub(super) const SCHEMA: u32 = 1;
/// Largest attachment: one that names every row and column of the largest grid is far below.
pub(super) const MAX_ATTACHMENT_BYTES: u64 = 64 << 20;

/// Where values lie and how they become stored ones; what all steps of one attachment have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Attachment {
    /// [`SCHEMA`].
    attached: u32,
    /// The product that it was attached as.
    pub product: ProductId,
    /// URL or folder of the store, without anything secret.
    pub store: String,
    /// What kind of store it is.
    pub kind: StoreKind,
    /// Of an Icechunk repository the snapshot that is read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snapshot: Option<String>,
    /// The array of the values, by its path in the store.
    pub array: String,
    /// What the source needs to read a step.
    pub reading: serde_json::Value,
}

/// What kind of store holds the values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoreKind {
    /// Zarr version 2.
    Zarr2,
    /// Zarr version 3.
    Zarr3,
    /// Zarr version 3 in an Icechunk repository.
    Icechunk,
}

impl std::fmt::Display for StoreKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Zarr2 => "Zarr version 2",
            Self::Zarr3 => "Zarr version 3",
            Self::Icechunk => "Icechunk",
        })
    }
}

impl Attachment {
    /// An attachment; `reading` is the source's own.
    pub fn new(
        product: ProductId,
        (store, kind, snapshot): (String, StoreKind, Option<String>),
        array: String,
        reading: serde_json::Value,
    ) -> Self {
        Self {
            attached: SCHEMA,
            product,
            store,
            kind,
            snapshot,
            array,
            reading,
        }
    }

    /// Store and array, for people.
    pub fn place(&self) -> String {
        format!("{} array {}", self.store, self.array)
    }

    /// The folder of this machine that the store is; none of one behind an address.
    pub fn folder(&self) -> Option<&str> {
        (!self.store.contains("://")).then_some(&self.store)
    }

    /// Reads it from the bytes under its key.
    pub(super) fn of_bytes(key: &ObjectKey, content: &[u8]) -> Result<Self, StorageError> {
        let own: Self =
            serde_json::from_slice(content).map_err(|e| damage::found(key, e.to_string()))?;
        if own.attached == SCHEMA {
            return Ok(own);
        }
        let reason = format!(
            "it is an attachment of version {}, of a newer program",
            own.attached
        );
        Err(StorageError::damaged(key.as_str(), reason))
    }
}
