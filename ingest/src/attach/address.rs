//! An address in, what can be read behind it out.

use std::sync::Arc;

use cube::foreign::{ForeignError, Objects, StoredObjects};
use url::Url;

use crate::fetch::WebObjects;

/// Opens a folder of this machine, a part of a bucket (`s3://`, `gs://`, `az://`), or what lies behind `http:` or `https:`.
/// Nothing is sent for it.
pub(super) fn open(address: &str) -> Result<Arc<dyn Objects>, ForeignError> {
    match address.split_once("://").map(|(scheme, _)| scheme) {
        Some("http" | "https") => Ok(Arc::new(WebObjects::new(address)?)),
        Some("file") => Ok(Arc::new(StoredObjects::open(&folder(address)?)?)),
        None | Some("s3" | "gs" | "az" | "hdfs") => Ok(Arc::new(StoredObjects::open(address)?)),
        Some(scheme) => {
            let reason = "give a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX, or an address of http: or https:";
            Err(ForeignError::refused(
                format!("the scheme {scheme}"),
                reason,
            ))
        }
    }
}

/// The folder behind `file://`, as URLs have it: signs may be escaped, and `%20` is a space.
fn folder(address: &str) -> Result<String, ForeignError> {
    let refused = |reason: &str| ForeignError::refused(address, reason);
    let url = Url::parse(address).map_err(|e| refused(&format!("is no URL: {e}")))?;
    if url.query().is_some() || url.fragment().is_some() {
        let reason =
            "has ? or #, which end the path of a URL: write them %3F and %23, or give the folder";
        return Err(refused(reason));
    }
    let path = url.to_file_path();
    let path = path.map_err(|()| refused("names another machine; give file:///FOLDER"))?;
    let path = path.into_os_string().into_string();
    path.map_err(|_no_text| refused("is not UTF-8 when its signs are read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_a_url_of_a_folder_are_read_as_those_of_a_file_are() {
        let place = tempfile::tempdir().unwrap();
        let own = place.path().join("sea # 50%/sst.zarr");
        std::fs::create_dir_all(&own).unwrap();
        let opened = |address: &str| open(address).map(|objects| objects.place());
        let path = own.to_str().unwrap();
        let url = Url::from_file_path(path).unwrap();
        assert!(
            url.as_str().ends_with("/sea%20%23%2050%25/sst.zarr"),
            "{url}"
        );
        // A path is as it is written.
        let there = opened(path).unwrap();
        assert!(there.ends_with("/sea # 50%/sst.zarr"), "{there}");
        assert_eq!(opened(url.as_str()).unwrap(), there);
        for (address, said) in [
            (format!("file://{path}"), "%23"),
            (
                "file://other-machine/sst.zarr".to_owned(),
                "another machine",
            ),
            ("file:///sst%FF.zarr".to_owned(), "UTF-8"),
            ("file:///sst%20.zarr".to_owned(), "no such folder"),
        ] {
            let error = opened(&address).unwrap_err();
            assert!(error.to_string().contains(said), "{address}: {error}");
        }
    }
}
