//! Can this store be worked with? Found out with a probe, before any work is done.

use std::time::{SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use contract::key::ObjectKey;
use object_store::{Error, ObjectStoreExt as _, PutMode, PutOptions, PutPayload};

use super::{Place, Store, failed, folder, path};
use crate::StorageError;
use crate::error::may_pass;

/// Folder of probes.
pub(crate) const PROBES: &str = "probe";

impl Store {
    /// Writes a probe, reads it back, tries to create it a second time, which must be refused, and removes it where that is allowed: to work
    /// with a store nothing has to be removed, and what is left of probes is for clean-up.
    ///
    /// # Errors
    /// `Location` with what to change: no such bucket, no permission, wrong credentials, or a server that does not
    /// honour conditional creation (another object could then be overwritten). A store that is only away gives a
    /// retryable error.
    pub async fn check_writable(&self) -> Result<(), StorageError> {
        let key = probe_key();
        let content = Bytes::from(key.as_str().to_owned());
        let checked = self.probe(&key, &content).await;
        if let Err(error) = self.remove(&key).await {
            tracing::debug!(%key, %error, "a probe stays until somebody cleans up");
        }
        checked
    }

    async fn probe(&self, key: &ObjectKey, content: &Bytes) -> Result<(), StorageError> {
        let first = match self.create_once(key, content).await {
            // The answer to a first try was lost: the probe is read back below.
            Err(Error::AlreadyExists { .. } | Error::Precondition { .. }) => Ok(()),
            other => other,
        };
        first.map_err(|e| self.unwritable(key, e))?;
        let found = self
            .objects
            .get(&path(key))
            .await
            .map_err(|e| self.unreadable(key, e))?;
        let found = found.bytes().await.map_err(|e| failed(key, e))?;
        if found != content {
            return Err(
                self.unusable("an object that was just written reads differently".to_owned())
            );
        }
        match self.create_once(key, content).await {
            Err(Error::AlreadyExists { .. } | Error::Precondition { .. }) => Ok(()),
            Ok(()) => Err(self.unusable(
                "it let an object be created twice: use a server that honours conditional creation \
                 (If-None-Match)"
                    .to_owned(),
            )),
            Err(e) => Err(self.unwritable(key, e)),
        }
    }

    /// One conditional creation, without the reading back that would hide what the store does.
    async fn create_once(&self, key: &ObjectKey, content: &Bytes) -> Result<(), Error> {
        if let Place::Folder(root) = &self.place {
            return folder::create(root.clone(), key.clone(), content.clone().into()).await;
        }
        let options = PutOptions::from(PutMode::Create);
        let payload = PutPayload::from_bytes(content.clone());
        let sent = self.objects.put_opts(&path(key), payload, options).await;
        sent.map(|_put| ())
    }

    fn unwritable(&self, key: &ObjectKey, error: Error) -> StorageError {
        let reason = match &error {
            Error::NotFound { .. } => {
                "there is no such bucket or container: make it first".to_owned()
            }
            Error::Unauthenticated { source, .. } => {
                format!("its credentials are refused: {source}")
            }
            Error::PermissionDenied { source, .. } => {
                format!("no permission to write, or wrong credentials: {source}")
            }
            Error::NotSupported { .. } | Error::NotImplemented { .. } => {
                format!("it cannot create objects conditionally: {error}")
            }
            other if may_pass(other) => return failed(key, error),
            other => other.to_string(),
        };
        self.unusable(reason)
    }

    fn unreadable(&self, key: &ObjectKey, error: Error) -> StorageError {
        match error {
            Error::NotFound { .. } => {
                self.unusable("an object that was just written is not there".to_owned())
            }
            Error::PermissionDenied { source, .. } => {
                self.unusable(format!("no permission to read: {source}"))
            }
            other => failed(key, other),
        }
    }

    fn unusable(&self, reason: String) -> StorageError {
        StorageError::Location {
            location: self.url.clone(),
            reason,
        }
    }
}

/// A key that no other process probes with at the same time.
fn probe_key() -> ObjectKey {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let text = format!("{PROBES}/{}-{}", std::process::id(), now.as_nanos());
    text.parse().expect("digits and a dash are allowed in keys")
}

#[cfg(test)]
mod tests;
