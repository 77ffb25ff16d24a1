//! Damaged objects are counted where they are found.

use std::sync::LazyLock;

use contract::key::ObjectKey;
use contract::kind::Kind;
use prometheus::{IntCounterVec, Opts, Registry};

use crate::StorageError;

/// Of this process, whichever of its stores they lie in.
static FOUND: LazyLock<IntCounterVec> = LazyLock::new(|| {
    let counter = IntCounterVec::new(
        Opts::new(
            "fluxglobe_storage_damaged_objects_total",
            "Times that a stored object was found damaged, by its kind.",
        ),
        &["kind"],
    )
    .expect("the name and the label are constant and valid");
    for kind in Kind::ALL {
        // There from the start, so that the first one is seen as a rise.
        counter.with_label_values(&[kind.folder()]);
    }
    counter
});

/// Shows the count with the metrics of a service.
///
/// # Errors
/// It is registered there already.
pub fn register(registry: &Registry) -> Result<(), prometheus::Error> {
    registry.register(Box::new(FOUND.clone()))
}

/// How often objects of a kind were found damaged by this process.
pub fn count(kind: Kind) -> u64 {
    FOUND.with_label_values(&[kind.folder()]).get()
}

/// A stored object that is not what it must be.
pub fn found(key: &ObjectKey, reason: impl std::fmt::Display) -> StorageError {
    let kind = Kind::of(key).map_or("other", Kind::folder);
    FOUND.with_label_values(&[kind]).inc();
    StorageError::damaged(key.as_str(), reason)
}
