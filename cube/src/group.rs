//! Groups of arrays: what they are of.

use std::sync::Arc;

use serde_json::{Map, Value};
use zarrs::group::{Group, GroupBuilder};
use zarrs::storage::AsyncWritableStorageTraits;

use crate::CubeError;

/// Writes a group: the one of all, whose name is empty, says what the arrays are of.
pub(crate) async fn write_group<S>(
    store: &Arc<S>,
    name: &str,
    attributes: Map<String, Value>,
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let stored = group(store, name, attributes)?.async_store_metadata().await;
    stored.map_err(|e| CubeError::library(&format!("the group {name:?}"), "writing", e))
}

pub(crate) fn group<S>(
    store: &Arc<S>,
    name: &str,
    attributes: Map<String, Value>,
) -> Result<Group<S>, CubeError> {
    let mut builder = GroupBuilder::new();
    builder.attributes(attributes);
    let built = builder.build(Arc::clone(store), &format!("/{name}"));
    built.map_err(|e| CubeError::library(&format!("the group {name:?}"), "defining it", e))
}
