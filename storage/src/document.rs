//! Documents: JSON objects of the store, sealed with the digest of their text.
//!
//! Those of a schema before 2 have no seal; they are read as they are.

use bytes::Bytes;
use contract::key::ObjectKey;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::sound::{self, damage, seal};
use crate::{StorageError, Store};

/// Creates a document once: false if the same one is there.
///
/// # Errors
/// `Conflict` if another one is there.
pub async fn put_new<T: Serialize>(
    store: &Store,
    key: &ObjectKey,
    document: &T,
) -> Result<bool, StorageError> {
    store.put_new(key, sealed(key, document)?).await
}

/// Stores a document in the place of one that was found damaged, or that is of an older schema: for what can be made
/// again only.
pub async fn put_over<T: Serialize>(
    store: &Store,
    key: &ObjectKey,
    document: &T,
) -> Result<(), StorageError> {
    store.put_over(key, sealed(key, document)?).await
}

/// Reads a document; none if there is none.
///
/// # Errors
/// `Damaged` if its seal is broken or it is not of this type.
pub async fn get<T: DeserializeOwned>(
    store: &Store,
    key: &ObjectKey,
) -> Result<Option<T>, StorageError> {
    let Some(text) = text(store, key).await? else {
        return Ok(None);
    };
    serde_json::from_slice(&text)
        .map(Some)
        .map_err(|e| damage::found(key, e))
}

/// The text of a document without its seal; none if there is none.
///
/// # Errors
/// `Damaged` if its seal is broken.
pub(crate) async fn text(store: &Store, key: &ObjectKey) -> Result<Option<Vec<u8>>, StorageError> {
    let (content, soundness) = match store.get_with_soundness(key).await {
        Ok(found) => found,
        Err(e) if e.is_not_found() => return Ok(None),
        Err(e) => return Err(e),
    };
    sound::check_document(key, &content, soundness)?;
    Ok(Some(seal::opened(&content)))
}

/// A document as it is stored.
pub(crate) fn sealed<T: Serialize>(key: &ObjectKey, document: &T) -> Result<Bytes, StorageError> {
    let text = serde_json::to_vec(document).map_err(|e| StorageError::damaged(key.as_str(), e))?;
    Ok(Bytes::from(seal::json(text)))
}
