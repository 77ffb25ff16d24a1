//! A store in; an error out where nothing can be committed, for its clock and this machine's lie too far apart.

use chrono::{DateTime, Utc};
use contract::key::ObjectKey;
use object_store::ObjectStoreExt as _;
use object_store::path::Path;
use storage::{StorageError, Store, sound};

use crate::CubeError;

/// Most that they may differ at a commit: Icechunk refuses one above it, once all of it is written.
const MOST_S: i64 = 600;
/// An object beside those of a cube, of which the store says when it was written.
const NAME: &str = "clock";
const CONTENT: &[u8] = b"when?";

/// # Errors
/// `Clock` where a commit would be refused. A store that does not answer, or cannot be written to.
pub(crate) async fn check(store: &Store, folder: &str) -> Result<(), CubeError> {
    let key: ObjectKey = format!("{folder}/{NAME}")
        .parse()
        .map_err(|e: contract::ContractError| CubeError::library(folder, "naming an object", e))?;
    // Who is killed over this leaves an object that is sound.
    let content = sound::cube::sealed(NAME, CONTENT).unwrap_or_default();
    let before = Utc::now();
    store.put_over(&key, content.into()).await?;
    let written = store.object_store().head(&Path::from(key.as_str())).await;
    let after = Utc::now();
    store.remove(&key).await?;
    let written = written.map_err(|source| StorageError::Object {
        key: key.to_string(),
        source,
    })?;
    if are_near(written.last_modified, [before, after]) {
        return Ok(());
    }
    Err(CubeError::Clock {
        place: format!("{}{folder}", store.url()),
        reason: format!(
            "this machine's clock says {after}, and that of the store {}",
            written.last_modified
        ),
    })
}

/// Can what a store wrote at an instant of its own clock have been written between two of this machine's?
fn are_near(written: DateTime<Utc>, [before, after]: [DateTime<Utc>; 2]) -> bool {
    (before - written).num_seconds() <= MOST_S && (written - after).num_seconds() <= MOST_S
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_store_is_near_and_one_that_lives_earlier_or_later_is_not() {
        let at = |s| DateTime::from_timestamp(s, 0).unwrap();
        // Writing took half an hour.
        let own = [at(10_000), at(11_800)];
        for written in [9_400, 10_000, 11_000, 11_800, 12_400] {
            assert!(are_near(at(written), own), "{written}");
        }
        for written in [0, 9_399, 12_401, 100_000] {
            assert!(!are_near(at(written), own), "{written}");
        }
    }
}
