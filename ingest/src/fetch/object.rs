//! Files in object stores, below the prefixes that the settings name.

use std::sync::Arc;

use contract::event::RejectReason;
use object_store::path::Path;
use object_store::{GetResult, ObjectStore, ObjectStoreExt as _};
use storage::Store;
use url::Url;

use super::retry::Miss;
use crate::error::{IngestError, Rejection};

/// A prefix that files may be read below.
#[derive(Debug)]
pub(super) struct AllowedStore {
    /// Scheme and bucket or server.
    scheme: String,
    authority: String,
    prefix: Path,
    objects: Arc<dyn ObjectStore>,
}

impl AllowedStore {
    /// Opens the store of a prefix, such as `s3://BUCKET/FOLDER`.
    pub(super) fn open(text: &str) -> Result<Self, IngestError> {
        let bad = |detail: String| IngestError::Setting {
            setting: "allow-store",
            detail,
        };
        let url = Url::parse(text).map_err(|e| bad(format!("{e}; give s3://BUCKET/FOLDER")))?;
        if !matches!(url.scheme(), "s3" | "gs" | "az" | "hdfs") || !url.has_host() {
            return Err(bad(
                "give s3://, gs://, az:// or hdfs:// and a bucket or server".to_owned(),
            ));
        }
        let prefix = Path::from_url_path(url.path()).map_err(|e| bad(e.to_string()))?;
        let authority = authority(&url);
        let root = format!("{}://{authority}/", url.scheme());
        let store = Store::open(&root).map_err(IngestError::storage("open an allowed store"))?;
        Ok(Self {
            scheme: url.scheme().to_owned(),
            authority,
            prefix,
            objects: store.object_store(),
        })
    }

    /// The path of a file below the prefix.
    fn path_of(&self, url: &Url) -> Option<Path> {
        let path = Path::from_url_path(url.path()).ok()?;
        let is_below = url.scheme() == self.scheme
            && authority(url) == self.authority
            && path.prefix_matches(&self.prefix);
        is_below.then_some(path)
    }
}

/// Bucket or server, without a user's name and password.
fn authority(url: &Url) -> String {
    let host = url.host_str().unwrap_or_default();
    url.port()
        .map_or_else(|| host.to_owned(), |port| format!("{host}:{port}"))
}

/// The answer that holds the file.
pub(super) async fn get(stores: &[AllowedStore], url: &Url) -> Result<GetResult, Miss> {
    let found = stores
        .iter()
        .find_map(|store| Some((store, store.path_of(url)?)));
    let Some((store, path)) = found else {
        let detail = "is not below an allowed prefix; allow it with --allow-store";
        return Err(Rejection::new(RejectReason::Location, "path", detail).into());
    };
    store.objects.get(&path).await.map_err(miss)
}

/// What a failure of a store means; its text can name the store's own address but no secret.
pub(super) fn miss(error: object_store::Error) -> Miss {
    use object_store::Error;
    match error {
        Error::NotFound { .. } => Miss::Absent("the store has no such object".to_owned()),
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            Miss::Absent("the store does not let it be read".to_owned())
        }
        other => Miss::Away(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_below(prefix: &str, url: &str) -> bool {
        let prefix: Url = prefix.parse().unwrap();
        let store = AllowedStore {
            scheme: prefix.scheme().to_owned(),
            authority: authority(&prefix),
            prefix: Path::from_url_path(prefix.path()).unwrap(),
            objects: Store::memory().object_store(),
        };
        store.path_of(&url.parse().unwrap()).is_some()
    }

    #[test]
    fn a_prefix_is_a_folder_and_not_a_beginning() {
        assert!(is_below("s3://b/in", "s3://b/in/x.nc"));
        assert!(is_below("s3://b/in/", "s3://b/in/y/x.nc"));
        assert!(is_below("s3://b", "s3://b/x.nc"));
        assert!(is_below("hdfs://h:9000/in", "hdfs://user@h:9000/in/x.nc"));
        for url in [
            "s3://b/inside/x.nc",
            "s3://b/other/x.nc",
            "s3://b/in/../secret",
            "s3://b/in/%2e%2e/secret",
            "s3://b/in/..%2Fsecret",
            "s3://c/in/x.nc",
            "gs://b/in/x.nc",
        ] {
            assert!(!is_below("s3://b/in", url), "{url}");
        }
        assert!(!is_below("hdfs://h:9000/in", "hdfs://h:9001/in/x.nc"));
    }
}
