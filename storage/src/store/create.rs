//! Creating an object once: conditionally, and read back whenever the answer leaves a doubt.

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use object_store::{Error, ObjectStoreExt as _, PutMode, PutOptions, PutPayload};

use super::{
    MAX_OBJECT_BYTES, PART_BYTES, PARTS_AT_ONCE, Place, Store, failed, folder, hdfs, path,
};
use crate::off_thread::off_thread;
use crate::{StorageError, sound};

/// Above this size an object that is named by its content is sent to a cloud in parts.
const WHOLE_BYTES: usize = 64 << 20;

impl Store {
    /// Creates an object: true if the store said that it was written now, false if the same content is there.
    ///
    /// A store can answer "already exists" to its own half-answered request, and an answer can be lost after the
    /// object was written; so on any doubt the object is read back and compared, and if it is not there the request is
    /// sent again for as long as the store's retry limit lasts. A doubt that ends well is told as false.
    ///
    /// Where the key names the digest of the content, other bytes that are there are either the same values in another
    /// encoding, which are as good and stay, or damaged, and then they are replaced: the name vouches for ours.
    ///
    /// Objects above 64 MiB go to a cloud in parts if their key names the digest of their content: the end of such an
    /// upload replaces what is there, which is equal then. Any other object is one conditional request.
    ///
    /// # Errors
    /// `Conflict` if other content is there. A retryable error after at most twice the retry limit.
    pub async fn put_new(&self, key: &ObjectKey, content: Bytes) -> Result<bool, StorageError> {
        if content.len() as u64 > MAX_OBJECT_BYTES {
            return Err(StorageError::damaged(
                key.as_str(),
                "it is larger than 2 GiB",
            ));
        }
        if hdfs::is_half_written(last_part(key)) {
            let reason = "names like .NAME.tmp.1 are those of half-written objects";
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        let mut pauses = self.retry_limits.backoff().pauses();
        loop {
            let error = match self.create(key, &content).await {
                Ok(()) => return Ok(true),
                Err(error) => error,
            };
            if self.is_refusal(&error) {
                return Err(self.refused(key, error));
            }
            match self.holds(key, &content).await? {
                Some(true) => return Ok(false),
                Some(false) => return self.put_beside(key, content).await,
                None => {}
            }
            let Some(pause) = pauses.next() else {
                return Err(failed(key, error));
            };
            tracing::info!(%key, %error, "not there after a doubtful answer: sent again");
            tokio::time::sleep(pause).await;
        }
    }

    /// What becomes of an object where other bytes are.
    async fn put_beside(&self, key: &ObjectKey, content: Bytes) -> Result<bool, StorageError> {
        if key.vouches() == Vouched::Nothing {
            return Err(StorageError::Conflict { key: key.clone() });
        }
        let theirs = self.fetch(key).await?;
        let of = |key: &ObjectKey, content: &Bytes| {
            let (key, content) = (key.clone(), content.clone());
            off_thread(move || sound::of_object(&key, &content))
        };
        match of(key, &theirs).await {
            Ok(_sound) => Ok(false),
            Err(error) => {
                of(key, &content).await?;
                tracing::warn!(%key, %error, "a damaged object is replaced by the whole one");
                self.put_over(key, content).await.map(|()| true)
            }
        }
    }

    /// Stores an object in the place of what is there: for one that was found damaged and can be made again, or that an
    /// older program wrote. Nothing else ever changes.
    pub async fn put_over(&self, key: &ObjectKey, content: Bytes) -> Result<(), StorageError> {
        let sent = match &self.place {
            Place::Folder(root) => {
                let bytes = content.len();
                let put = folder::replace(root.clone(), key.clone(), content).await;
                put.inspect(|()| self.wrote(bytes))
            }
            Place::Cloud | Place::Hdfs | Place::Memory => {
                let payload = PutPayload::from_bytes(content);
                let sent = self.objects.put(&path(key), payload).await;
                sent.map(|_put| ())
            }
        };
        sent.map_err(|e| failed(key, e))
    }

    async fn create(&self, key: &ObjectKey, content: &Bytes) -> Result<(), Error> {
        match &self.place {
            Place::Folder(root) => {
                let made = folder::create(root.clone(), key.clone(), content.clone()).await;
                made.inspect(|()| self.wrote(content.len()))
            }
            Place::Cloud if content.len() > WHOLE_BYTES && key.vouches() != Vouched::Nothing => {
                self.send_parts(key, content).await
            }
            Place::Cloud | Place::Hdfs | Place::Memory => {
                let options = PutOptions::from(PutMode::Create);
                let payload = PutPayload::from_bytes(content.clone());
                let sent = self.objects.put_opts(&path(key), payload, options).await;
                sent.map(|_put| ())
            }
        }
    }

    /// Sends an object in parts; nothing is seen of it before its end.
    async fn send_parts(&self, key: &ObjectKey, content: &Bytes) -> Result<(), Error> {
        let path = path(key);
        match self.objects.head(&path).await {
            Ok(_there) => {
                return Err(Error::AlreadyExists {
                    path: key.to_string(),
                    source: "it was there before the upload".into(),
                });
            }
            Err(Error::NotFound { .. }) => {}
            Err(e) => return Err(e),
        }
        let mut upload = self.objects.put_multipart(&path).await?;
        let ends = (0..content.len()).step_by(PART_BYTES as usize);
        let parts: Vec<_> = ends
            .map(|at| content.slice(at..content.len().min(at + PART_BYTES as usize)))
            .map(|part| upload.put_part(PutPayload::from_bytes(part)))
            .collect();
        let sent = stream::iter(parts)
            .buffer_unordered(PARTS_AT_ONCE)
            .try_collect::<Vec<()>>()
            .await;
        let ended = match sent {
            Ok(_parts) => upload.complete().await.map(|_put| ()),
            Err(e) => Err(e),
        };
        if ended.is_err()
            && let Err(error) = upload.abort().await
        {
            tracing::warn!(%key, %error, "parts of an upload stay until the bucket's lifecycle rule takes them");
        }
        ended
    }

    /// Is the object there, and with this content? It is compared as it comes, not held a second time.
    pub(super) async fn holds(
        &self,
        key: &ObjectKey,
        content: &Bytes,
    ) -> Result<Option<bool>, StorageError> {
        let found = match self.objects.get(&path(key)).await {
            Ok(found) => found,
            Err(Error::NotFound { .. }) => return Ok(None),
            Err(e) => return Err(failed(key, e)),
        };
        if found.meta.size != content.len() as u64 {
            return Ok(Some(false));
        }
        let mut pieces = found.into_stream();
        let mut at = 0;
        while let Some(piece) = pieces.next().await {
            let piece = piece.map_err(|e| failed(key, e))?;
            let end = at + piece.len();
            if content.get(at..end) != Some(&piece[..]) {
                return Ok(Some(false));
            }
            at = end;
        }
        Ok(Some(at == content.len()))
    }

    fn refused(&self, key: &ObjectKey, error: Error) -> StorageError {
        match error {
            Error::NotFound { .. } => StorageError::Location {
                location: self.url.clone(),
                reason: "there is no such bucket or container: make it first".to_owned(),
            },
            other => failed(key, other),
        }
    }

    /// Is this an answer that leaves no doubt: nothing was written, and nothing will be?
    fn is_refusal(&self, error: &Error) -> bool {
        match error {
            // A lost rename on HDFS looks like this; a cloud says so of a missing bucket.
            Error::NotFound { .. } => !matches!(self.place, Place::Hdfs),
            Error::AlreadyExists { .. } | Error::Precondition { .. } => false,
            other => !crate::error::may_pass(other),
        }
    }
}

fn last_part(key: &ObjectKey) -> &str {
    key.as_str().rsplit('/').next().unwrap_or_default()
}

#[cfg(test)]
mod tests;
