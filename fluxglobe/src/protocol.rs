//! What all processes over one store must agree on: a service of another version is told before it does any work.

use std::sync::LazyLock;

use contract::event::EVENT_SCHEMA;
use contract::job::RENDERER_VERSION;
use contract::key::ObjectKey;
use contract::manifest::MANIFEST_SCHEMA;
use serde::{Deserialize, Serialize};
use storage::sound::seal;
use storage::{StorageError, Store, document};

/// Where it is written.
const KEY: &str = "protocol/current.json";

/// Versions of what is stored and told under names that do not hold them. That of the renderer is not among them: the
/// name of a picture holds it, and a render worker and whoever asks it compare theirs with every job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
struct Protocol {
    /// Of this document: from 2 on it is sealed.
    schema: u32,
    event_schema: u32,
    manifest_schema: u32,
}

/// The same as others wrote it down; what this program does not know, it cannot agree to.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(rename = "schema")]
    _schema: Option<u32>,
    event_schema: u32,
    manifest_schema: u32,
    /// Programs up to 0.1.0 wrote theirs down.
    #[serde(rename = "renderer_version")]
    _renderer_version: Option<u32>,
}

const OURS: Protocol = Protocol {
    schema: 2,
    event_schema: EVENT_SCHEMA,
    manifest_schema: MANIFEST_SCHEMA,
};

/// Version of this program.
pub(crate) const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// The program's version and those of what its processes exchange: two programs with the same events and manifests may run
/// side by side, and draw for each other if their renderers are the same too.
pub(crate) fn version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        format!(
            "{PROGRAM} (events {}, manifests {}, renderer {})",
            OURS.event_schema, OURS.manifest_schema, RENDERER_VERSION
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
///
/// # Errors
/// `Differs` with both, `Storage` with the name of what is written down if that is damaged.
pub(crate) async fn agree(store: &Store) -> Result<(), ProtocolError> {
    let key: ObjectKey = KEY.parse().expect("the key is constant and valid");
    match document::put_new(store, &key, &OURS).await {
        Ok(_new_or_equal) => Ok(()),
        Err(StorageError::Conflict { .. }) => {
            let theirs = seal::opened(&store.get(&key).await?);
            if fits(&theirs) {
                return Ok(());
            }
            let ours = serde_json::to_string(&OURS).expect("a struct of numbers is JSON");
            let theirs = String::from_utf8_lossy(&theirs).chars().take(200).collect();
            Err(ProtocolError::Differs { theirs, ours })
        }
        Err(error) => Err(error.into()),
    }
}

/// Is what others wrote down what this program reads and writes?
fn fits(theirs: &[u8]) -> bool {
    let written: Result<Written, _> = serde_json::from_slice(theirs);
    written.is_ok_and(|theirs| {
        let Written {
            event_schema,
            manifest_schema,
            ..
        } = theirs;
        (event_schema, manifest_schema) == (OURS.event_schema, OURS.manifest_schema)
    })
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use bytes::Bytes;

    use super::*;

    async fn beside(theirs: String) -> Result<(), ProtocolError> {
        let store = Store::memory();
        let key = KEY.parse().unwrap();
        store.put_new(&key, Bytes::from(theirs)).await.unwrap();
        agree(&store).await
    }

    #[tokio::test]
    async fn a_store_of_another_version_is_refused_with_both_named() {
        let store = Store::memory();
        agree(&store).await.unwrap();
        agree(&store).await.unwrap();
        let (events, manifests) = (EVENT_SCHEMA, MANIFEST_SCHEMA);
        let unknown = format!(
            r#"{{"event_schema":{events},"manifest_schema":{manifests},"frame_schema":99}}"#
        );
        let newer = format!(r#"{{"event_schema":{events},"manifest_schema":99}}"#);
        for theirs in [r#"{"event_schema":99}"#, "99, no JSON", &newer, &unknown] {
            let error = beside(theirs.to_owned()).await.unwrap_err();
            assert!(
                error.to_string().contains("99") && !error.is_retryable(),
                "{error}"
            );
        }
    }

    #[tokio::test]
    async fn programs_whose_renderers_alone_differ_run_side_by_side() {
        let (events, manifests) = (EVENT_SCHEMA, MANIFEST_SCHEMA);
        let theirs = format!(
            r#"{{"event_schema":{events},"manifest_schema":{manifests},"renderer_version":{}}}"#,
            RENDERER_VERSION - 1
        );
        beside(theirs).await.unwrap();
    }

    fn frozen() -> Vec<u8> {
        let store = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../storage/tests/frozen/2/objects"
        );
        std::fs::read(Path::new(store).join(KEY)).unwrap()
    }

    #[tokio::test]
    async fn a_store_that_was_frozen_is_agreed_on() {
        if let Some(folder) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
            let store = Store::open(folder.join("objects").to_str().unwrap()).unwrap();
            agree(&store).await.unwrap();
        }
        assert_eq!(
            (EVENT_SCHEMA, MANIFEST_SCHEMA),
            (2, 2),
            "freeze what is agreed on now, too"
        );
        let text = String::from_utf8(frozen()).unwrap();
        beside(text.clone()).await.unwrap();
        // What programs wrote before it was sealed.
        beside(r#"{"event_schema":2,"manifest_schema":2}"#.to_owned())
            .await
            .unwrap();
        let store = Store::memory();
        agree(&store).await.unwrap();
        assert_eq!(store.get(&KEY.parse().unwrap()).await.unwrap(), text);
    }

    #[tokio::test]
    async fn a_flipped_bit_of_what_was_agreed_is_an_error_that_names_it() {
        let whole = frozen();
        for at in 0..whole.len() * 8 {
            let mut flipped = whole.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            let store = Store::memory();
            let key = KEY.parse().unwrap();
            store.put_new(&key, Bytes::from(flipped)).await.unwrap();
            let error = agree(&store).await.unwrap_err();
            assert!(error.to_string().contains(KEY), "bit {at}: {error}");
        }
    }
}
