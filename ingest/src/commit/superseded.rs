//! Files that came too late: files of later notices have their time. Which version held such a file, if one did.
//!
//! A process can publish a file and die before its notice is finished; another one may then publish a newer file before
//! the notice comes again. The older file stays replaced, and what its notice has still to tell is the version that was
//! published with it.

use contract::digest::Digest;
use contract::manifest::{Manifest, ManifestId};
use contract::time::Period;
use storage::{Store, manifests};

use crate::error::IngestError;

/// Versions that are looked through for the one that held a file.
const VERSIONS: u64 = 100;

/// The newest version that holds a file which was replaced since, if its notice noted that it was about to publish it.
/// None if it never did, or if that version is gone or too long ago: then there is nothing to tell.
pub(crate) async fn untold(
    store: &Store,
    newest: &ManifestId,
    raw_sha256: Digest,
    periods: &[Period],
    is_noted: bool,
) -> Result<Option<ManifestId>, IngestError> {
    if !is_noted {
        return Ok(None);
    }
    for number in (newest.number.saturating_sub(VERSIONS)..newest.number).rev() {
        let manifest = manifests::numbered(store, &newest.product, number).await;
        let manifest = manifest.map_err(IngestError::storage("read a manifest"))?;
        if let Some(manifest) = manifest.filter(|m| holds_any(m, periods, raw_sha256)) {
            return Ok(Some(manifest.id()));
        }
    }
    Ok(None)
}

fn holds_any(manifest: &Manifest, periods: &[Period], raw_sha256: Digest) -> bool {
    let holds = |period: &Period| {
        manifest
            .step_of(*period)
            .is_some_and(|index| manifest.steps[index].raw_sha256 == raw_sha256)
    };
    periods.iter().any(holds)
}
