//! Creating an object once: conditionally, and read back whenever the answer leaves a doubt.

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use futures::stream::FuturesUnordered;
use futures::{StreamExt as _, TryStreamExt as _};
use object_store::{Error, MultipartUpload, ObjectStoreExt as _, PutMode, PutOptions, PutPayload};

use super::outage::Waiting;
use super::{
    MAX_OBJECT_BYTES, MAX_SPOOLED_BYTES, PART_BYTES, PARTS_AT_ONCE, Place, Store, failed, folder,
    hdfs, path,
};
use crate::content::{Content, Pieces};
use crate::sound::large;
use crate::{StorageError, sound};

/// Above this size an object that is named by its content is sent to a cloud in parts.
const WHOLE_BYTES: u64 = 64 << 20;

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
        self.put_new_content(key, content.into()).await
    }

    /// The same of content that may lie in a file, which is not read into memory: a folder has it copied, other stores have it in
    /// parts. It is created once, compared and named as what is in memory is.
    ///
    /// # Errors
    /// Those of [`Store::put_new`]; one that does not pass if a file is not what its name says.
    pub async fn put_new_content(
        &self,
        key: &ObjectKey,
        content: Content,
    ) -> Result<bool, StorageError> {
        if content.size_bytes() > MAX_SPOOLED_BYTES {
            let reason = format!("it is larger than {} GiB", MAX_SPOOLED_BYTES >> 30);
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        if hdfs::is_half_written(last_part(key)) {
            let reason = "names like .NAME.tmp.1 are those of half-written objects";
            return Err(StorageError::damaged(key.as_str(), reason));
        }
        let mut pauses = self.retry_limits.backoff().pauses();
        let mut waiting: Option<Waiting<'_>> = None;
        let stored = loop {
            let error = match self.create(key, &content).await {
                Ok(()) => break Ok(true),
                Err(error) => error,
            };
            if self.is_refusal(&error) {
                return Err(self.refused(key, error));
            }
            match self.holds(key, &content).await? {
                Some(true) => break Ok(false),
                Some(false) => break self.put_beside(key, content).await,
                None => {}
            }
            let Some(pause) = pauses.next() else {
                return Err(failed(key, error));
            };
            if waiting.is_some() {
                tracing::info!(%key, %error, "not there after a doubtful answer: sent again");
            } else if waiting.insert(self.outage.wait()).is_first {
                // Whoever waits for a command is to see why: the disk may be full.
                let retries_s = self.retry_limits.retries.as_secs_f64();
                tracing::warn!(%key, %error, "not stored: tried again for at most {retries_s} s");
            } else {
                tracing::info!(%key, %error, "not stored either: tried again");
            }
            tokio::time::sleep(pause).await;
        };
        if stored.is_ok()
            && let Some(waiting) = waiting
        {
            waiting.went_well();
        }
        stored
    }

    /// What becomes of an object where other bytes are.
    async fn put_beside(&self, key: &ObjectKey, content: Content) -> Result<bool, StorageError> {
        if key.vouches() == Vouched::Nothing {
            return Err(StorageError::Conflict { key: key.clone() });
        }
        match large::of_stored(self, key).await {
            Ok(_sound) => Ok(false),
            Err(error @ StorageError::Damaged { .. }) => {
                sound::of_content(key, &content).await?;
                tracing::warn!(%key, %error, "a damaged object is replaced by the whole one");
                self.put_content_over(key, content).await.map(|()| true)
            }
            Err(error) => Err(error),
        }
    }

    /// Stores an object in the place of what is there: for one that was found damaged and can be made again, or that an
    /// older program wrote. Nothing else ever changes.
    pub async fn put_over(&self, key: &ObjectKey, content: Bytes) -> Result<(), StorageError> {
        self.put_content_over(key, content.into()).await
    }

    async fn put_content_over(
        &self,
        key: &ObjectKey,
        content: Content,
    ) -> Result<(), StorageError> {
        let sent = match &self.place {
            Place::Folder(root) => {
                let bytes = content.size_bytes();
                let put = folder::replace(root.clone(), key.clone(), content).await;
                put.inspect(|()| self.wrote(bytes))
            }
            Place::Cloud | Place::Hdfs if !matches!(content, Content::Bytes(_)) => {
                self.upload(key, &content).await
            }
            Place::Cloud | Place::Hdfs | Place::Memory => {
                let payload = content.whole().map_err(|e| folder::failed(key, e));
                match payload.map(PutPayload::from_bytes) {
                    Ok(payload) => self.objects.put(&path(key), payload).await.map(|_put| ()),
                    Err(e) => Err(e),
                }
            }
        };
        sent.map_err(|e| failed(key, e))
    }

    async fn create(&self, key: &ObjectKey, content: &Content) -> Result<(), Error> {
        let is_named = key.vouches() != Vouched::Nothing;
        match (&self.place, content) {
            (Place::Folder(root), _) => {
                let made = folder::create(root.clone(), key.clone(), content.clone()).await;
                made.inspect(|()| self.wrote(content.size_bytes()))
            }
            (Place::Cloud, _) if content.size_bytes() > WHOLE_BYTES && is_named => {
                self.send_parts(key, content).await
            }
            (Place::Hdfs, Content::File(..)) if is_named => self.send_parts(key, content).await,
            (Place::Cloud | Place::Hdfs | Place::Memory, _) => {
                let options = PutOptions::from(PutMode::Create);
                let whole = content.whole().map_err(|e| folder::failed(key, e))?;
                let payload = PutPayload::from_bytes(whole);
                let sent = self.objects.put_opts(&path(key), payload, options).await;
                sent.map(|_put| ())
            }
        }
    }

    /// Sends an object in parts; nothing is seen of it before its end.
    async fn send_parts(&self, key: &ObjectKey, content: &Content) -> Result<(), Error> {
        match self.objects.head(&path(key)).await {
            Ok(_there) => Err(Error::AlreadyExists {
                path: key.to_string(),
                source: "it was there before the upload".into(),
            }),
            Err(Error::NotFound { .. }) => self.upload(key, content).await,
            Err(e) => Err(e),
        }
    }

    async fn upload(&self, key: &ObjectKey, content: &Content) -> Result<(), Error> {
        let mut upload = self.objects.put_multipart(&path(key)).await?;
        let pieces = content.pieces(key, PART_BYTES);
        let ended = match send(key, upload.as_mut(), pieces).await {
            Ok(()) => upload.complete().await.map(|_put| ()),
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
        content: &Content,
    ) -> Result<Option<bool>, StorageError> {
        let found = match self.objects.get(&path(key)).await {
            Ok(found) => found,
            Err(Error::NotFound { .. }) => return Ok(None),
            Err(e) => return Err(failed(key, e)),
        };
        if found.meta.size != content.size_bytes() {
            return Ok(Some(false));
        }
        let mut pieces = found.into_stream();
        let mut at = 0;
        while let Some(piece) = pieces.next().await {
            let piece = piece.map_err(|e| failed(key, e))?;
            let end = at + piece.len() as u64;
            if !content.part(at..end).is_ok_and(|own| own == piece) {
                return Ok(Some(false));
            }
            at = end;
        }
        Ok(Some(at == content.size_bytes()))
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

/// Sends pieces in their order, a few at a time; a file is read no further than these.
async fn send(
    key: &ObjectKey,
    upload: &mut dyn MultipartUpload,
    mut pieces: Pieces,
) -> Result<(), Error> {
    let mut sending = FuturesUnordered::new();
    loop {
        // Reading may wait for a disk.
        let read = tokio::task::spawn_blocking(move || (pieces.next(), pieces)).await;
        let (piece, rest) = read.map_err(Error::from)?;
        pieces = rest;
        let Some(piece) = piece else { break };
        let piece = piece.map_err(|e| folder::failed(key, e))?;
        sending.push(upload.put_part(PutPayload::from_bytes(piece)));
        while sending.len() >= PARTS_AT_ONCE {
            sending.try_next().await?;
        }
    }
    while sending.try_next().await?.is_some() {}
    Ok(())
}

fn last_part(key: &ObjectKey) -> &str {
    key.as_str().rsplit('/').next().unwrap_or_default()
}

#[cfg(test)]
mod tests;
