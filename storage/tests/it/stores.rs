//! The stores that the suite runs on, each empty and for one test alone.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use futures::{StreamExt as _, TryStreamExt as _, stream};
use storage::Store;

/// A store, and what must be kept or taken away with it.
pub(crate) struct Opened {
    pub(crate) store: Store,
    _folder: Option<tempfile::TempDir>,
}

impl Opened {
    /// Takes away what a test left in a store that others use too.
    pub(crate) async fn clear(self) {
        let keys = self.store.list("").await.unwrap();
        stream::iter(&keys)
            .map(|key| self.store.remove(key))
            .buffer_unordered(16)
            .try_collect::<Vec<()>>()
            .await
            .unwrap();
        self.store.remove_leftovers(Duration::ZERO).await.unwrap();
    }
}

pub(crate) fn folder() -> Opened {
    let folder = tempfile::tempdir().unwrap();
    Opened {
        store: Store::open(folder.path().to_str().unwrap()).unwrap(),
        _folder: Some(folder),
    }
}

pub(crate) fn memory() -> Opened {
    Opened {
        store: Store::open("memory:").unwrap(),
        _folder: None,
    }
}

pub(crate) fn s3() -> Opened {
    remote(&s3_url())
}

pub(crate) fn hdfs() -> Opened {
    remote(&hdfs_url())
}

fn remote(url: &str) -> Opened {
    Opened {
        store: Store::open(url).unwrap(),
        _folder: None,
    }
}

/// A place of its own in the bucket of the S3 server.
pub(crate) fn s3_url() -> String {
    format!("s3://{}/{}", service("FLUXGLOBE_S3_BUCKET"), own_prefix())
}

/// A place of its own in the Hadoop file system.
pub(crate) fn hdfs_url() -> String {
    format!("{}/{}", service("FLUXGLOBE_HDFS"), own_prefix())
}

/// What `services.sh env` says of a service.
pub(crate) fn service(name: &str) -> String {
    std::env::var_os(name)
        .and_then(|value| value.into_string().ok())
        .unwrap_or_else(|| {
            panic!(
                "{name} is not set: run `deploy/services/services.sh start s3 hdfs` and \
                 `eval \"$(deploy/services/services.sh env)\"`, or `make test`, which does both"
            )
        })
}

fn own_prefix() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    format!("test-{}-{}-{number}", now.as_nanos(), std::process::id())
}
