//! Fields that lie in stores of others: what is stored in their place, and a store that reads them as if they were here.
//!
//! In the place of a field lies a [`Reference`] of some 250 bytes: which step of which [`Attachment`] it is. The attachment,
//! where the values lie and how they become stored ones, lies where the file of a landed step does (`raw/PRODUCT/DIGEST`).
//! Whoever reads the field gets the bytes of a field: the values come from the other store and are compared with the digest in
//! the field's name, so that nothing comes out that is not what was attached. Left out on purpose: how other stores are read
//! (the caller's [`Source`]).

mod attachment;
mod field;
mod layer;
mod reference;
mod source;

use std::sync::Arc;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::product::ProductId;

use crate::{StorageError, Store};

use layer::{Held, Layer};
use reference::MAX_REFERENCE_BYTES;

pub use crate::attached_mark::is_attached;
pub use crate::failure::{Cause, Failure};
pub use attachment::{Attachment, StoreKind};
pub use reference::Reference;
pub use source::Source;

impl Store {
    /// The same store, in which fields of attached products are read from where they lie.
    #[must_use]
    pub fn with_attached(&self, source: Arc<dyn Source>) -> Self {
        let bare = Box::new(self.bare());
        let held = Arc::new(Held::new(source));
        let layered = bare.through(|objects| Arc::new(Layer::new(objects, Arc::clone(&held))));
        // Of fields alone: cubes may be read as they were.
        layered.over(bare, self.is_layered())
    }

    /// The same store as it is stored: in the place of fields that lie elsewhere references are read.
    #[must_use]
    pub fn bare(&self) -> Self {
        self.bare.as_deref().unwrap_or(self).clone()
    }

    /// Stores what steps are to refer to, and gives its name.
    pub async fn put_attachment(&self, attachment: &Attachment) -> Result<Digest, StorageError> {
        let content = serde_json::to_vec(attachment)
            .map_err(|e| StorageError::damaged("attachment to write", e))?;
        let digest = Digest::of(&content);
        let key = ObjectKey::raw(&attachment.product, &digest);
        self.bare().put_new(&key, content.into()).await?;
        Ok(digest)
    }

    /// Stores a step of an attachment in the place of a field of these values. A field that is there stays: it holds the
    /// values themselves. Another reference to the same values is replaced.
    pub async fn put_reference(
        &self,
        product: &ProductId,
        values_sha256: &Digest,
        reference: &Reference,
    ) -> Result<ObjectKey, StorageError> {
        let content = Bytes::from(reference.sealed()?);
        let (bare, key) = (self.bare(), ObjectKey::field(product, values_sha256));
        match bare.reference(&key).await {
            Ok(Some(there)) if there == *reference => {}
            Ok(None) => {}
            Ok(Some(_)) | Err(StorageError::Damaged { .. }) => bare.put_over(&key, content).await?,
            Err(e) if e.is_not_found() => {
                bare.put_new(&key, content).await?;
            }
            Err(e) => return Err(e),
        }
        Ok(key)
    }

    /// The reference in the place of a field; none where the field itself is.
    ///
    /// # Errors
    /// `is_not_found` where nothing is; `Damaged` for a reference that is not what was sealed.
    pub async fn reference(&self, field: &ObjectKey) -> Result<Option<Reference>, StorageError> {
        let bare = self.bare();
        if bare.size_bytes(field).await? > MAX_REFERENCE_BYTES {
            return Ok(None);
        }
        Reference::of_bytes(field, &bare.fetch(field).await?)
    }

    /// What a reference of a product refers to.
    pub async fn attachment(
        &self,
        product: &ProductId,
        digest: &Digest,
    ) -> Result<Attachment, StorageError> {
        let key = ObjectKey::raw(product, digest);
        Attachment::of_bytes(&key, &self.get(&key).await?)
    }

    /// What a version is attached to, as its first and its last step say; none of one whose values are here.
    ///
    /// Asked of a store that reads no attached products ([`Store::with_attached`]) it is none, at no cost.
    pub async fn attached_to(
        &self,
        version: &Manifest,
    ) -> Result<Option<Attachment>, StorageError> {
        if self.bare.is_none() {
            return Ok(None);
        }
        let ends = version
            .steps
            .first()
            .into_iter()
            .chain(version.steps.last());
        for step in ends {
            match self.reference(&step.field).await {
                Ok(Some(reference)) => {
                    let found = self
                        .attachment(&version.product, &reference.attachment)
                        .await;
                    return found.map(Some);
                }
                // What is damaged or gone is told by whoever reads it.
                Ok(None) | Err(StorageError::Damaged { .. }) => {}
                Err(e) if e.is_not_found() => {}
                Err(e) => return Err(e),
            }
        }
        Ok(None)
    }
}
