//! Observations in GeoParquet files of the object store: one file a dataset and month, and a numbered index a dataset.
//!
//! Files are named by their content and never change. What readers see is the newest index; the next one is committed
//! with create-if-absent, so that of two writers one commits and the other begins again on what is there then.

mod columns;
pub(crate) mod index;
mod table;

use std::collections::BTreeMap;
use std::time::Duration;

use async_trait::async_trait;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::observation::{Filter, Observation, Page, PlatformList, TrackPoint, TrackQuery};
use contract::product::ProductId;
use contract::time::TimeMs;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use retry::Backoff;
use storage::Store;

use crate::error::ObservationError;
use crate::filter::{self, CheckedFilter};
use crate::key::Key;
use crate::platform::{self, Gathering};
use crate::store::{Counts, ObservationStore};
use crate::{batch, key, track};
use index::{Index, Month};

/// Attempts to commit before other writers are given the right of way.
const ATTEMPTS: usize = 64;
/// Files read at the same time.
const FILES_AT_ONCE: usize = 4;
/// Longest wait of a question whether the store is there.
const READY: Duration = Duration::from_millis(1800);

/// Observations in files; clones share them.
#[derive(Debug, Clone)]
pub struct FileStore {
    store: Store,
}

/// Observations of one dataset by their key.
type Rows = BTreeMap<Key, Observation>;

impl FileStore {
    /// Observations beside the products of a store.
    pub fn new(store: Store) -> Self {
        Self { store }
    }

    /// Stores the rows of one dataset, whoever else writes at the same time.
    async fn upsert_dataset(
        &self,
        dataset: &ProductId,
        rows: &[Observation],
    ) -> Result<Counts, ObservationError> {
        let mut pauses = Backoff::contended(ATTEMPTS).pauses();
        loop {
            let before = index::latest(&self.store, dataset).await?;
            let (after, counts) = self.merged(dataset, before, rows).await?;
            if counts.new + counts.replaced == 0 || index::commit(&self.store, &after).await? {
                return Ok(counts);
            }
            let Some(pause) = pauses.next() else {
                let (dataset, attempts) = (dataset.clone(), ATTEMPTS);
                return Err(ObservationError::Contended { dataset, attempts });
            };
            tokio::time::sleep(pause).await;
        }
    }

    /// The index that follows when rows are stored; its files are durable.
    async fn merged(
        &self,
        dataset: &ProductId,
        before: Option<Index>,
        rows: &[Observation],
    ) -> Result<(Index, Counts), ObservationError> {
        let mut index = before.map_or_else(|| Index::first(dataset.clone()), Index::next);
        let mut counts = Counts::default();
        for part in rows.chunk_by(|a, b| a.time.year_month() == b.time.year_month()) {
            let month = part[0].time.year_month();
            let known = index.months.iter().position(|m| m.year_month() == month);
            let mut all = match known {
                Some(at) => self.all_rows(&index.months[at]).await?,
                None => Rows::new(),
            };
            let change = merge(&mut all, part);
            counts += change;
            if change.new + change.replaced == 0 {
                continue;
            }
            let month = self.write(dataset, month, &all).await?;
            match known {
                Some(at) => index.months[at] = month,
                None => index.months.push(month),
            }
        }
        index.months.sort_by_key(Month::year_month);
        Ok((index, counts))
    }

    async fn all_rows(&self, month: &Month) -> Result<Rows, ObservationError> {
        let content = self.store.get(&month.file).await?;
        let found = table::decode(month.file.as_str(), content, None, None, |_| true)?;
        Ok(found.into_iter().map(|o| (Key::of(&o), o)).collect())
    }

    async fn write(
        &self,
        dataset: &ProductId,
        (year, month): (i32, u32),
        rows: &Rows,
    ) -> Result<Month, ObservationError> {
        let content = table::encode(&rows.values())?;
        let file = ObjectKey::observations(dataset, &Digest::of(&content));
        self.store.put_new(&file, content).await?;
        Ok(Month::new(year, month, file, rows))
    }

    /// Months of the wanted datasets that may hold wanted rows, in the order of time.
    async fn months(
        &self,
        checked: &CheckedFilter<'_>,
    ) -> Result<BTreeMap<(i32, u32), Vec<Month>>, ObservationError> {
        let filter = checked.filter;
        let datasets = if filter.datasets.is_empty() {
            index::datasets(&self.store).await?
        } else {
            let mut datasets = filter.datasets.clone();
            datasets.sort();
            datasets.dedup();
            datasets
        };
        let mut months = BTreeMap::<_, Vec<Month>>::new();
        for dataset in &datasets {
            let index = index::latest(&self.store, dataset).await?;
            let all = index.into_iter().flat_map(|index| index.months);
            let may_hold = |month: &Month| {
                filter.from.is_none_or(|from| from <= month.last)
                    && filter.to.is_none_or(|to| month.first < to)
                    && checked.area.touches(month.bounds_deg)
            };
            for month in all.filter(may_hold) {
                months.entry(month.year_month()).or_default().push(month);
            }
        }
        Ok(months)
    }

    /// Wanted rows of some files, in the order of keys.
    async fn wanted(
        &self,
        checked: &CheckedFilter<'_>,
        from: Option<TimeMs>,
        months: Vec<Month>,
    ) -> Result<Vec<Observation>, ObservationError> {
        let to = checked.filter.to;
        let reads = months.into_iter().map(|month| async move {
            let content = self.store.get(&month.file).await?;
            table::decode(month.file.as_str(), content, from, to, |o| checked.wants(o))
        });
        let parts: Vec<Vec<Observation>> = stream::iter(reads)
            .buffered(FILES_AT_ONCE)
            .try_collect()
            .await?;
        let mut rows: Vec<Observation> = parts.into_iter().flatten().collect();
        rows.sort_by(key::order);
        Ok(rows)
    }
}

/// Puts rows among others; what became of them.
fn merge(all: &mut Rows, rows: &[Observation]) -> Counts {
    let mut counts = Counts::default();
    for row in rows {
        match all.insert(Key::of(row), row.clone()) {
            None => counts.new += 1,
            Some(before) if batch::says_the_same(&before, row) => counts.same += 1,
            Some(_) => counts.replaced += 1,
        }
    }
    counts
}

#[async_trait]
impl ObservationStore for FileStore {
    async fn upsert(&self, observations: &[Observation]) -> Result<Counts, ObservationError> {
        let mut datasets = BTreeMap::<ProductId, Vec<Observation>>::new();
        for row in batch::prepare(observations)? {
            datasets.entry(row.dataset.clone()).or_default().push(row);
        }
        let mut counts = Counts::default();
        for (dataset, rows) in &datasets {
            counts += self.upsert_dataset(dataset, rows).await?;
        }
        Ok(counts)
    }

    async fn query(&self, filter: &Filter) -> Result<Page, ObservationError> {
        let checked = CheckedFilter::new(filter)?;
        let after = checked.after.as_ref();
        let from = filter.from.max(after.map(|key| key.time));
        let mut rows = vec![];
        for (_, mut months) in self.months(&checked).await? {
            months.retain(|month| from.is_none_or(|from| from <= month.last));
            let mut found = self.wanted(&checked, from, months).await?;
            if let Some(after) = after {
                found.retain(|row| Key::of(row) > *after);
            }
            rows.extend(found);
            if rows.len() > filter.limit as usize {
                break;
            }
        }
        Ok(filter::page(rows, filter.limit))
    }

    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, ObservationError> {
        let checked = CheckedFilter::new(filter)?;
        let mut gathering = Gathering::default();
        for (_, months) in self.months(&checked).await? {
            for row in self.wanted(&checked, filter.from, months).await? {
                gathering.add(row);
            }
        }
        Ok(platform::list(gathering.finish(), filter.limit))
    }

    async fn datasets(&self) -> Result<Vec<ProductId>, ObservationError> {
        index::datasets(&self.store).await
    }

    async fn track(&self, query: &TrackQuery) -> Result<Vec<TrackPoint>, ObservationError> {
        track::check(query)?;
        let filter = Filter {
            from: query.from,
            to: query.to,
            datasets: vec![query.dataset.clone()],
            platforms: vec![query.platform.clone()],
            ..Filter::default()
        };
        let checked = CheckedFilter::new(&filter)?;
        let mut places: Vec<TrackPoint> = vec![];
        for (_, months) in self.months(&checked).await? {
            let rows = self.wanted(&checked, query.from, months).await?;
            places.extend(rows.iter().map(|o| TrackPoint {
                time: o.time,
                lon_deg: o.lon_deg,
                lat_deg: o.lat_deg,
            }));
            places.dedup_by_key(|place| place.time);
        }
        Ok(track::thinned(places, query.limit))
    }

    async fn ready(&self) -> Result<(), ObservationError> {
        let asked = index::datasets(&self.store);
        match tokio::time::timeout(READY, asked).await {
            Ok(answer) => answer.map(|_datasets| ()),
            Err(_late) => Err(ObservationError::Slow {
                action: "asking whether it is there",
                limit: READY,
            }),
        }
    }
}
