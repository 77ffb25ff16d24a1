//! Hadoop file systems: a whole object appears under its name at once, by a rename that replaces nothing.

use std::sync::{Arc, OnceLock};

use hdfs_native_object_store::HdfsObjectStoreBuilder;
use object_store::{Error, ObjectStore};
use tokio::runtime::{Handle, Runtime};

use super::retry_store::RetryStore;
use super::settings::Settings;

/// Opens the file system of a name node (`HOST:PORT`) or a name service; nothing is sent yet.
///
/// The client writes to `.NAME.tmp.N` in the same folder and renames: a writer that is killed half way leaves such a
/// file behind and nothing under the name itself.
///
/// # Errors
/// What to set, in words.
pub(super) fn open(node: &str, settings: &Settings) -> Result<Arc<dyn ObjectStore>, String> {
    let url = format!("hdfs://{node}");
    let runtime = runtime().map_err(|e| format!("no threads for it: {e}"))?;
    let connect = move || {
        let client = HdfsObjectStoreBuilder::new()
            .with_url(&url)
            .with_io_runtime(runtime.clone())
            .build()?;
        Ok(Arc::new(client) as Arc<dyn ObjectStore>)
    };
    let store =
        RetryStore::new(Box::new(connect), settings.retry_limits, classify).map_err(|e| {
            format!(
                "{e}; give hdfs://HOST:PORT/PREFIX, or set HADOOP_CONF_DIR to the folder whose \
             hdfs-site.xml knows the name service"
            )
        })?;
    Ok(Arc::new(store))
}

/// Threads of connections to name and data nodes. They are the process' own, for a client outlives the runtime that it
/// was opened in.
fn runtime() -> std::io::Result<Handle> {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    if let Some(runtime) = RUNTIME.get() {
        return Ok(runtime.handle().clone());
    }
    let made = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("hdfs")
        .enable_all()
        .build()?;
    Ok(RUNTIME.get_or_init(|| made).handle().clone())
}

/// The client tells what will not change only in the text of the name node's answer.
fn classify(error: Error) -> Error {
    const REFUSED: [&str; 2] = ["AccessControlException", "AuthorizationException"];
    const IMPOSSIBLE: [&str; 3] = [
        "PathIsNotEmptyDirectoryException",
        "ParentNotDirectoryException",
        "InvalidPathException",
    ];
    let Error::Generic { store, source } = error else {
        return error;
    };
    let text = source.to_string();
    if REFUSED.iter().any(|name| text.contains(name)) {
        let path = "hdfs (the user is HADOOP_USER_NAME or that of this process)".to_owned();
        return Error::PermissionDenied { path, source };
    }
    if IMPOSSIBLE.iter().any(|name| text.contains(name)) {
        return Error::NotSupported { source };
    }
    Error::Generic { store, source }
}

/// Is this the last part of a key under which a half-written object may lie?
pub(super) fn is_half_written(name: &str) -> bool {
    name.strip_prefix('.')
        .and_then(|rest| rest.rsplit_once(".tmp."))
        .is_some_and(|(_, index)| !index.is_empty() && index.bytes().all(|b| b.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_written_objects_are_told_by_their_names() {
        assert!(is_half_written(".0000000001.json.tmp.1"));
        assert!(is_half_written("..tmp.23"));
        for name in ["a.tmp.1", ".a.tmp.", ".a.tmp.x", ".a", "tmp.1", ""] {
            assert!(!is_half_written(name), "{name}");
        }
    }

    #[test]
    fn a_missing_permission_is_not_tried_again() {
        let answer = |text: &str| Error::Generic {
            store: "HDFS",
            source: text.to_owned().into(),
        };
        let refused =
            "RPC error: org.apache.hadoop.security.AccessControlException Permission denied";
        assert!(!crate::error::may_pass(&classify(answer(refused))));
        let safe_mode = "RPC error: org.apache.hadoop.hdfs.server.namenode.SafeModeException";
        assert!(crate::error::may_pass(&classify(answer(safe_mode))));
    }
}
