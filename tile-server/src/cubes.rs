//! Cubes of products, opened once a version.

use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use contract::product::ProductId;
use cube::{At, CubeError, Keys, Repository, ZarrVersion};
use prometheus::IntGauge;
use quick_cache::sync::Cache;
use storage::{StorageError, Store, manifests};

use crate::backend::Turn;
use crate::client::Client;
use crate::error::ServerError;
use crate::gate::Gate;
use crate::rooms::{Room, Rooms};

/// Versions that are held open: each is its metadata, and references of chunks that were asked for.
const HELD_OPEN: usize = 32;
/// Values that are read at the same time: a large one is 64 MiB.
const READS_AT_ONCE: u32 = 16;
/// Bytes of values that are read or on their way to clients: sixteen large ones, eight of one client. Who asks and takes nothing
/// holds them until its connection ends.
const HELD_BYTES: u64 = 1 << 30;
/// Reads that may wait: xarray asks for many chunks at once.
const READ_QUEUE: u32 = 1024;

/// Cubes in a store, to be read by their keys.
pub(crate) struct Cubes {
    store: Store,
    open: Cache<String, Arc<Keys>>,
    pub(crate) reads: Gate,
    held: Rooms,
}

/// A value and the room that it takes.
struct Held {
    content: Bytes,
    _room: Room,
}

impl AsRef<[u8]> for Held {
    fn as_ref(&self) -> &[u8] {
        &self.content
    }
}

impl Cubes {
    /// None opened yet; `held_bytes` shows how much of their values is read or on its way.
    pub(crate) fn new(store: Store, held_bytes: IntGauge) -> Self {
        Self {
            store,
            open: Cache::new(HELD_OPEN),
            reads: Gate::new(READS_AT_ONCE, READ_QUEUE),
            held: Rooms::new(HELD_BYTES, held_bytes),
        }
    }

    /// A version of a product.
    ///
    /// # Errors
    /// `UnknownVersion` if the cube has no such version (any more, or yet).
    pub(crate) async fn version(
        &self,
        product: &ProductId,
        number: u64,
    ) -> Result<Arc<Keys>, ServerError> {
        let name = format!("{product}@{number}");
        // To open a cube is a large future, and seldom: routes do not hold it in theirs.
        let opening = Box::pin(async {
            let repository = Repository::open(&self.store, &cube::folder(product)).await?;
            let keys = repository.keys(&At::Version(number.to_string())).await?;
            self.check(product, number, &keys).await?;
            Ok::<_, CubeError>(Arc::new(keys))
        });
        match self.open.get_or_insert_async(&name, opening).await {
            Ok(keys) => Ok(keys),
            Err(CubeError::Missing { .. } | CubeError::NoVersion { .. }) => {
                Err(self.without_cube(product, number, name).await?)
            }
            Err(error) => Err(failed(error)),
        }
    }

    /// # Errors
    /// `NoVersion` where another version has the number now: somebody took the manifest of the cube's away.
    async fn check(&self, product: &ProductId, number: u64, keys: &Keys) -> Result<(), CubeError> {
        let published = match manifests::numbered(&self.store, product, number).await {
            Ok(published) => published.map(|manifest| manifest.id()),
            // The cube has its own checks.
            Err(StorageError::Damaged { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        let own = keys.description().version.as_ref();
        match own.zip(published) {
            Some((own, published)) if *own != published => Err(CubeError::NoVersion {
                place: cube::folder(product),
                version: published.to_string(),
                there: own.to_string(),
            }),
            _ => Ok(()),
        }
    }

    /// Why a version has no cube.
    async fn without_cube(
        &self,
        product: &ProductId,
        number: u64,
        name: String,
    ) -> Result<ServerError, ServerError> {
        let version = manifests::numbered(&self.store, product, number).await?;
        let attached = match &version {
            Some(version) => self.store.attached_to(version).await?,
            None => None,
        };
        Ok(match attached {
            Some(attachment) => ServerError::Attached {
                name,
                // A folder is of no use to who asks, and none of their business.
                place: match attachment.folder() {
                    None => format!("read it there, at {}", attachment.store),
                    Some(_) => "it is not given out here".to_owned(),
                },
            },
            None => ServerError::UnknownVersion { manifest: name },
        })
    }

    /// The value of a key of a version that is open, or a part of it; none if there is no such key. `bytes` is its length, or that of
    /// the part. Where there is no room for it, somebody else has the turn meanwhile.
    ///
    /// # Errors
    /// `Busy` if as many of this client wait for room as may.
    pub(crate) async fn get(
        &self,
        keys: &Keys,
        (zarr, key): (ZarrVersion, &str),
        (range, bytes): (Option<Range<u64>>, u64),
        turn: Turn,
    ) -> Result<Option<Bytes>, ServerError> {
        // One that is larger than a client's share is given out alone, and not refused for ever.
        let bytes = bytes.min(self.held.client_limit_bytes());
        let client = Client::asking();
        let (room, _turn) = match self.held.enter(client, bytes) {
            Ok(room) => (room, Some(turn)),
            Err(_full) => {
                drop(turn);
                (self.held.wait(client, bytes).await?, None)
            }
        };
        let read = match zarr {
            ZarrVersion::Three => keys.get(key, range).await,
            // Read whole, for it is compared with its checksum.
            ZarrVersion::Two => {
                let whole = keys.get_2(key).await;
                whole.map(|whole| whole.map(|whole| part(&whole, range.as_ref())))
            }
        };
        let content = self.answered(keys, read)?;
        // The room goes with the bytes, not with the body: that one ends when they lie in the connection's queue.
        Ok(content.map(|content| {
            Bytes::from_owner(Held {
                content,
                _room: room,
            })
        }))
    }

    /// Its length.
    pub(crate) async fn length(
        &self,
        keys: &Keys,
        (zarr, key): (ZarrVersion, &str),
    ) -> Result<Option<u64>, ServerError> {
        let length = match zarr {
            ZarrVersion::Three => keys.length(key).await,
            ZarrVersion::Two => keys.length_2(key).await,
        };
        self.answered(keys, length)
    }

    fn answered<T>(&self, keys: &Keys, answer: Result<T, CubeError>) -> Result<T, ServerError> {
        answer.map_err(|error| {
            // It may have been made again since, of other chunks.
            if let Some(id) = &keys.description().version {
                self.open.remove(&format!("{}@{}", id.product, id.number));
            }
            failed(error)
        })
    }
}

/// Those bytes of a value that are asked for.
fn part(whole: &Bytes, range: Option<&Range<u64>>) -> Bytes {
    let end = whole.len() as u64;
    let range = range.map_or(0..end, |range| range.start.min(end)..range.end.min(end));
    whole.slice(range.start as usize..range.end.max(range.start) as usize)
}

/// What a cube's failure means for who asked.
fn failed(error: CubeError) -> ServerError {
    match error {
        CubeError::Storage(error) => error.into(),
        error if error.is_retryable() => ServerError::CubeAway {
            what: error.to_string(),
        },
        error => ServerError::Defect {
            what: error.to_string(),
        },
    }
}

#[cfg(test)]
mod tests {
    use contract::grid::Grid;
    use contract::quantity::Quantity;
    use contract::time::Period;
    use cube::{Description, Edit};
    use futures::FutureExt as _;

    use super::*;
    use crate::gate::Pass;

    const KEY: &str = "zarr.json";

    /// A cube of one month.
    async fn keys(store: &Store) -> Keys {
        let description = Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: true,
            source: "a test".to_owned(),
            grid: Grid {
                rows: 4,
                cols: 8,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 45.0,
                dlon_deg: 45.0,
            },
            version: None,
            statistic: None,
        };
        let created = Repository::create(store, "cubes/p", &description).await;
        let repository = created.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        let values: Arc<[f32]> = vec![1.0; description.grid.cell_count()].into();
        let month = Period::month(2000, 1).unwrap();
        edit.put(month, values).await.unwrap();
        edit.commit("a month").await.unwrap();
        repository.keys(&At::Newest).await.unwrap()
    }

    /// One reads at a time and two wait; a client has room for 200 bytes.
    fn narrow(store: Store) -> Cubes {
        let held_bytes = IntGauge::new("held_bytes", "Bytes that are held.").unwrap();
        Cubes {
            store,
            open: Cache::new(HELD_OPEN),
            reads: Gate::new(1, 2),
            held: Rooms::new(400, held_bytes),
        }
    }

    #[tokio::test]
    async fn who_waits_for_room_lets_others_read_and_is_answered_when_there_is_some() {
        let store = Store::memory();
        let keys = keys(&store).await;
        let cubes = narrow(store);
        let full = cubes.held.enter(Client::asking(), 200).unwrap();
        let Pass {
            place: _place,
            turn,
        } = cubes.reads.enter().await.unwrap();
        let before = cubes.reads.enter().now_or_never();
        assert!(before.is_none(), "there is another turn: it tests nothing");
        let mut waiting = Box::pin(cubes.get(&keys, (ZarrVersion::Three, KEY), (None, 100), turn));
        assert!(waiting.as_mut().now_or_never().is_none());
        let next = cubes.reads.enter().now_or_never();
        assert!(next.is_some_and(|next| next.is_ok()), "the turn is held");
        drop(full);
        let content = waiting.await.unwrap().unwrap();
        assert_eq!(keys.get(KEY, None).await.unwrap().as_ref(), Some(&content));
        assert_eq!(cubes.held.held_bytes(), 100);
        drop(content);
        assert_eq!(cubes.held.held_bytes(), 0);
    }

    #[tokio::test]
    async fn who_leaves_while_he_waits_for_room_takes_neither_turn_nor_room() {
        let store = Store::memory();
        let keys = keys(&store).await;
        let cubes = narrow(store);
        let full = cubes.held.enter(Client::asking(), 200).unwrap();
        let Pass { place, turn } = cubes.reads.enter().await.unwrap();
        let mut leaving = Box::pin(cubes.get(&keys, (ZarrVersion::Three, KEY), (None, 100), turn));
        assert!(leaving.as_mut().now_or_never().is_none());
        drop((leaving, place));
        assert_eq!(cubes.held.held_bytes(), 200);
        drop(full);
        assert_eq!(cubes.held.held_bytes(), 0);
        let next = cubes.reads.enter().now_or_never();
        let Pass {
            place: _place,
            turn,
        } = next.expect("the turn is free").unwrap();
        // All of a client's room is there for the next one.
        let content = cubes
            .get(&keys, (ZarrVersion::Three, KEY), (None, 200), turn)
            .await
            .unwrap();
        assert!(content.is_some());
        assert_eq!(cubes.held.held_bytes(), 200);
    }
}
