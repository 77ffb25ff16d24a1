//! What all processes over one store must agree on: a service of another version is told before it does any work.

use std::sync::LazyLock;

use bytes::Bytes;
use contract::event::EVENT_SCHEMA;
use contract::job::RENDERER_VERSION;
use contract::key::ObjectKey;
use contract::manifest::MANIFEST_SCHEMA;
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store};

/// Where it is written.
const KEY: &str = "protocol/current.json";

/// Versions of everything that two processes exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Protocol {
    event_schema: u32,
    manifest_schema: u32,
    renderer_version: u32,
}

const OURS: Protocol = Protocol {
    event_schema: EVENT_SCHEMA,
    manifest_schema: MANIFEST_SCHEMA,
    renderer_version: RENDERER_VERSION,
};

/// Version of this program.
pub(crate) const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// The program's version and those of what its processes exchange: two programs whose last three are the same may run
/// side by side.
pub(crate) fn version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        format!(
            "{PROGRAM} (events {}, manifests {}, renderer {})",
            OURS.event_schema, OURS.manifest_schema, OURS.renderer_version
        )
    });
    &TEXT
}

/// The store cannot be used, or is used by another version.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProtocolError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error(
        "the store is used by services of another version ({theirs}); this one is {ours}. Stop them all, then remove {KEY}"
    )]
    Differs { theirs: String, ours: String },
}

impl ProtocolError {
    /// May the same call succeed later?
    pub(crate) fn is_retryable(&self) -> bool {
        match self {
            Self::Storage(error) => error.is_retryable(),
            Self::Differs { .. } => false,
        }
    }
}

/// Writes down our versions, or compares them with those that are written down.
pub(crate) async fn agree(store: &Store) -> Result<(), ProtocolError> {
    let key: ObjectKey = KEY.parse().expect("the key is constant and valid");
    let ours = serde_json::to_string(&OURS).expect("a struct of numbers is JSON");
    match store.put_new(&key, Bytes::from(ours.clone())).await {
        Ok(_new_or_equal) => Ok(()),
        Err(StorageError::Conflict { .. }) => {
            let theirs = String::from_utf8_lossy(&store.get(&key).await?)
                .chars()
                .take(200)
                .collect();
            Err(ProtocolError::Differs { theirs, ours })
        }
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_store_of_another_version_is_refused_with_both_named() {
        let store = Store::memory();
        agree(&store).await.unwrap();
        agree(&store).await.unwrap();
        let other = Store::memory();
        let key = KEY.parse().unwrap();
        let theirs = Bytes::from_static(b"{\"event_schema\":99}");
        other.put_new(&key, theirs).await.unwrap();
        let error = agree(&other).await.unwrap_err();
        assert!(
            error.to_string().contains("99") && !error.is_retryable(),
            "{error}"
        );
    }
}
