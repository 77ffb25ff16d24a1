//! Our budgets beside what a paper and another program say: computed once for a version of the product, then kept.

use anyhow::Result;
use contract::check::Check;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document};

use crate::cli::Settings;
use crate::demo::source::SETS;
use crate::{deployment, progress};

/// Raised when the comparison itself changes, so that a kept one is not taken for it.
const COMPARISON_VERSION: u32 = 2;

/// Version of a kept comparison's JSON: from 2 on it is sealed.
const SCHEMA: u32 = 2;

/// A comparison as it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Kept {
    /// None of those that were kept before this was said.
    #[serde(default)]
    schema: u32,
    #[serde(flatten)]
    check: Check,
}

/// Compares a version of the flux with the published values, or takes the comparison that is kept.
pub(crate) async fn compare(settings: &Settings, store: &Store, flux: &Manifest) -> Result<Check> {
    let key = key(flux);
    if let Some(kept) = read(store, &key).await? {
        return Ok(kept);
    }
    let bar = progress::bar("budgets on Ballista", 1);
    let engine = deployment::engine(settings, store.clone())?;
    let rows = compute::compare(&engine, &flux.product).await?;
    progress::done(
        &bar,
        &format!("{} beside the paper's and independent ones", rows.len()),
    );
    let check = Check {
        rows,
        note: compute::published::CITATION.to_owned(),
        method: compute::published::METHOD.to_owned(),
    };
    let schema = SCHEMA;
    let kept = Kept { schema, check };
    document::put_over(store, &key, &kept).await?;
    Ok(kept.check)
}

/// The comparison that is kept for the newest version of the demo's flux, if there is one.
pub(crate) async fn stored(store: &Store) -> Result<Option<Check>> {
    let Some(flux) = storage::manifests::latest(store, &SETS[0].product.parse()?).await? else {
        return Ok(None);
    };
    read(store, &key(&flux)).await
}

fn key(flux: &Manifest) -> ObjectKey {
    ObjectKey::check(&Digest::of_json(&(COMPARISON_VERSION, flux.id())))
}

async fn read(store: &Store, key: &ObjectKey) -> Result<Option<Check>> {
    match document::get::<Kept>(store, key).await {
        Ok(kept) => Ok(kept.map(|kept| kept.check)),
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "published values are compared again");
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;

    const FROZEN: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../storage/tests/frozen/2/objects"
    );

    fn frozen_key() -> ObjectKey {
        ObjectKey::check(&Digest::of_json(&(COMPARISON_VERSION, "fgco2@1-0a1b2c3d")))
    }

    fn compared() -> Kept {
        let row = |paper| {
            let row = serde_json::json!({
                "what": "Global ocean", "period": "2000", "unit": "Pg C", "paper": paper,
                "independent": -1.404, "ours": -1.4041, "difference": -0.0001, "agrees": true,
            });
            serde_json::from_value(row).unwrap()
        };
        let check = Check {
            rows: vec![
                row(serde_json::json!({
                    "stated": {"value": -1.4, "uncertainty": 0.7, "decimals": 1},
                    "difference": -0.0041, "verdict": "within",
                })),
                row(serde_json::Value::Null),
            ],
            note: "a paper".to_owned(),
            method: "another program".to_owned(),
        };
        let schema = SCHEMA;
        Kept { schema, check }
    }

    /// A store that holds a comparison alone.
    async fn store(content: Vec<u8>) -> Store {
        let store = Store::memory();
        store.put_new(&frozen_key(), content.into()).await.unwrap();
        store
    }

    #[tokio::test]
    async fn a_frozen_comparison_is_shown_as_it_was_made() {
        if let Some(folder) = std::env::var_os("FLUXGLOBE_FREEZE").map(PathBuf::from) {
            let store = Store::open(folder.join("objects").to_str().unwrap()).unwrap();
            document::put_new(&store, &frozen_key(), &compared())
                .await
                .unwrap();
        }
        let kept = std::fs::read(Path::new(FROZEN).join(frozen_key().as_str())).unwrap();
        let found = read(&store(kept).await, &frozen_key())
            .await
            .unwrap()
            .unwrap();
        assert_eq!(found, compared().check);
    }

    #[tokio::test]
    async fn a_comparison_with_a_flipped_bit_is_made_again() {
        let kept = std::fs::read(Path::new(FROZEN).join(frozen_key().as_str())).unwrap();
        for at in 0..kept.len() * 8 {
            let mut flipped = kept.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            let found = read(&store(flipped).await, &frozen_key()).await.unwrap();
            assert_eq!(found, None, "bit {at}");
        }
    }
}
