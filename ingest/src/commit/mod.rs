//! [`StoredGranule`]s of one product in, one new manifest and their [`Answer`]s out: a reader sees all of them or none.
//!
//! The manifest is built on the newest one and published under the next number; if another writer took that number the
//! newest is read again. Everything it names is durable before. A crash before the publication leaves objects that
//! nothing names; the same files make the same objects again and land once. The product's cube follows the manifest.

mod claim;
mod extent;
pub(crate) mod landing_note;
mod mend;
mod merge;
mod replace;
mod unchanged;

use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId};
use contract::notice::NoticeRun;
use contract::product::ProductId;
use retry::{Backoff, Pauses};
use storage::{StorageError, Store, manifests};

use crate::error::IngestError;
use crate::notice::{Answer, Versioned};
use crate::put::StoredGranule;
use extent::Valued;
use merge::{Change, Merged};

pub(crate) use claim::{Claim, ClaimName, is_later_or_same};
pub(crate) use extent::FIELDS_AT_ONCE;
pub(crate) use extent::write as domain;
pub(crate) use mend::mend;
pub(crate) use merge::{is_equal_grid, is_same_grid};
pub(crate) use replace::replace;
pub(crate) use unchanged::Unchanged;
pub(crate) use unchanged::answer as answer_unchanged;

/// Lost races for the next number before the caller is told; it may go on.
const LOST_RACES: usize = 200;
/// Attempts to publish, which many writers of one product may want at the same time.
const ATTEMPTS: Backoff = Backoff::contended(LOST_RACES);

/// Publishes files of one product, in their order. Files for the same period become manifests one after the other, so
/// that each revision can be cited. What `claims` are of was offered again and is there: files that were offered before that take no place of it.
pub(crate) async fn run(
    store: &Store,
    granules: &[StoredGranule],
    claims: &[Claim],
) -> Result<Vec<Answer>, IngestError> {
    let mut all = Vec::with_capacity(granules.len());
    let claims = with_own(store, granules, claims).await?;
    let mut rest = granules;
    while !rest.is_empty() {
        let (group, later) = rest.split_at(merge::disjoint_prefix(rest));
        all.extend(publish(store, group, &claims).await?);
        rest = later;
    }
    Ok(all)
}

/// Claims, and those of files that are there before any of these is published: what a later one of them has, an earlier one leaves.
async fn with_own(
    store: &Store,
    granules: &[StoredGranule],
    claims: &[Claim],
) -> Result<Vec<Claim>, IngestError> {
    let mut all = claims.to_vec();
    if merge::disjoint_prefix(granules) < granules.len() {
        let newest = manifests::latest(store, &granules[0].product).await;
        let newest = newest.map_err(IngestError::storage("read the newest manifest"))?;
        let own = granules.iter().map(Claim::of_granule);
        all.extend(newest.iter().flat_map(|newest| {
            let there = |claim: &Claim| claim.has_any(newest);
            own.clone().filter(there)
        }));
    }
    Ok(all)
}

/// Publishes one file or several; none has the time of another one.
async fn publish(
    store: &Store,
    granules: &[StoredGranule],
    claims: &[Claim],
) -> Result<Vec<Answer>, IngestError> {
    let product = &granules[0].product;
    let mut noted = vec![None; granules.len()];
    let mut pauses = ATTEMPTS.pauses();
    loop {
        let newest = manifests::latest(store, product)
            .await
            .map_err(IngestError::storage("read the newest manifest"))?;
        let merged = merge::merge(newest.as_ref(), granules, claims);
        let version = if merged.is_changed() {
            note(store, granules, &merged, &mut noted).await?;
            let manifest = build(store, newest.as_ref(), &merged, granules).await?;
            match manifests::commit(store, &manifest).await {
                Ok(version) => {
                    cube::keep_up_as(store, &manifest, &version).await;
                    Some(version)
                }
                Err(StorageError::Conflict { .. }) => {
                    race_lost(product, &mut pauses).await?;
                    continue;
                }
                Err(e) => return Err(IngestError::storage("publish a manifest")(e)),
            }
        } else {
            newest.as_ref().map(Manifest::id)
        };
        return answers(store, granules, (merged, &noted), version.as_ref()).await;
    }
}

/// Pauses between attempts to publish.
pub(crate) fn attempts() -> Pauses {
    ATTEMPTS.pauses()
}

/// Waits before the next attempt, if one is left.
pub(crate) async fn race_lost(product: &ProductId, pauses: &mut Pauses) -> Result<(), IngestError> {
    let Some(pause) = pauses.next() else {
        return Err(IngestError::Contended {
            product: product.to_string(),
            attempts: LOST_RACES,
        });
    };
    tokio::time::sleep(pause).await;
    Ok(())
}

/// The next manifest, with its domain durable.
async fn build(
    store: &Store,
    newest: Option<&Manifest>,
    merged: &Merged,
    granules: &[StoredGranule],
) -> Result<Manifest, IngestError> {
    let last = &granules[merged.last_taken.unwrap_or(0)];
    let reading = &last.reading;
    let grid = newest.map_or(reading.grid, |m| m.grid);
    let known = granules.iter().filter_map(|granule| {
        let steps = granule.reading.steps.iter();
        Some(Valued {
            fields: steps.map(|step| &step.field).collect(),
            cells: granule.valued.as_deref()?,
        })
    });
    let known: Vec<Valued<'_>> = known.collect();
    let steps = (newest, &merged.steps[..]);
    let domain = extent::write_knowing(store, &last.product, &grid, steps, &known).await?;
    Ok(Manifest {
        schema: MANIFEST_SCHEMA,
        product: last.product.clone(),
        number: newest.map_or(1, |m| m.number + 1),
        title: reading.title.clone(),
        quantity: merged.quantity.unwrap_or(reading.quantity),
        synthetic: reading.synthetic,
        source: reading.source.clone(),
        grid,
        steps: merged.steps.clone(),
        domain,
        series: vec![],
        derived_from: None,
        computed: None,
        notices: NoticeRun::of(&merged.orders),
        indexes: newest.map_or_else(|| reading.recipe.indexes.clone(), |m| m.indexes.clone()),
    })
}

/// Notes the files that are about to be published; `noted` keeps whether that was noted before.
async fn note(
    store: &Store,
    granules: &[StoredGranule],
    merged: &Merged,
    noted: &mut [Option<bool>],
) -> Result<(), IngestError> {
    let changes = granules.iter().zip(&merged.changes);
    for ((granule, change), noted) in changes.zip(noted) {
        if matches!(change, Change::Taken { .. }) && noted.is_none() {
            let (raw_sha256, origin) = (granule.reading.raw_sha256(), granule.notice.origin);
            let before = landing_note::note(store, &granule.product, raw_sha256, origin);
            *noted = Some(before.await?);
        }
    }
    Ok(())
}

/// What the notice of each file is answered with. Where a file was noted just now and is there all the same, somebody else
/// was faster, and tells.
async fn answers(
    store: &Store,
    granules: &[StoredGranule],
    (merged, noted): (Merged, &[Option<bool>]),
    version: Option<&ManifestId>,
) -> Result<Vec<Answer>, IngestError> {
    let mut all = Vec::with_capacity(granules.len());
    let changes = granules.iter().zip(merged.changes);
    for ((granule, change), is_noted) in changes.zip(noted) {
        let (notice, reading) = (&granule.notice, &granule.reading);
        let of = |periods| Versioned {
            manifest: version
                .expect("a file that is taken or there has a version")
                .clone(),
            raw_sha256: reading.raw_sha256(),
            periods,
        };
        let why = match change {
            Change::Refused(rejection) => {
                all.push(notice.refused(rejection));
                continue;
            }
            Change::Taken { revised, periods } => {
                all.push(granule.landed(of(periods), revised));
                continue;
            }
            Change::Same => Unchanged::Same(granule.masked),
            Change::Superseded => Unchanged::Superseded,
        };
        let periods = reading.steps.iter().map(|step| step.period).collect();
        let there = (of(periods), why);
        all.push(unchanged::answer(store, notice, there, *is_noted).await?);
    }
    Ok(all)
}
