//! Our budgets beside what a paper and another program say: computed once for a version of the product, then kept.

use anyhow::Result;
use compute::check::CheckRow;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document};
use tile_server::backend::{self as wire, Check};

use crate::cli::Settings;
use crate::demo::source::SETS;
use crate::{deployment, progress};

/// Raised when the comparison itself changes, so that a kept one is not taken for it.
const COMPARISON_VERSION: u32 = 2;

/// A comparison and where the values beside ours come from.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Comparison {
    pub(crate) rows: Vec<CheckRow>,
    /// The paper.
    pub(crate) note: String,
    /// The other program.
    pub(crate) method: String,
}

impl Comparison {
    /// As the tile server tells it.
    pub(crate) fn to_wire(&self) -> Check {
        let row = |row: &CheckRow| wire::CheckRow {
            what: row.what.clone(),
            period: row.period.clone(),
            unit: row.unit.clone(),
            paper: row.paper.map(|paper| wire::Paper {
                value: paper.stated.value,
                uncertainty: paper.stated.uncertainty,
                decimals: paper.stated.decimals,
                difference: paper.difference,
                verdict: paper.verdict.as_str().to_owned(),
            }),
            independent: row.independent,
            ours: row.ours,
            difference: row.difference,
            agrees: row.agrees,
        };
        Check {
            rows: self.rows.iter().map(row).collect(),
            note: self.note.clone(),
            method: self.method.clone(),
        }
    }
}

/// Compares a version of the flux with the published values, or takes the comparison that is kept.
pub(crate) async fn compare(
    settings: &Settings,
    store: &Store,
    flux: &Manifest,
) -> Result<Comparison> {
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
    let comparison = Comparison {
        rows,
        note: compute::published::CITATION.to_owned(),
        method: compute::published::METHOD.to_owned(),
    };
    document::put_over(store, &key, &comparison).await?;
    Ok(comparison)
}

/// The comparison that is kept for the newest version of the demo's flux, if there is one.
pub(crate) async fn stored(store: &Store) -> Result<Option<Check>> {
    let Some(flux) = storage::manifests::latest(store, &SETS[0].product.parse()?).await? else {
        return Ok(None);
    };
    Ok(read(store, &key(&flux))
        .await?
        .map(|comparison| comparison.to_wire()))
}

fn key(flux: &Manifest) -> ObjectKey {
    ObjectKey::check(&Digest::of_json(&(COMPARISON_VERSION, flux.id())))
}

async fn read(store: &Store, key: &ObjectKey) -> Result<Option<Comparison>> {
    match document::get(store, key).await {
        Ok(kept) => Ok(kept),
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "published values are compared again");
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}
