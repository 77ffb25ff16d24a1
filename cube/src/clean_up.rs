//! Clean-up of cubes: versions that are not kept lose their names, and what no name leads to any more is removed. What is
//! in use is known to the repository's library, which does all of that.

use std::collections::BTreeSet;
use std::num::{NonZeroU16, NonZeroUsize};
use std::sync::Arc;
use std::time::Duration;

use chrono::{DateTime, TimeDelta, Utc};
use contract::product::ProductId;
use contract::time::TimeMs;
use futures::future::BoxFuture;
use icechunk::format::SnapshotId;
use icechunk::ops::gc::{ExpiredRefAction, GCConfig, expire, garbage_collect};
use serde::Serialize;
use storage::gc::{Keep, Kept, LEAST_AGE};
use storage::{Store, manifests};

use crate::repository::{BRANCH, is_no_tag};
use crate::{CubeError, Repository, folder, verify};

/// Snapshots that are read at a time.
const SNAPSHOTS_AT_ONCE: NonZeroU16 = NonZeroU16::new(4).expect("it is not zero");
/// Manifests, each of 1,024 references, that are held at a time, bytes.
const MANIFEST_BYTES: NonZeroUsize = NonZeroUsize::new(16 << 20).expect("it is not zero");
/// Requests of one kind under way at a time.
const REQUESTS: NonZeroU16 = NonZeroU16::new(8).expect("it is not zero");
/// Requests to remove objects that fail one after the other before the rest is left for the next time.
const FAILURES: NonZeroU16 = NonZeroU16::new(3).expect("it is not zero");

/// What was removed of a cube, or would be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Cleaned {
    /// Whose cube.
    pub product: ProductId,
    /// Versions that lost their names.
    pub versions: Vec<String>,
    /// Objects that were removed; where nothing is changed, those that no name leads to now.
    pub objects_count: u64,
    /// Their size.
    pub size_bytes: u64,
    /// Why the cube could not be cleaned, and was left as it is.
    pub refused: Option<String>,
}

impl Cleaned {
    fn nothing(product: ProductId) -> Self {
        Self {
            product,
            versions: vec![],
            objects_count: 0,
            size_bytes: 0,
            refused: None,
        }
    }

    /// Was there anything to do?
    pub fn is_nothing(&self) -> bool {
        self.versions.is_empty() && self.objects_count == 0
    }
}

/// Cleans all cubes of a store: versions whose manifests are not kept and that are old enough go, and objects that are old
/// enough and that no kept version needs. With `is_dry_run` nothing is changed. A cube that cannot be read is left as it is, and the others are
/// cleaned.
///
/// Who lands meanwhile is in no danger: what is young stays, and the newest state with it.
///
/// # Errors
/// A store that does not answer.
pub fn run(
    store: &Store,
    keep: Keep,
    now: TimeMs,
    is_dry_run: bool,
) -> BoxFuture<'_, Result<Vec<Cleaned>, CubeError>> {
    Box::pin(async move {
        let older_than = older_than(now, keep.age.max(LEAST_AGE))?;
        let oldest_ms = older_than.timestamp_millis();
        let cleaning = Cleaning {
            store,
            kept: Kept::read(store, keep.versions.max(1), oldest_ms).await?,
            older_than,
            is_dry_run,
        };
        let mut all = vec![];
        for product in verify::products(store).await? {
            match cleaning.clean(&product).await {
                Ok(cleaned) => all.extend(cleaned),
                // What is left of one, or the beginning of one.
                Err(CubeError::Missing { .. }) => {}
                Err(error) if error.is_retryable() => return Err(error),
                Err(error) => {
                    tracing::warn!(%product, %error, "a cube is left as it is");
                    all.push(Cleaned {
                        refused: Some(error.to_string()),
                        ..Cleaned::nothing(product)
                    });
                }
            }
        }
        Ok(all)
    })
}

fn older_than(now: TimeMs, age: Duration) -> Result<DateTime<Utc>, CubeError> {
    let now = DateTime::from_timestamp_millis(now.ms());
    let cutoff = now.zip(TimeDelta::from_std(age).ok());
    let cutoff = cutoff.and_then(|(now, age)| now.checked_sub_signed(age));
    cutoff.ok_or_else(|| CubeError::library("cubes", "cleaning up", "the age is out of range"))
}

/// What is kept of all cubes.
struct Cleaning<'a> {
    store: &'a Store,
    kept: Kept,
    older_than: DateTime<Utc>,
    is_dry_run: bool,
}

impl Cleaning<'_> {
    /// Cleans the cube of a product; none of a product that is there no more: somebody removed it by hand, and decides about its cube, too.
    async fn clean(&self, product: &ProductId) -> Result<Option<Cleaned>, CubeError> {
        let numbers = self.numbers(product).await?;
        if numbers.is_empty() {
            return Ok(None);
        }
        let (older_than, is_dry_run) = (self.older_than, self.is_dry_run);
        let repository = Repository::open(self.store, &folder(product)).await?;
        let versions = repository
            .cut_names(&numbers, older_than, is_dry_run)
            .await?;
        let (objects_count, size_bytes) =
            Box::pin(repository.remove_unused(older_than, is_dry_run)).await?;
        Ok(Some(Cleaned {
            versions,
            objects_count,
            size_bytes,
            ..Cleaned::nothing(product.clone())
        }))
    }

    /// Versions that keep their names: those that are kept, and all others whose manifests stay, of whatever age their states are. In a store that
    /// was copied every object is young, and states tell when they were made.
    async fn numbers(&self, product: &ProductId) -> Result<BTreeSet<String>, CubeError> {
        let own = self.kept.manifests.iter();
        let own = own.filter(|manifest| manifest.product == *product);
        let mut numbers: BTreeSet<u64> = own.map(|manifest| manifest.number).collect();
        // Where nothing is changed, those are there that would have gone before.
        let oldest_ms = self.older_than.timestamp_millis();
        let there = manifests::published(self.store, product).await?.into_iter();
        let stay = there.filter(|(_, written)| !self.is_dry_run || written.ms() >= oldest_ms);
        numbers.extend(stay.map(|(number, _)| number));
        Ok(numbers.iter().map(ToString::to_string).collect())
    }
}

impl Repository {
    /// Takes the names of versions that are not kept and are older than an instant, and forgets the states that have none.
    async fn cut_names(
        &self,
        kept: &BTreeSet<String>,
        older_than: DateTime<Utc>,
        is_dry_run: bool,
    ) -> Result<Vec<String>, CubeError> {
        let failed = |e: &dyn std::fmt::Display| self.failed("cleaning up", e);
        let newest: SnapshotId = self
            .inner
            .lookup_branch(BRANCH)
            .await
            .map_err(|e| failed(&e))?;
        // A name that was taken cannot be given again, and whoever follows names the state that is there.
        let own = self.description.version.as_ref();
        let own = own.map(|version| version.number.to_string());
        let mut cut = vec![];
        for version in self.versions().await? {
            if kept.contains(&version) || own.as_ref() == Some(&version) {
                continue;
            }
            let cutting = self.cut_name(&version, &newest, older_than, is_dry_run);
            if cutting.await? {
                cut.push(version);
            }
        }
        if !is_dry_run {
            let config = self.inner.config();
            let expired = expire(
                Arc::clone(self.inner.asset_manager()),
                older_than,
                ExpiredRefAction::Ignore,
                ExpiredRefAction::Ignore,
                Some(config.repo_update_retries()),
                config.num_updates_per_repo_info_file(),
            );
            expired.await.map_err(|e| failed(&e))?;
        }
        Ok(cut)
    }

    /// Takes the name of a version, unless its state is the newest or young. False if it stays, or went meanwhile: somebody else cleans up, too.
    async fn cut_name(
        &self,
        version: &str,
        newest: &SnapshotId,
        older_than: DateTime<Utc>,
        is_dry_run: bool,
    ) -> Result<bool, CubeError> {
        let failed = |e: &dyn std::fmt::Display| self.failed("cleaning up", e);
        let id = match self.inner.lookup_tag(version).await {
            Err(error) if is_no_tag(&error) => return Ok(false),
            found => found.map_err(|e| failed(&e))?,
        };
        let info = self.inner.lookup_snapshot(&id).await;
        let info = info.map_err(|e| failed(&e));
        // A state goes after its name.
        if info.is_err() && !self.has_version(version).await? {
            return Ok(false);
        }
        let info = info?;
        if id == *newest || info.flushed_at >= older_than {
            return Ok(false);
        }
        if is_dry_run {
            return Ok(true);
        }
        match self.inner.delete_tag(version).await {
            Err(error) if is_no_tag(&error) => Ok(false),
            deleted => deleted.map(|()| true).map_err(|e| failed(&e)),
        }
    }

    /// Removes objects older than an instant that no state needs: how many, and their bytes.
    async fn remove_unused(
        &self,
        older_than: DateTime<Utc>,
        is_dry_run: bool,
    ) -> Result<(u64, u64), CubeError> {
        let config = GCConfig::clean_all(
            older_than,
            older_than,
            None,
            SNAPSHOTS_AT_ONCE,
            MANIFEST_BYTES,
            MANIFEST_BYTES,
            REQUESTS,
            REQUESTS,
            FAILURES,
            Some(REQUESTS),
            is_dry_run,
        );
        let own = self.inner.config();
        let removed = garbage_collect(
            Arc::clone(self.inner.asset_manager()),
            &config,
            Some(own.repo_update_retries()),
            own.num_updates_per_repo_info_file(),
        );
        let removed = Box::pin(removed)
            .await
            .map_err(|e| self.failed("cleaning up", &e))?;
        if let Some(error) = removed.delete_errors.first() {
            return Err(self.failed("cleaning up", error));
        }
        let count = removed.chunks_deleted
            + removed.manifests_deleted
            + removed.snapshots_deleted
            + removed.attributes_deleted
            + removed.transaction_logs_deleted;
        Ok((count, removed.bytes_deleted))
    }
}
