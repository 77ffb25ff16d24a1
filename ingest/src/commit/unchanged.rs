//! Files that change nothing: their content is there, or files of later notices have their time; and what is still to be
//! told of them.
//!
//! A process can publish a file and die before its notice is finished; another one may then publish a newer file before
//! the notice comes again. The older file stays replaced, and what its notice has still to tell is the version that was
//! published with it.

use contract::manifest::{Manifest, ManifestId};
use contract::masked::MaskedCells;
use storage::{Store, manifests};

use super::landing_note;
use crate::error::IngestError;
use crate::notice::{Answer, PendingNotice, Versioned};

/// Versions that are looked through for the one that held a file.
const VERSIONS: u64 = 100;

/// Why a file changes nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Unchanged {
    /// Its content is there; so much of it is masked.
    Same(MaskedCells),
    /// Files of later notices have its time.
    Superseded,
}

/// Answers the notice of a file that changes nothing in the newest version. Whether the notice noted before that it was
/// about to publish the file is looked up, if it is not known.
pub(crate) async fn answer(
    store: &Store,
    notice: &PendingNotice,
    (newest, why): (Versioned, Unchanged),
    is_noted: Option<bool>,
) -> Result<Answer, IngestError> {
    let is_noted = if let Some(is_noted) = is_noted {
        is_noted
    } else {
        let product = &newest.manifest.product;
        landing_note::is_noted(store, product, newest.raw_sha256, notice.origin).await?
    };
    if is_noted {
        bring_cube_up(store, &newest.manifest).await?;
    }
    Ok(match why {
        Unchanged::Same(masked) => notice.already_landed(newest, masked, is_noted),
        Unchanged::Superseded => {
            let untold = if is_noted {
                last_version(store, &newest).await?
            } else {
                None
            };
            notice.superseded(newest.manifest, untold.as_ref())
        }
    })
}

/// Whoever published the file may have been killed before the cube followed.
async fn bring_cube_up(store: &Store, version: &ManifestId) -> Result<(), IngestError> {
    match manifests::load(store, version).await {
        Ok(manifest) => cube::keep_up(store, &manifest).await,
        // Cleaned up since it was looked for: there are newer ones.
        Err(e) if e.is_not_found() => {}
        Err(e) => return Err(IngestError::storage("read a manifest")(e)),
    }
    Ok(())
}

/// The newest version that holds a file which was replaced since. None if that version is gone or too long ago: then there
/// is nothing to tell.
async fn last_version(store: &Store, newest: &Versioned) -> Result<Option<Versioned>, IngestError> {
    let ManifestId {
        product, number, ..
    } = &newest.manifest;
    for number in (number.saturating_sub(VERSIONS)..*number).rev() {
        let manifest = manifests::numbered(store, product, number).await;
        let manifest = manifest.map_err(IngestError::storage("read a manifest"))?;
        if let Some(manifest) = manifest.filter(|m| holds_any(m, newest)) {
            let manifest = manifest.id();
            return Ok(Some(Versioned {
                manifest,
                ..newest.clone()
            }));
        }
    }
    Ok(None)
}

/// Does a version hold any step of a file?
fn holds_any(manifest: &Manifest, file: &Versioned) -> bool {
    file.periods.iter().any(|period| {
        let index = manifest.step_of(*period);
        index.is_some_and(|index| manifest.steps[index].raw_sha256 == file.raw_sha256)
    })
}
