//! Parts of objects that never change, which questions ask for at the same time or one after the other: each is asked of the store
//! once. For stores behind a network; of a folder the system holds what was read.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use object_store::path::Path;
use object_store::{Error, ObjectStore};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use tokio::sync::watch;

use crate::Store;

/// Parts that are held, bytes of all together.
const HELD_BYTES: u64 = 64 << 20;
/// What an entry takes besides its path and its bytes.
const ENTRY_BYTES: u64 = 192;
/// Of so many bytes each, to begin with.
const PART_BYTES: u64 = 64 << 10;

/// An object, and bytes of it.
type Part = (Arc<str>, Range<u64>);

#[derive(Clone)]
struct PartWeight;

impl Weighter<Part, Bytes> for PartWeight {
    fn weight(&self, (path, _range): &Part, content: &Bytes) -> u64 {
        (path.len() + content.len()) as u64 + ENTRY_BYTES
    }
}

/// Parts that are held, and those that somebody is asking for.
pub(crate) struct SharedParts {
    held: Cache<Part, Bytes, PartWeight>,
    under_way: Mutex<HashMap<Part, watch::Receiver<()>>>,
}

impl Default for SharedParts {
    fn default() -> Self {
        let count = (HELD_BYTES / PART_BYTES) as usize;
        Self {
            held: Cache::with_weighter(count, HELD_BYTES, PartWeight),
            under_way: Mutex::default(),
        }
    }
}

/// Parts that one asks for: others wait until it is gone, however it ends.
struct Claim<'a> {
    of: &'a SharedParts,
    parts: Vec<Part>,
    _told: watch::Sender<()>,
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        let mut under_way = self.of.locked();
        for part in &self.parts {
            under_way.remove(part);
        }
    }
}

impl Store {
    /// Parts of an object that never changes, in the order of their ranges. What several ask for at a time, or one after the other, is
    /// asked of the store once, as long as it is held.
    ///
    /// # Errors
    /// As the store's.
    pub async fn shared_parts(
        &self,
        path: &Path,
        ranges: &[Range<u64>],
    ) -> Result<Vec<Bytes>, Error> {
        let objects = self.object_store();
        self.parts.get(&*objects, path, ranges).await
    }
}

impl SharedParts {
    /// Parts of an object, in the order of their ranges.
    ///
    /// # Errors
    /// As the store's.
    async fn get(
        &self,
        objects: &dyn ObjectStore,
        path: &Path,
        ranges: &[Range<u64>],
    ) -> Result<Vec<Bytes>, Error> {
        let name: Arc<str> = path.as_ref().into();
        let part = |range: &Range<u64>| (Arc::clone(&name), range.clone());
        let mut found: Vec<Option<Bytes>> = ranges
            .iter()
            .map(|range| self.held.get(&part(range)))
            .collect();
        let missing = |found: &[Option<Bytes>]| -> Vec<usize> {
            (0..found.len()).filter(|at| found[*at].is_none()).collect()
        };
        let asked: Vec<Part> = missing(&found)
            .into_iter()
            .map(|at| part(&ranges[at]))
            .collect();
        let (claim, others) = self.claim(asked);
        if !claim.parts.is_empty() {
            let own: Vec<Range<u64>> = claim.parts.iter().map(|(_, range)| range.clone()).collect();
            let content = objects.get_ranges(path, &own).await?;
            for (part, content) in claim.parts.iter().zip(&content) {
                // On its own: a part of what came would hold all of it.
                self.held
                    .insert(part.clone(), Bytes::copy_from_slice(content));
            }
            let by_range: HashMap<Range<u64>, Bytes> = own.into_iter().zip(content).collect();
            for at in missing(&found) {
                found[at] = by_range.get(&ranges[at]).cloned();
            }
        }
        drop(claim);
        for mut other in others {
            // An error says that it is gone.
            drop(other.changed().await);
        }
        for at in missing(&found) {
            found[at] = self.held.get(&part(&ranges[at]));
        }
        // Who was waited for failed, or what it found was held for too short a time.
        let left = missing(&found);
        if !left.is_empty() {
            let own: Vec<Range<u64>> = left.iter().map(|at| ranges[*at].clone()).collect();
            let content = objects.get_ranges(path, &own).await?;
            for (at, content) in left.into_iter().zip(content) {
                found[at] = Some(content);
            }
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// Those of some parts that nobody asks for yet, and those who ask for the others.
    fn claim(&self, parts: Vec<Part>) -> (Claim<'_>, Vec<watch::Receiver<()>>) {
        let (told, telling) = watch::channel(());
        let (mut own, mut others) = (vec![], vec![]);
        let mut under_way = self.locked();
        for part in parts {
            match under_way.get(&part) {
                // Asked for twice by one.
                Some(other) if other.same_channel(&telling) => {}
                Some(other) => others.push(other.clone()),
                None => {
                    under_way.insert(part.clone(), telling.clone());
                    own.push(part);
                }
            }
        }
        drop(under_way);
        let claim = Claim {
            of: self,
            parts: own,
            _told: told,
        };
        (claim, others)
    }

    fn locked(&self) -> std::sync::MutexGuard<'_, HashMap<Part, watch::Receiver<()>>> {
        self.under_way
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use futures::future::join_all;

    use super::*;

    const OBJECT: &str = "cubes/p/chunks/AB";

    async fn stored() -> Store {
        let store = Store::memory();
        let content: Vec<u8> = (0..=255).cycle().take(100_000).collect();
        let (objects, path) = (store.object_store(), Path::from(OBJECT));
        let put = objects.put_opts(&path, content.into(), object_store::PutOptions::default());
        put.await.unwrap();
        store
    }

    #[tokio::test]
    async fn what_many_ask_for_at_once_or_later_is_read_once() {
        let (store, traffic) = stored().await.counted();
        let path = Path::from(OBJECT);
        let (one, other) = ([0..1000, 5000..5100], [5000..5100, 90_000..90_010, 0..1000]);
        let asked = (0..20).map(|at| {
            let ranges: &[Range<u64>] = if at % 2 == 0 { &one } else { &other };
            store.shared_parts(&path, ranges)
        });
        for (at, found) in join_all(asked).await.into_iter().enumerate() {
            let ranges: &[Range<u64>] = if at % 2 == 0 { &one } else { &other };
            for (range, found) in ranges.iter().zip(found.unwrap()) {
                let own: Vec<u8> = range.clone().map(|at| (at % 256) as u8).collect();
                assert_eq!(found, own, "{range:?}");
            }
        }
        store.shared_parts(&path, &one).await.unwrap();
        assert_eq!(traffic.counts().read_bytes, 1110);
        let (elsewhere, its_traffic) = store.counted();
        elsewhere.shared_parts(&path, &one).await.unwrap();
        assert_eq!(its_traffic.counts().read_bytes, 1100, "another process");
    }

    #[tokio::test]
    async fn who_is_waited_for_may_fail_or_leave_and_others_ask_for_themselves() {
        let store = stored().await;
        let path = Path::from(OBJECT);
        let part = (Arc::from(OBJECT), 10..20);
        let (gone, _) = store.parts.claim(vec![part.clone()]);
        let waiting = store.shared_parts(&path, &[10..20, 30..31]);
        let mut waiting = std::pin::pin!(waiting);
        let still = tokio::time::timeout(std::time::Duration::from_millis(50), &mut waiting);
        assert!(still.await.is_err(), "nobody had it yet");
        drop(gone);
        let found = waiting.await.unwrap();
        assert_eq!(
            (&found[0][..2], &found[1][..]),
            (&[10u8, 11][..], &[30u8][..])
        );
        assert!(store.parts.locked().is_empty());
        let nothing = store
            .shared_parts(&Path::from("nowhere"), &[0..1, 2..3])
            .await;
        assert!(
            matches!(nothing, Err(Error::NotFound { .. })),
            "{nothing:?}"
        );
        assert!(store.parts.locked().is_empty());
    }
}
