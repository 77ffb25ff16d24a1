//! An address in, what can be read behind it out.

use std::sync::Arc;

use cube::foreign::{ForeignError, Objects, StoredObjects};

use crate::fetch::WebObjects;

/// Opens a folder of this machine, a part of a bucket (`s3://`, `gs://`, `az://`), or what lies behind `http:` or `https:`.
/// Nothing is sent for it.
pub(super) fn open(address: &str) -> Result<Arc<dyn Objects>, ForeignError> {
    match address.split_once("://").map(|(scheme, _)| scheme) {
        Some("http" | "https") => Ok(Arc::new(WebObjects::new(address)?)),
        None | Some("file" | "s3" | "gs" | "az" | "hdfs") => {
            Ok(Arc::new(StoredObjects::open(address)?))
        }
        Some(scheme) => {
            let reason = "give a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX, or an address of http: or https:";
            Err(ForeignError::refused(
                format!("the scheme {scheme}"),
                reason,
            ))
        }
    }
}
