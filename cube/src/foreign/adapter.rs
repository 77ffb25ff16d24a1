//! Objects of others as the library of arrays reads them: documents from one that holds all, if there is one.

use std::collections::BTreeMap;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::{self, StreamExt as _};
use object_store::GetRange;
use zarrs::storage::byte_range::{ByteRange, ByteRangeIterator};
use zarrs::storage::{
    AsyncMaybeBytesIterator, AsyncReadableStorageTraits, MaybeBytes, StorageError, StoreKey,
};

use super::error::ForeignError;
use super::objects::Objects;

/// Largest document that says what an array or a group is; those of all arrays of a store in one are below a megabyte.
pub(super) const MAX_DOCUMENT_BYTES: u64 = 16 << 20;
/// Largest object that is read at once.
pub(super) const MAX_OBJECT_BYTES: u64 = 1 << 30;

/// Numbers that JSON does not have.
const BARE: [&[u8]; 3] = [b"NaN", b"Infinity", b"-Infinity"];
/// Names of documents.
const DOCUMENTS: [&str; 5] = ["zarr.json", ".zarray", ".zattrs", ".zgroup", ".zmetadata"];

/// Objects of others.
#[derive(Debug, Clone)]
pub(super) struct Adapter {
    pub(super) objects: Arc<dyn Objects>,
    /// Documents that came in one, by name.
    pub(super) documents: Arc<BTreeMap<String, Bytes>>,
}

impl Adapter {
    /// An object, whole or in part.
    pub(super) async fn object(
        &self,
        name: &str,
        part: Option<GetRange>,
    ) -> Result<Option<Bytes>, ForeignError> {
        let is_document = DOCUMENTS.iter().any(|own| name.ends_with(own));
        if is_document
            && part.is_none()
            && let Some(document) = self.documents.get(name)
        {
            return Ok(Some(document.clone()));
        }
        // Documents that came in one are all that there are.
        if is_document && !self.documents.is_empty() {
            return Ok(None);
        }
        let most_bytes = if is_document {
            MAX_DOCUMENT_BYTES
        } else {
            MAX_OBJECT_BYTES
        };
        let is_whole = is_document && part.is_none();
        let object = self.objects.get(name, part, most_bytes).await?;
        Ok(object.map(|object| if is_whole { plain(&object) } else { object }))
    }
}

/// A document of which numbers that JSON does not have, as the library of Zarr for Python writes those of attributes (`NaN`,
/// `Infinity`, `-Infinity`), are the texts that Zarr has for them.
pub(super) fn plain(document: &[u8]) -> Bytes {
    let mut whole = Vec::with_capacity(document.len());
    let (mut is_text, mut at) = (false, 0);
    while let Some(byte) = document.get(at) {
        let is_here = |word: &&[u8]| !is_text && document[at..].starts_with(word);
        if let Some(word) = BARE.into_iter().find(is_here) {
            whole.push(b'"');
            whole.extend_from_slice(word);
            whole.push(b'"');
            at += word.len();
            continue;
        }
        is_text ^= *byte == b'"';
        // A quotation mark behind it is of the text.
        let count = if *byte == b'\\' { 2 } else { 1 };
        let end = document.len().min(at + count);
        whole.extend_from_slice(&document[at..end]);
        at = end;
    }
    whole.into()
}

fn failed(error: &ForeignError) -> StorageError {
    StorageError::Other(error.to_string())
}

fn range(range: ByteRange) -> GetRange {
    match range {
        ByteRange::FromStart(start, None) => GetRange::Offset(start),
        ByteRange::FromStart(start, Some(length)) => {
            GetRange::Bounded(start..start.saturating_add(length))
        }
        ByteRange::Suffix(length) => GetRange::Suffix(length),
    }
}

#[async_trait]
impl AsyncReadableStorageTraits for Adapter {
    async fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        self.object(key.as_str(), None)
            .await
            .map_err(|e| failed(&e))
    }

    async fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        byte_ranges: ByteRangeIterator<'a>,
    ) -> Result<AsyncMaybeBytesIterator<'a>, StorageError> {
        let mut parts = vec![];
        for own in byte_ranges {
            match self.object(key.as_str(), Some(range(own))).await {
                Ok(Some(part)) => parts.push(Ok(part)),
                Ok(None) => return Ok(None),
                Err(e) => return Err(failed(&e)),
            }
        }
        Ok(Some(stream::iter(parts).boxed()))
    }

    async fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
        self.objects
            .size(key.as_str())
            .await
            .map_err(|e| failed(&e))
    }

    fn supports_get_partial(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_json_does_not_have_are_texts_and_texts_stay() {
        let own = r#"{"a\"NaN": [NaN, -Infinity,Infinity, -1e5], "b": "NaN \\", "c": NaN}"#;
        let read: serde_json::Value = serde_json::from_slice(&plain(own.as_bytes())).unwrap();
        let wanted = serde_json::json!({
            "a\"NaN": ["NaN", "-Infinity", "Infinity", -1e5],
            "b": "NaN \\",
            "c": "NaN",
        });
        assert_eq!(read, wanted);
        // What is cut off stays so.
        for own in ["", "{\"a", "\\", "Na", "\"\\"] {
            assert_eq!(plain(own.as_bytes()), own.as_bytes());
        }
    }
}
