//! Exact sums of a region's share of every step: asked of the engine, or read where they were stored for this version.

use std::collections::BTreeMap;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::time::{Period, TimeMs};
use futures::future::BoxFuture;
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document, manifests};

use super::asked::{WeighedRegion, asked};
use super::bands::{BAND_COUNT, BandSum};
use super::measure::Measure;
use super::rows::StepSum;
use crate::region::address::RegionAddress;
use crate::region::weights::RegionKeys;
use crate::{ComputeError, Engine};

/// Version of stored sums: it changes when their bits or their layout do. 3: the sea by bands of latitude.
const SCHEMA: u32 = 3;
/// How many versions back sums are looked for that can be taken over.
const VERSIONS_BACK: u64 = 8;

/// The sums of one version of a product over one region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    schema: u32,
    manifest: ManifestId,
    weights: RegionKeys,
    measure: Measure,
    rows: Vec<Row>,
}

/// Integers are text: JSON's numbers do not hold 128 bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(rename = "frame")]
    field: ObjectKey,
    start: TimeMs,
    end: TimeMs,
    mass_steps: String,
    area_steps: String,
    sea: Vec<SeaBand>,
}

/// The sea with data in a band.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SeaBand {
    band: usize,
    mass_steps: String,
    area_steps: String,
}

impl SeaBand {
    fn of(sum: &BandSum) -> Self {
        Self {
            band: sum.band,
            mass_steps: sum.mass_steps.to_string(),
            area_steps: sum.area_steps.to_string(),
        }
    }

    fn sum(&self) -> Option<BandSum> {
        Some(BandSum {
            band: Some(self.band).filter(|band| *band < BAND_COUNT)?,
            mass_steps: self.mass_steps.parse().ok()?,
            area_steps: self.area_steps.parse().ok()?,
        })
    }
}

/// Exact sums of some steps over a region, and the sea that they are sums of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RegionSums {
    /// In the order of time.
    pub(crate) steps: Vec<StepSum>,
    /// Area of all sea of the region on the grid in every band, m² in steps of 10⁻⁶.
    pub(crate) sea_steps: [i128; BAND_COUNT],
    /// Area of the region on the grid, m².
    pub(crate) on_grid_m2: f64,
}

impl Row {
    fn sum(&self) -> Option<StepSum> {
        Some(StepSum {
            period: Period::new(self.start, self.end).ok()?,
            mass_steps: self.mass_steps.parse().ok()?,
            area_steps: self.area_steps.parse().ok()?,
            sea: self.sea.iter().map(SeaBand::sum).collect::<Option<_>>()?,
        })
    }
}

/// What storing a version's sums came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredSums {
    /// Where they are.
    pub key: ObjectKey,
    /// Steps that had to be summed.
    pub computed_count: usize,
    /// Steps whose sums were taken over from an earlier version.
    pub kept_count: usize,
}

/// Hash of all that a version's sums over a region's weights are made of.
pub(crate) fn input(manifest: &ManifestId, weights: &RegionKeys, measure: Measure) -> Digest {
    Digest::of_json(&(SCHEMA, manifest, weights, measure))
}

/// The key of a version's sums over a region's weights.
pub fn key(manifest: &ManifestId, weights: &RegionKeys, measure: Measure) -> ObjectKey {
    let digest = input(manifest, weights, measure);
    format!("{}/{}/{digest}.json", Kind::Sums.folder(), manifest.product)
        .parse()
        .expect("a folder, a product and a digest make a key")
}

/// Exact sums of some steps of a version, in the order of time.
pub(crate) async fn of_steps(
    engine: &Engine,
    manifest: &Manifest,
    steps: &[&Step],
    weights: &RegionAddress,
    measure: Measure,
) -> Result<RegionSums, ComputeError> {
    let region = WeighedRegion::read(engine, &manifest.grid, weights).await?;
    let key = key(&manifest.id(), &weights.keys, measure);
    let stored = stored_rows(engine.store(), &key).await?.rows();
    let known: Option<Vec<StepSum>> = steps
        .iter()
        .map(|step| stored.get(&step.field)?.sum())
        .collect();
    Ok(RegionSums {
        steps: match known {
            Some(sums) => sums,
            None => asked(engine, manifest, steps, &region, measure).await?,
        },
        sea_steps: region.sea_steps,
        on_grid_m2: region.on_grid_m2,
    })
}

/// Stores the sums of all steps of a version, unless they are there. Those of fields that an earlier version had too
/// are taken over from it.
pub fn store<'a>(
    engine: &'a Engine,
    manifest: &'a Manifest,
    weights: &'a RegionKeys,
    measure: Measure,
) -> BoxFuture<'a, Result<StoredSums, ComputeError>> {
    Box::pin(async move {
        let store = engine.store();
        let key = key(&manifest.id(), weights, measure);
        let mut known = match stored_rows(store, &key).await? {
            Stored::Rows(_) => {
                return Ok(StoredSums {
                    key,
                    computed_count: 0,
                    kept_count: manifest.steps.len(),
                });
            }
            Stored::Nothing => earlier_rows(store, manifest, weights, measure).await?,
            // Nothing else is trusted where one thing was damaged.
            Stored::Damaged => BTreeMap::new(),
        };
        let unknown: Vec<&Step> = manifest
            .steps
            .iter()
            .filter(|step| known.get(&step.field).and_then(Row::sum).is_none())
            .collect();
        let computed_count = unknown.len();
        if computed_count > 0 {
            let stored = RegionAddress::stored(store, weights.clone());
            let region = WeighedRegion::read(engine, &manifest.grid, &stored).await?;
            let sums = asked(engine, manifest, &unknown, &region, measure).await?;
            known.extend(unknown.iter().zip(sums).map(|(step, sum)| {
                let row = row_of(&step.field, &sum);
                (step.field.clone(), row)
            }));
        }
        let rows = manifest
            .steps
            .iter()
            .filter_map(|step| known.get(&step.field).cloned());
        put(store, manifest, weights, measure, rows.collect()).await?;
        Ok(StoredSums {
            key,
            computed_count,
            kept_count: manifest.steps.len() - computed_count,
        })
    })
}

/// Computes all sums of a version anew and compares them with the stored ones, which are stored if they are not there.
///
/// # Errors
/// `Storage` with a conflict if they differ.
pub(crate) async fn verify(
    engine: &Engine,
    manifest: &Manifest,
    weights: &RegionKeys,
    measure: Measure,
) -> Result<(), ComputeError> {
    let steps: Vec<&Step> = manifest.steps.iter().collect();
    let stored = RegionAddress::stored(engine.store(), weights.clone());
    let region = WeighedRegion::read(engine, &manifest.grid, &stored).await?;
    let sums = asked(engine, manifest, &steps, &region, measure).await?;
    let rows = steps
        .iter()
        .zip(&sums)
        .map(|(step, sum)| row_of(&step.field, sum));
    put(engine.store(), manifest, weights, measure, rows.collect()).await
}

async fn put(
    store: &Store,
    manifest: &Manifest,
    weights: &RegionKeys,
    measure: Measure,
    rows: Vec<Row>,
) -> Result<(), ComputeError> {
    let id = manifest.id();
    let key = key(&id, weights, measure);
    let table = Table {
        schema: SCHEMA,
        manifest: id,
        weights: weights.clone(),
        measure,
        rows,
    };
    match document::put_new(store, &key, &table).await {
        Err(StorageError::Conflict { .. })
            if matches!(stored_rows(store, &key).await?, Stored::Damaged) =>
        {
            document::put_over(store, &key, &table).await?;
        }
        put => {
            put?;
        }
    }
    Ok(())
}

fn row_of(field: &ObjectKey, sum: &StepSum) -> Row {
    Row {
        field: field.clone(),
        start: sum.period.start,
        end: sum.period.end,
        mass_steps: sum.mass_steps.to_string(),
        area_steps: sum.area_steps.to_string(),
        sea: sum.sea.iter().map(SeaBand::of).collect(),
    }
}

/// What is stored under the key of a table.
enum Stored {
    /// The rows by field.
    Rows(BTreeMap<ObjectKey, Row>),
    Nothing,
    /// Something that is no table, or no longer the one that was stored: sums can always be computed again.
    Damaged,
}

impl Stored {
    fn rows(self) -> BTreeMap<ObjectKey, Row> {
        match self {
            Self::Rows(rows) => rows,
            Self::Nothing | Self::Damaged => BTreeMap::new(),
        }
    }
}

async fn stored_rows(store: &Store, key: &ObjectKey) -> Result<Stored, StorageError> {
    match document::get::<Table>(store, key).await {
        Ok(Some(table)) => {
            let rows = table.rows.into_iter();
            Ok(Stored::Rows(
                rows.map(|row| (row.field.clone(), row)).collect(),
            ))
        }
        Ok(None) => Ok(Stored::Nothing),
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%key, %error, "stored sums cannot be read; they are computed again");
            Ok(Stored::Damaged)
        }
        Err(e) => Err(e),
    }
}

/// Rows of the newest earlier version that has any.
async fn earlier_rows(
    store: &Store,
    manifest: &Manifest,
    weights: &RegionKeys,
    measure: Measure,
) -> Result<BTreeMap<ObjectKey, Row>, ComputeError> {
    let oldest = manifest.number.saturating_sub(VERSIONS_BACK).max(1);
    for number in (oldest..manifest.number).rev() {
        let earlier = manifests::numbered(store, &manifest.product, number).await;
        let Ok(Some(earlier)) = earlier else {
            break;
        };
        // Other cells, other weights.
        if earlier.grid != manifest.grid {
            break;
        }
        let stored = stored_rows(store, &key(&earlier.id(), weights, measure)).await?;
        let rows = stored.rows();
        if !rows.is_empty() {
            return Ok(rows);
        }
    }
    Ok(BTreeMap::new())
}
