//! The kinds of objects that change, the beginning of a cube and the hint of a newest number: each is replaced only by who knows what
//! it holds, so that of two writers one is refused.
//!
//! Buckets and memory compare by themselves (a conditional request). A folder is locked for the moment of the exchange.
//! A Hadoop file system can do neither, but creates a name once: there each content is an object of its own with the next
//! number, and the newest number is what the object holds.

mod locked;
mod numbered;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use object_store::{Error, ObjectStoreExt as _, PutMode, PutPayload, UpdateVersion};

use super::{Place, Store, failed, path};
use crate::StorageError;

/// What an object held when it was read or written: who gives it back may replace that, and nothing that came after.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// What a bucket calls the content; the digest of a folder's file; the number on a Hadoop file system.
    pub tag: Option<String>,
    /// What some buckets name the content by besides; its digest on a Hadoop file system.
    pub version: Option<String>,
}

impl Seen {
    fn of_digest(content: &[u8]) -> Self {
        Self {
            tag: Some(Digest::of(content).to_string()),
            version: None,
        }
    }
}

impl Store {
    /// Does an exchange take a request or two here, and list nothing?
    pub(crate) fn exchanges_at_once(&self) -> bool {
        match self.place {
            Place::Memory | Place::Folder(_) | Place::Cloud => true,
            Place::Hdfs => false,
        }
    }

    /// What an object that changes holds now, and what to replace it with; none if there is none.
    pub async fn read_changing(
        &self,
        key: &ObjectKey,
    ) -> Result<Option<(Bytes, Seen)>, StorageError> {
        if matches!(self.place, Place::Hdfs) {
            return numbered::read(self, key).await;
        }
        let found = match self.objects.get(&path(key)).await {
            Ok(found) => found,
            Err(Error::NotFound { .. }) => return Ok(None),
            Err(e) => return Err(failed(key, e)),
        };
        let seen = Seen {
            tag: found.meta.e_tag.clone(),
            version: found.meta.version.clone(),
        };
        let content = found.bytes().await.map_err(|e| failed(key, e))?;
        let seen = match self.place {
            Place::Folder(_) => Seen::of_digest(&content),
            Place::Memory | Place::Cloud | Place::Hdfs => seen,
        };
        Ok(Some((content, seen)))
    }

    /// Replaces what an object held, or creates it if `seen` is none. None if somebody else did so before: read it again.
    ///
    /// An answer that was lost is made good by reading back: two writers never write the same content, or it is all one whose it
    /// is, so that what is there and equals ours is ours.
    ///
    /// # Errors
    /// A retryable one if it is not known what happened.
    pub async fn swap(
        &self,
        key: &ObjectKey,
        seen: Option<&Seen>,
        content: Bytes,
    ) -> Result<Option<Seen>, StorageError> {
        match &self.place {
            Place::Folder(root) => {
                let (limit, bytes) = (self.retry_limits.retries, content.len() as u64);
                let swapped = locked::swap(root.clone(), key.clone(), seen, content, limit);
                let swapped = swapped.await.map_err(|e| failed(key, e))?;
                Ok(swapped.inspect(|_seen| self.wrote(bytes)))
            }
            Place::Hdfs => numbered::swap(self, key, seen, content).await,
            Place::Memory | Place::Cloud => self.swap_by_request(key, seen, content).await,
        }
    }

    async fn swap_by_request(
        &self,
        key: &ObjectKey,
        seen: Option<&Seen>,
        content: Bytes,
    ) -> Result<Option<Seen>, StorageError> {
        let mode = match seen {
            None => PutMode::Create,
            Some(seen) => PutMode::Update(UpdateVersion {
                e_tag: seen.tag.clone(),
                version: seen.version.clone(),
            }),
        };
        let payload = PutPayload::from_bytes(content.clone());
        let path = path(key);
        let sent = self.objects.put_opts(&path, payload, mode.into()).await;
        let error = match sent {
            Ok(put) => {
                return Ok(Some(Seen {
                    tag: put.e_tag,
                    version: put.version,
                }));
            }
            Err(error) => error,
        };
        let is_answer = matches!(
            error,
            Error::AlreadyExists { .. } | Error::Precondition { .. } | Error::NotModified { .. }
        );
        if !is_answer && !crate::error::may_pass(&error) {
            return Err(failed(key, error));
        }
        match self.read_changing(key).await? {
            Some((there, now)) if there == content => Ok(Some(now)),
            _ if is_answer => Ok(None),
            _ => Err(failed(key, error)),
        }
    }
}

#[cfg(test)]
mod tests;
