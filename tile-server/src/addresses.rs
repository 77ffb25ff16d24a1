//! Tiles whose address was asked for lately: the address in, what it came to out. To read it again is most of the work of a
//! tile that lies in memory.
//!
//! What an address comes to is told by itself and by the version of its product that is the newest; those that name more
//! than that, an older version or another product beside the layer, are read every time.

use std::sync::Arc;

use contract::job::{Mode, View};
use contract::time::TimeMs;
use quick_cache::sync::Cache;

use crate::catalogue::Layer;
use crate::routes::picture::Head;

/// Addresses remembered: some 10 MiB.
const REMEMBERED: usize = 8192;
/// The longest one that is: beyond are colours stop by stop.
const LONGEST_BYTES: usize = 512;

/// What the address of a tile came to.
pub(crate) struct KnownTile {
    /// Of the version that was the newest then.
    pub(crate) layer: Arc<Layer>,
    pub(crate) mode: Mode,
    /// What is worth drawing ahead, and the instant that was asked for.
    pub(crate) hot: Option<(View, Option<TimeMs>)>,
    /// Everything of the answer but the picture.
    pub(crate) head: Head,
}

/// The addresses of one server.
pub(crate) struct Addresses(Cache<String, Arc<KnownTile>>);

impl Default for Addresses {
    fn default() -> Self {
        Self(Cache::new(REMEMBERED))
    }
}

impl Addresses {
    /// What an address came to when it was read last.
    pub(crate) fn known(&self, address: &str) -> Option<Arc<KnownTile>> {
        self.0.get(address)
    }

    /// Remembers it.
    pub(crate) fn remember(&self, address: &str, tile: KnownTile) {
        if address.len() <= LONGEST_BYTES {
            self.0.insert(address.to_owned(), Arc::new(tile));
        }
    }
}
