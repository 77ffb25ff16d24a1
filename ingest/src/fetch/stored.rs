//! Files that landed before, from the store to the spool: to be read anew.

use std::path::Path;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::product::ProductId;
use futures::StreamExt as _;
use object_store::ObjectStoreExt as _;
use storage::{StorageError, Store};

use super::checksum::Expected;
use super::keep::Keep;
use super::raw::RawGranule;
use super::retry::Miss;
use super::spool::Spool;
use crate::error::{IngestError, Stop};

/// Raw files of a store, kept on this machine's disk while they are read.
#[derive(Debug)]
pub(crate) struct RawFiles {
    store: Store,
    spool: Spool,
}

impl RawFiles {
    /// Keeps at most `bytes` of files at a time in a folder of its own in `spool`.
    pub(crate) fn open(store: &Store, spool: &Path, bytes: u64) -> Result<Self, IngestError> {
        Ok(Self {
            store: store.clone(),
            spool: Spool::open(spool, bytes)?,
        })
    }

    /// The raw file of a product, under the name that it came with.
    ///
    /// # Errors
    /// It is gone, or is no longer what its name says.
    pub(crate) async fn fetch(
        &self,
        product: &ProductId,
        raw_sha256: Digest,
        file_name: &str,
    ) -> Result<RawGranule, Stop> {
        let key = ObjectKey::raw(product, &raw_sha256);
        let failed = |source| {
            let key = key.to_string();
            let source = StorageError::Object { key, source };
            IngestError::storage("read a raw file")(source)
        };
        let path = object_store::path::Path::from(key.as_str());
        let found = self.store.object_store().get(&path).await.map_err(failed)?;
        let size_bytes = found.meta.size;
        let spooled = self.spool.file(size_bytes.min(self.spool.bytes())).await?;
        let chunks = found.into_stream();
        let kept = Keep {
            file_name: file_name.to_owned(),
            chunks: chunks.map(|c| c.map_err(|e| Miss::from(failed(e)))).boxed(),
            length: Some(size_bytes),
            most: self.spool.bytes(),
            // A store of our own that is slow is waited for.
            slowest: None,
        };
        let expected = Expected::default();
        kept.check_length(&expected)?;
        match kept.run(spooled, &expected).await {
            Ok(raw) if raw.sha256 == raw_sha256 => Ok(raw),
            Ok(raw) => Err(damaged(&key, &format!("its digest is {} now", raw.sha256)).into()),
            Err(Miss::Stop(stop)) => Err(stop),
            Err(Miss::Absent(reason) | Miss::Away(reason)) => Err(damaged(&key, &reason).into()),
        }
    }
}

fn damaged(key: &ObjectKey, reason: &str) -> IngestError {
    IngestError::storage("read a raw file")(StorageError::Damaged {
        object: key.to_string(),
        reason: reason.to_owned(),
    })
}
