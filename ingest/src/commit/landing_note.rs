//! Which notice landed a file, noted before the file is published.
//!
//! A notice is answered with an event at the moment that its offset moves. A process can die between publishing a file
//! and that moment; the notice then comes again and finds its file published. Was it published by this notice, whose
//! event is still due, or by another one, which has told of it or will? The note tells: a notice that finds its own note
//! tells of the file; one that does not is a duplicate, and is finished in silence.
//!
//! Two processes that publish one file of two notices at the same moment have both noted it; the one that was slower is
//! silent, unless it dies just then: then both tell. Nothing is ever left untold.

use std::time::Duration;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::product::ProductId;
use contract::topic::Origin;
use storage::gc::Owner;
use storage::{StorageError, Store};

use crate::error::IngestError;

fn key(product: &ProductId, raw_sha256: Digest, origin: Origin) -> Result<ObjectKey, IngestError> {
    let Origin {
        partition, offset, ..
    } = origin;
    let folder = Kind::Landing.folder();
    Ok(format!("{folder}/{product}/{raw_sha256}-{partition}-{offset}").parse()?)
}

/// Notes that a notice is about to publish a file; true if that was noted before.
pub(crate) async fn note(
    store: &Store,
    product: &ProductId,
    raw_sha256: Digest,
    origin: Origin,
) -> Result<bool, IngestError> {
    let content = Bytes::from(origin.to_string());
    let key = key(product, raw_sha256, origin)?;
    match store.put_new(&key, content.clone()).await {
        // Its name says what it must hold.
        Err(error @ StorageError::Conflict { .. }) => {
            tracing::warn!(%key, %error, "a damaged note of a landing is written again");
            store.put_over(&key, content).await.map(|()| true)
        }
        noted => noted.map(|is_new| !is_new),
    }
    .map_err(IngestError::storage("note a landing"))
}

/// Has this notice begun to publish the file before?
pub(crate) async fn is_noted(
    store: &Store,
    product: &ProductId,
    raw_sha256: Digest,
    origin: Origin,
) -> Result<bool, IngestError> {
    store
        .exists(&key(product, raw_sha256, origin)?)
        .await
        .map_err(IngestError::storage("look up a landing"))
}

/// Notes by which a notice that comes again is known.
#[derive(Debug)]
pub struct LandingNotes;

impl Owner for LandingNotes {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Landing]
    }

    /// Longer than any log keeps a notice (30 days).
    fn least_age(&self) -> Duration {
        Duration::from_hours(24 * 45)
    }

    fn is_made_again(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use contract::topic::Topic;
    use test_data::frozen;

    use super::*;

    fn origin(partition: u32, offset: u64) -> Origin {
        Origin {
            topic: Topic::GranuleNotice,
            partition,
            offset,
        }
    }

    #[tokio::test]
    async fn frozen_notes_of_landings_are_known_again() {
        let product: ProductId = "fgco2".parse().unwrap();
        let raw_1 = "8b68d6787313235796d847a4fb4abfd2e31c2e289d16c049f3acadc63b4f2393";
        let raw_2 = Digest::of(b"a file that nobody keeps");
        if let Some(folder) = frozen::to_freeze() {
            let objects = folder.join("objects");
            let store = Store::open(objects.to_str().unwrap()).unwrap();
            note(&store, &product, raw_2, origin(3, 17)).await.unwrap();
        }
        for (version, raw, origin) in [
            (1, raw_1.parse().unwrap(), origin(0, 0)),
            (2, raw_2, origin(3, 17)),
        ] {
            let folder = tempfile::tempdir().unwrap();
            frozen::copy(version, "objects/landings", &folder.path().join("landings"));
            let store = Store::open(folder.path().to_str().unwrap()).unwrap();
            let is_noted = is_noted(&store, &product, raw, origin).await;
            assert!(is_noted.unwrap(), "version {version}");
            assert!(note(&store, &product, raw, origin).await.unwrap());
            // A damaged note is there all the same, and is whole again.
            let key = key(&product, raw, origin).unwrap();
            let whole = store.get(&key).await.unwrap();
            let damaged = Bytes::from("granule.notice/9/9");
            store.put_over(&key, damaged).await.unwrap();
            assert!(note(&store, &product, raw, origin).await.unwrap());
            assert_eq!(store.get(&key).await.unwrap(), whole);
            let next = Origin {
                offset: origin.offset + 1,
                ..origin
            };
            assert!(!note(&store, &product, raw, next).await.unwrap());
        }
    }
}
