//! The hint of a product's newest number, `newest/PRODUCT/number.json`: whoever has not seen the product begins to ask there, and lists
//! nothing.
//!
//! It is written after the manifest, by whoever publishes it, and is a place to start from, no more: that no number is missing between it
//! and the newest. From it on one number after the other is asked for until one is not there ([`super::latest`]). That this is the newest
//! rests on three things.
//!
//! - *A hint that is too old costs questions, no answer.* A writer that was killed between manifest and hint, or may not write it,
//!   leaves an older one; what follows is asked for.
//! - *Nothing behind a hint is missing.* Numbers are published one after the other, and clean-up alone removes some, never the newest.
//!   Otherwise a hint of a version that is pinned could stand before a gap. So it has the hint say the newest before it removes any
//!   version of the product, or removes none of it: whatever goes is older than the hint. It makes one where there was none.
//! - *A hint never goes back.* It is exchanged for what its writer has read ([`Store::swap`]), which was older; a writer that slept in
//!   between, however long, is refused and reads again. One that slept before that finds the newer one.
//!
//! Of one that is not there, damaged, of a program to come or of a manifest that is gone (somebody took the newest away, or wrote back
//! an older copy) nothing is believed: versions are listed, and whoever publishes next writes what is listed. Damage is counted and
//! told as that of other objects, and fails nothing.
//!
//! A Hadoop file system can only create, so that an exchange lists what was created, and a list of a thousand names is one request
//! there: it has no hints.

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::product::ProductId;
use object_store::Error;
use serde::{Deserialize, Serialize};

use super::{is_there, numbers};
use crate::sound::{self, damage};
use crate::store::failed;
use crate::{StorageError, Store, document};

/// Version of what is written here.
const SCHEMA: u32 = 2;
/// Exchanges that others may be before: each is of one who published too.
const ATTEMPTS: usize = 16;

#[derive(Debug, Serialize, Deserialize)]
struct Hint {
    schema: u32,
    number: u64,
}

/// The number to go on from; none where only a list tells.
///
/// # Errors
/// A store that does not answer.
pub(super) async fn read(store: &Store, product: &ProductId) -> Result<Option<u64>, StorageError> {
    if !store.exchanges_at_once() {
        return Ok(None);
    }
    let key = ObjectKey::newest(product);
    match store.read_changing(&key).await {
        Ok(found) => Ok(found.and_then(|(content, _seen)| number(&key, &content))),
        Err(error) if error.is_retryable() => Err(error),
        // Who may read manifests, and not this.
        Err(error) => {
            tracing::debug!(%key, %error, "versions are listed");
            Ok(None)
        }
    }
}

/// Has the hint say a number that is published, or a newer one.
///
/// # Errors
/// It could not be written.
pub(super) async fn tell(
    store: &Store,
    product: &ProductId,
    published: u64,
) -> Result<(), StorageError> {
    if !store.exchanges_at_once() {
        return Ok(());
    }
    let key = ObjectKey::newest(product);
    for _attempt in 0..ATTEMPTS {
        let before = store.read_changing(&key).await?;
        let told = before
            .as_ref()
            .and_then(|(content, _)| number(&key, content));
        let number = match told {
            Some(told) if told == published => return Ok(()),
            Some(told) if told < published => published,
            Some(told) if is_there(store, product, told).await? => return Ok(()),
            // Others may have published since, and gone on.
            _ => numbers(store, product).await?.pop().unwrap_or(published),
        };
        let hint = Hint {
            schema: SCHEMA,
            number,
        };
        let content = document::sealed(&key, &hint)?;
        let seen = before.as_ref().map(|(_, seen)| seen);
        if store.swap(&key, seen, content).await?.is_some() {
            return Ok(());
        }
    }
    let source = Error::Precondition {
        path: key.to_string(),
        source: format!("others exchanged it {ATTEMPTS} times before").into(),
    };
    Err(failed(key, source))
}

/// The same for who has published, which nothing undoes: what fails is said, once until it goes well again.
pub(super) async fn tell_published(store: &Store, product: &ProductId, published: u64) {
    match tell(store, product, published).await {
        Ok(()) => store.newest.was_told(),
        Err(error) if store.newest.is_first_untold() => {
            tracing::warn!(
                %error,
                "the version is published, and the hint of the newest number could not be written: whoever starts asks for more numbers, or lists versions; its key needs the right to replace objects in newest/"
            );
        }
        Err(error) => tracing::info!(%error, "nor could this hint of a newest number be written"),
    }
}

/// What a hint says; none if nothing in it is to be believed.
fn number(key: &ObjectKey, content: &Bytes) -> Option<u64> {
    match parsed(key, content) {
        Ok(hint) if hint.schema == SCHEMA => Some(hint.number),
        Ok(Hint { schema, .. }) => {
            tracing::debug!(%key, schema, "a hint of another program: versions are listed");
            None
        }
        Err(error) => {
            tracing::warn!(%error, "versions are listed until the next one is published");
            None
        }
    }
}

fn parsed(key: &ObjectKey, content: &Bytes) -> Result<Hint, StorageError> {
    let soundness = sound::of_bytes(key, content)?;
    sound::check_document(key, content, soundness)?;
    serde_json::from_slice(content).map_err(|e| damage::found(key, e))
}

#[cfg(test)]
mod tests;
