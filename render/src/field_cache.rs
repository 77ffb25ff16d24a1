//! A limit of bytes in, a cache for fields out: for those in memory and for those on a device alike.

use std::hash::Hash;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

/// About as many fields are kept: of a degree they are many more, of a sixtieth of one fewer.
const TYPICAL_FIELDS: usize = 256;
/// Share of the room for fields that were wanted again: the rest is for those that have just come, of which a picture needs
/// several.
const PROVEN_SHARE: f64 = 0.5;

/// An empty cache of at most `most_bytes`, as the weighter counts them.
///
/// # Panics
/// Never: its options are complete.
pub fn field_cache<K, V, W>(most_bytes: u64, weighter: W) -> Cache<K, V, W>
where
    K: Eq + Hash,
    V: Clone,
    W: Weighter<K, V> + Clone,
{
    // One shard: in several, each would have a part of the room that a field may not fit into.
    let options = OptionsBuilder::new()
        .shards(1)
        .estimated_items_capacity(TYPICAL_FIELDS)
        .weight_capacity(most_bytes)
        .hot_allocation(PROVEN_SHARE)
        .build()
        .expect("both capacities are given");
    let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
    Cache::with_options(options, weighter, hasher, lifecycle)
}
