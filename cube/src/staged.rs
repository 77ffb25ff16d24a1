//! Steps on their way into a cube.

use std::collections::BTreeMap;

use contract::time::TimeMs;
use icechunk::format::manifest::ChunkPayload;

use crate::Step;

/// Steps that were put, by the first instants of their periods.
pub(crate) type AllStaged = BTreeMap<TimeMs, Staged>;

/// A step whose values are in the store, and which nothing names yet.
pub(crate) struct Staged {
    pub(crate) step: Step,
    /// By row and column of objects; none where no cell has data.
    pub(crate) objects: Vec<([u32; 2], Option<ChunkPayload>)>,
}
