//! An address in, what can be read behind it out.

use std::sync::Arc;

use cube::foreign::{ForeignError, Objects, StoredObjects};

/// Opens a folder of this machine, or a part of a bucket (`s3://`, `gs://`, `az://`). Nothing is sent for it.
pub(super) fn open(address: &str) -> Result<Arc<dyn Objects>, ForeignError> {
    if let Some((scheme, _)) = address.split_once("://")
        && !matches!(scheme, "file" | "s3" | "gs" | "az" | "hdfs")
    {
        let reason =
            "give a folder, or s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX";
        return Err(ForeignError::refused(scheme, reason));
    }
    Ok(Arc::new(StoredObjects::open(address)?))
}
