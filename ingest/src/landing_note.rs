//! Which notice landed a file, noted before the file is published.
//!
//! A notice is answered with an event at the moment that its offset moves. A process can die between publishing a file
//! and that moment; the notice then comes again and finds its file published. Was it published by this notice, whose
//! event is still due, or by another one, which has told of it or will? The note tells: a notice that finds its own note
//! tells of the file; one that does not is a duplicate, and is finished in silence.
//!
//! Two processes that publish one file of two notices at the same moment have both noted it; the one that was slower is
//! silent, unless it dies just then: then both tell. Nothing is ever left untold.

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::product::ProductId;
use contract::topic::Origin;
use storage::Store;

use crate::error::IngestError;

fn key(product: &ProductId, raw_sha256: Digest, origin: Origin) -> Result<ObjectKey, IngestError> {
    let Origin {
        partition, offset, ..
    } = origin;
    let folder = Kind::Landing.folder();
    Ok(format!("{folder}/{product}/{raw_sha256}-{partition}-{offset}").parse()?)
}

/// Notes that a notice is about to publish a file; true if that was noted before.
pub(crate) async fn note(
    store: &Store,
    product: &ProductId,
    raw_sha256: Digest,
    origin: Origin,
) -> Result<bool, IngestError> {
    let content = Bytes::from(origin.to_string());
    let is_new = store
        .put_new(&key(product, raw_sha256, origin)?, content)
        .await
        .map_err(IngestError::storage("note a landing"))?;
    Ok(!is_new)
}

/// Has this notice begun to publish the file before?
pub(crate) async fn is_noted(
    store: &Store,
    product: &ProductId,
    raw_sha256: Digest,
    origin: Origin,
) -> Result<bool, IngestError> {
    store
        .exists(&key(product, raw_sha256, origin)?)
        .await
        .map_err(IngestError::storage("look up a landing"))
}
