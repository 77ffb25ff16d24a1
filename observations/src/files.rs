//! Observations in GeoParquet files of the object store: one file a dataset and month, and a numbered index a dataset.
//!
//! Files are named by their content and never change. What readers see is the newest index; the next one is committed
//! with create-if-absent, so that of two writers one commits and the other begins again on what is there then.

mod columns;
pub(crate) mod index;
mod table;
mod ways;

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
use ways::{MAX_HELD, Ways};

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

    /// Ways of platforms, read together as far as at most `most` places are held.
    async fn tracks_holding(
        &self,
        queries: &[TrackQuery],
        most: usize,
    ) -> Result<Vec<Vec<TrackPoint>>, ObservationError> {
        for query in queries {
            track::check(query)?;
        }
        let mut tracks = Vec::with_capacity(queries.len());
        // The last is the next one.
        let mut waiting = track::together(queries);
        waiting.reverse();
        while let Some(part) = waiting.pop() {
            if let Some(ways) = self.ways(part, most).await? {
                let way =
                    |query: &TrackQuery| track::thinned(ways.of(&query.platform), query.limit);
                tracks.extend(part.iter().map(way));
            } else {
                let (first, second) = part.split_at(part.len() / 2);
                waiting.extend([second, first]);
            }
        }
        Ok(tracks)
    }

    /// Whole ways of platforms, of one dataset and span of time; none of several that have more than `most` places in all.
    async fn ways(
        &self,
        queries: &[TrackQuery],
        most: usize,
    ) -> Result<Option<Ways>, ObservationError> {
        let mut ways = Ways::default();
        let [first, others @ ..] = queries else {
            return Ok(Some(ways));
        };
        let filter = Filter {
            from: first.from,
            to: first.to,
            datasets: vec![first.dataset.clone()],
            platforms: queries.iter().map(|query| query.platform.clone()).collect(),
            ..Filter::default()
        };
        let checked = CheckedFilter::new(&filter)?;
        for (_, months) in self.months(&checked).await? {
            for row in self.wanted(&checked, filter.from, months).await? {
                ways.add(&row);
            }
            if ways.held() > most && !others.is_empty() {
                return Ok(None);
            }
        }
        Ok(Some(ways))
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
        let mut tracks = self.tracks(std::slice::from_ref(query)).await?;
        Ok(tracks.pop().unwrap_or_default())
    }

    async fn tracks(
        &self,
        queries: &[TrackQuery],
    ) -> Result<Vec<Vec<TrackPoint>>, ObservationError> {
        self.tracks_holding(queries, MAX_HELD).await
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::tests::observation;

    /// Places of 12 ships on each of so many days, from 20 January 2012 on.
    fn fleet(days: i64) -> Vec<Observation> {
        let first: TimeMs = "2012-01-20".parse().unwrap();
        let place = |ship: i64, day: i64| Observation {
            time: TimeMs::new(first.ms() + day * 86_400_000).unwrap(),
            lon_deg: (10 * ship + day) as f64 / 10.0,
            ..observation(&format!("ship-{ship:02}"), 1.0)
        };
        (0..12)
            .flat_map(|ship| (0..days).map(move |day| place(ship, day)))
            .collect()
    }

    #[tokio::test]
    async fn ways_of_many_ships_are_read_once_and_are_those_of_each() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let (store, traffic) = store.counted();
        let home = FileStore::new(store);
        let rows = fleet(60);
        home.upsert(&rows).await.unwrap();
        let dataset = &rows[0].dataset;
        // Last first, one of them twice, and one that is not there.
        let names = (0..12).rev().chain([3, 99]);
        let queries: Vec<_> = names
            .map(|ship| TrackQuery {
                limit: 20 + ship,
                ..TrackQuery::new(dataset.clone(), format!("ship-{ship:02}"))
            })
            .collect();
        let mut each = vec![];
        for query in &queries {
            each.push(home.track(query).await.unwrap());
        }
        assert!(each[0].len() > 15 && each[13].is_empty());
        let reads = async |queries: &[TrackQuery], most: usize| {
            let before = traffic.counts();
            let tracks = home.tracks_holding(queries, most).await.unwrap();
            (tracks, traffic.counts().since(before).reads)
        };
        let (_, reads_of_one) = reads(&queries[..1], MAX_HELD).await;
        let (together, reads_of_all) = reads(&queries[..], MAX_HELD).await;
        assert_eq!(together, each);
        assert!(reads_of_one >= 3, "{reads_of_one}");
        assert_eq!(reads_of_all, reads_of_one);
        // More than can be held: in parts, with the same answers.
        for most in [0, 200, 500] {
            let (in_parts, reads_in_parts) = reads(&queries[..], most).await;
            assert_eq!(in_parts, each, "{most}");
            assert!(reads_in_parts > reads_of_all, "{most}");
        }
    }
}
