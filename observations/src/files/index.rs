//! The numbered index of a dataset: which file holds which month. The newest number is what readers see.

use std::collections::BTreeSet;

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::product::ProductId;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};
use storage::{StorageError, Store, document};

use super::Rows;
use crate::error::ObservationError;

/// Version of the index's JSON as it is written. Those of version 1 are not sealed and are read as well.
const SCHEMA: u32 = 2;

/// One version of one dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Index {
    schema: u32,
    dataset: ProductId,
    /// 1, 2, 3 ... in the order of commits.
    number: u64,
    /// In the order of time.
    pub(super) months: Vec<Month>,
}

/// One month of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Month {
    year: i32,
    /// Number of the month in its year, 1 to 12.
    in_year: u32,
    /// GeoParquet.
    pub(super) file: ObjectKey,
    rows: u64,
    /// Time of its first row.
    pub(super) first: TimeMs,
    /// Time of its last row.
    pub(super) last: TimeMs,
    /// West, south, east, north of its places.
    pub(super) bounds_deg: [f64; 4],
}

impl Index {
    /// The first index of a dataset, still without a month.
    pub(super) fn first(dataset: ProductId) -> Self {
        Self {
            schema: SCHEMA,
            dataset,
            number: 1,
            months: vec![],
        }
    }

    /// The one after this.
    pub(super) fn next(self) -> Self {
        Self {
            schema: SCHEMA,
            number: self.number + 1,
            ..self
        }
    }
}

impl Month {
    /// A month whose file holds these rows.
    ///
    /// # Panics
    /// If there are no rows.
    pub(super) fn new(year: i32, in_year: u32, file: ObjectKey, rows: &Rows) -> Self {
        let first = rows
            .keys()
            .next()
            .expect("a month is written with its first row");
        let last = rows
            .keys()
            .next_back()
            .expect("a month is written with its first row");
        let start = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        let bounds_deg = rows.values().fold(start, |[w, s, e, n], o| {
            let (lon, lat) = (o.lon_deg, o.lat_deg);
            [w.min(lon), s.min(lat), e.max(lon), n.max(lat)]
        });
        Self {
            year,
            in_year,
            file,
            rows: rows.len() as u64,
            first: first.time,
            last: last.time,
            bounds_deg,
        }
    }

    pub(super) fn year_month(&self) -> (i32, u32) {
        (self.year, self.in_year)
    }
}

/// Datasets that have an index, sorted by name.
pub(super) async fn datasets(store: &Store) -> Result<Vec<ProductId>, ObservationError> {
    let names = store.folders(Kind::ObservationIndex.folder()).await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// The newest indexes of every dataset, those that were written at an instant or later, ms, and the files that they name, as keys.
///
/// # Errors
/// An index that cannot be read: it names files that nobody knows.
pub(crate) async fn named_by_newest(
    store: &Store,
    versions: usize,
    oldest_ms: i64,
) -> Result<BTreeSet<ObjectKey>, StorageError> {
    let mut keys = BTreeSet::new();
    for dataset in store.folders(Kind::ObservationIndex.folder()).await? {
        let indexes = store
            .list_written(&format!("{}/{dataset}", Kind::ObservationIndex.folder()))
            .await?;
        let newest = indexes.len().saturating_sub(versions);
        for (place, (key, written)) in indexes.into_iter().enumerate() {
            if place < newest && written.ms() < oldest_ms {
                continue;
            }
            let Some(index) = document::get::<Index>(store, &key).await? else {
                continue;
            };
            if index.schema > SCHEMA {
                return Err(StorageError::Damaged {
                    object: key.to_string(),
                    reason: format!("its schema {} is unknown", index.schema),
                });
            }
            keys.extend(index.months.into_iter().map(|month| month.file));
            keys.insert(key);
        }
    }
    Ok(keys)
}

/// The newest index of a dataset, if it has one.
pub(super) async fn latest(
    store: &Store,
    dataset: &ProductId,
) -> Result<Option<Index>, ObservationError> {
    let keys = store
        .list(&format!("{}/{dataset}", Kind::ObservationIndex.folder()))
        .await?;
    let Some(key) = keys.last() else {
        return Ok(None);
    };
    let Some(index) = document::get::<Index>(store, key).await? else {
        return Ok(None);
    };
    if index.schema > SCHEMA {
        let reason = format!(
            "schema {} is unknown, this program reads up to {SCHEMA}",
            index.schema
        );
        return Err(ObservationError::damaged(key.as_str(), reason));
    }
    Ok(Some(index))
}

/// Publishes an index whose files are all durable; false if another writer took its number.
///
/// An equal index of another writer is a lost race too: what this writer brought was there before it.
pub(super) async fn commit(store: &Store, index: &Index) -> Result<bool, ObservationError> {
    let name = format!(
        "{}/{}/{:010}.json",
        Kind::ObservationIndex.folder(),
        index.dataset,
        index.number
    );
    let key: ObjectKey = name.parse()?;
    match document::put_new(store, &key, index).await {
        Ok(is_new) => Ok(is_new),
        Err(StorageError::Conflict { .. }) => Ok(false),
        Err(e) => Err(e.into()),
    }
}
