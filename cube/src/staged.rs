//! Steps on their way into a cube.

use std::collections::BTreeMap;

use contract::time::TimeMs;

use crate::Step;
use crate::parts::SentStep;

/// Steps that were put, by the first instants of their periods.
pub(crate) type AllStaged = BTreeMap<TimeMs, Staged>;

/// A step whose values are in the store, and which nothing names yet.
pub(crate) struct Staged {
    pub(crate) step: Step,
    pub(crate) sent: SentStep,
}
