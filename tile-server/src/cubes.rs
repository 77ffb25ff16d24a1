//! Cubes of products, opened once a version.

use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use contract::product::ProductId;
use cube::{At, CubeError, Keys, Repository};
use prometheus::IntGauge;
use quick_cache::sync::Cache;
use storage::Store;

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
            let keys = repository.keys(&At::Version(number.to_string())).await;
            keys.map(Arc::new)
        });
        match self.open.get_or_insert_async(&name, opening).await {
            Ok(keys) => Ok(keys),
            Err(CubeError::Missing { .. } | CubeError::NoVersion { .. }) => {
                Err(self.without_cube(product, number, name).await?)
            }
            Err(error) => Err(failed(error)),
        }
    }

    /// Why a version has no cube.
    async fn without_cube(
        &self,
        product: &ProductId,
        number: u64,
        name: String,
    ) -> Result<ServerError, ServerError> {
        let version = storage::manifests::numbered(&self.store, product, number).await?;
        let attached = match &version {
            Some(version) => self.store.attached_to(version).await?,
            None => None,
        };
        Ok(match attached {
            Some(attachment) => ServerError::Attached {
                name,
                // A folder is of no use to who asks, and none of their business.
                place: if attachment.store.contains("://") {
                    format!("read it there, at {}", attachment.store)
                } else {
                    "it is not given out here".to_owned()
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
        key: &str,
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
        let content = self.answered(keys, keys.get(key, range).await)?;
        // The room goes with the bytes, not with the body: that one ends when they lie in the connection's queue.
        Ok(content.map(|content| {
            Bytes::from_owner(Held {
                content,
                _room: room,
            })
        }))
    }

    /// Its length.
    pub(crate) async fn length(&self, keys: &Keys, key: &str) -> Result<Option<u64>, ServerError> {
        self.answered(keys, keys.length(key).await)
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
