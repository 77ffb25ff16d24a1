//! The cube of a product in, what is wrong with it out: every version opened, every step compared with its digest and its levels with it, every
//! run of its time-major copy and the sums of it with its steps, every chunk that is damaged or gone told by the array and the place it has there.
//!
//! Objects themselves are compared with their checksums and seals by `storage::verify`, as those of all kinds are.

mod mend;

use std::collections::{BTreeMap, BTreeSet};

use contract::chunk::BAND_CELLS;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use futures::TryStreamExt as _;
use futures::future::BoxFuture;
use icechunk::format::manifest::ChunkPayload;
use storage::verify::{Fault, Finding};
use storage::{StorageError, Store, manifests};

use crate::follow::folder;
use crate::object_storage::is_initial;
use crate::{At, Cube, CubeError, Repository, Step, complete, series, stacked};
pub use mend::{Mending, mend, mending};

/// What a cube was found to be.
#[derive(Debug, Clone, Default)]
pub struct Checked {
    /// What is wrong besides objects that are damaged in themselves.
    pub findings: Vec<Finding>,
    /// Of chunks that are damaged or gone: array and place.
    pub places: BTreeMap<ObjectKey, String>,
}

impl Checked {
    /// Adds to a finding which part of which array its object is.
    pub fn explain(&self, finding: &mut Finding) {
        if let Some(place) = self.places.get(&finding.key) {
            finding.reason = format!("{}; it is {place}", finding.reason);
        }
    }
}

/// Products that have a cube in a store, sorted.
pub async fn products(store: &Store) -> Result<Vec<ProductId>, CubeError> {
    let names = store.folders(Kind::Cube.folder()).await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// Checks the cube of a product. `damaged` are objects that are known to be: they are told by their places, no more.
///
/// # Errors
/// The store does not answer. Whatever is wrong with the cube is a finding.
pub fn check<'a>(
    store: &'a Store,
    product: &'a ProductId,
    damaged: &'a BTreeSet<ObjectKey>,
) -> BoxFuture<'a, Result<Checked, CubeError>> {
    Box::pin(async move {
        let folder = folder(product);
        let check = Check {
            store,
            entry: format!("{folder}/repo")
                .parse()
                .map_err(|e| named(&folder, &e))?,
            there: store.list(&folder).await?.into_iter().collect(),
            is_damaged: damaged.iter().any(|key| key.is_in(&folder)),
            folder,
            damaged,
        };
        let mut checked = Checked::default();
        match check.versions(product, &mut checked).await {
            Ok(()) => {}
            // Fields are read until it is there.
            Err(CubeError::Missing { .. }) if check.is_unbegun() => {
                check.behind(None, product, &mut checked).await?;
            }
            // What the newest version is cannot be read, and is told of already.
            Err(CubeError::Storage(StorageError::Damaged { object, .. }))
                if damaged.iter().any(|key| *key.as_str() == *object) => {}
            // It says nothing of the cube.
            Err(error) if error.is_retryable() => return Err(error),
            // What it needs is damaged, and told of already.
            Err(error) if check.is_damaged => {
                tracing::debug!(%error, "what is left of a cube cannot be read");
            }
            Err(CubeError::Storage(error)) => return Err(error.into()),
            Err(error) => checked.findings.push(check.finding(&error)),
        }
        Ok(checked)
    })
}

fn named(place: &str, error: &dyn std::fmt::Display) -> CubeError {
    CubeError::library(place, "naming an object", error)
}

/// What cannot be read of a state.
#[derive(Default)]
struct Broken {
    steps: BTreeSet<u32>,
    /// Of the time-major copy.
    runs: BTreeSet<u32>,
}

struct Check<'a> {
    store: &'a Store,
    folder: String,
    /// The object that all is found by.
    entry: ObjectKey,
    /// What was there when it began.
    there: BTreeSet<ObjectKey>,
    damaged: &'a BTreeSet<ObjectKey>,
    /// Is one of these of this cube?
    is_damaged: bool,
}

impl Check<'_> {
    fn finding(&self, error: &CubeError) -> Finding {
        Finding {
            key: self.entry.clone(),
            fault: Fault::Damaged,
            reason: error.to_string(),
        }
    }

    /// Is an object not there? Whoever publishes meanwhile adds some.
    async fn is_gone(&self, key: &ObjectKey) -> Result<bool, CubeError> {
        Ok(!self.there.contains(key) && !self.store.exists(key).await?)
    }

    async fn versions(&self, product: &ProductId, checked: &mut Checked) -> Result<(), CubeError> {
        let repository = Repository::open(self.store, &self.folder).await?;
        let mut seen = BTreeSet::new();
        let newest = repository.at(&At::Newest).await?;
        let mut states = vec![("the newest state".to_owned(), At::Newest)];
        for version in repository.versions().await? {
            states.push((format!("version {version}"), At::Version(version)));
        }
        for (shown, at) in states {
            let cube = repository.at(&at).await?;
            if matches!(at, At::Version(_)) {
                self.of_another(&cube, &shown, checked).await?;
            }
            if self
                .has_manifests(&repository, &cube, &shown, checked)
                .await?
            {
                self.version(&cube, &shown, &mut seen, checked).await?;
            }
        }
        self.behind(newest.description().version.as_ref(), product, checked)
            .await
    }

    /// Is nothing there but what making a repository begins with? Then nothing was ever committed to it.
    fn is_unbegun(&self) -> bool {
        self.there.contains(&self.entry) || self.there.iter().all(|key| is_initial(key.as_str()))
    }

    /// Notes where its newest state is not of the newest version of the product.
    async fn behind(
        &self,
        own: Option<&ManifestId>,
        product: &ProductId,
        checked: &mut Checked,
    ) -> Result<(), CubeError> {
        let latest = manifests::latest(self.store, product).await?;
        if let Some(latest) = latest.map(|latest| latest.id())
            && own != Some(&latest)
        {
            let own = own.map_or_else(|| "none".to_owned(), ToString::to_string);
            checked.findings.push(Finding {
                key: self.entry.clone(),
                fault: Fault::Behind,
                reason: format!("its newest version is {own}, that of the product {latest}"),
            });
        }
        Ok(())
    }

    /// Notes where a state has the name of another version than it is of: somebody took that one's manifest away, and what was published
    /// next has its number.
    async fn of_another(
        &self,
        cube: &Cube,
        shown: &str,
        checked: &mut Checked,
    ) -> Result<(), CubeError> {
        let Some(own) = &cube.description().version else {
            return Ok(());
        };
        let published = match manifests::numbered(self.store, &own.product, own.number).await {
            Ok(published) => published.map(|manifest| manifest.id()),
            // It is told of by its own name.
            Err(StorageError::Damaged { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        if let Some(published) = published
            && published != *own
        {
            checked.findings.push(Finding {
                key: self.entry.clone(),
                fault: Fault::Damaged,
                reason: format!("{shown} is {own}, that of the product {published}"),
            });
        }
        Ok(())
    }

    /// Is everything there that says where a version's chunks are? What of it is damaged is told of already.
    async fn has_manifests(
        &self,
        repository: &Repository,
        cube: &Cube,
        shown: &str,
        checked: &mut Checked,
    ) -> Result<bool, CubeError> {
        let snapshot = cube.session().read().await.snapshot_id().clone();
        let files = repository.inner.lookup_manifest_files(&snapshot).await;
        let files = files.map_err(|e| repository.failed("listing manifests", &e))?;
        let mut has_all = true;
        for file in files {
            let key = format!("{}/manifests/{}", self.folder, file.id);
            let key: ObjectKey = key.parse().map_err(|e| named(&self.folder, &e))?;
            let is_told = checked.findings.iter().any(|finding| finding.key == key);
            let is_gone = self.is_gone(&key).await?;
            has_all &= !is_gone;
            if is_gone && !is_told {
                checked.findings.push(Finding {
                    key,
                    fault: Fault::Missing,
                    reason: format!("{shown} of a cube names it"),
                });
            }
        }
        Ok(has_all)
    }

    /// One version: where its damaged chunks are, and its steps that no version before it had.
    async fn version(
        &self,
        cube: &Cube,
        shown: &str,
        seen: &mut BTreeSet<[u8; 32]>,
        checked: &mut Checked,
    ) -> Result<(), CubeError> {
        let fresh: Vec<(usize, &Step)> = cube
            .steps()
            .iter()
            .enumerate()
            .filter(|(_, step)| seen.insert(*step.values_sha256.as_bytes()))
            .collect();
        let fresh_runs = cube.runs().made_of();
        let fresh_runs: Vec<usize> = fresh_runs
            .filter(|(_, made_of)| seen.insert(*made_of.as_bytes()))
            .map(|(run, _)| run)
            .collect();
        let unplaced = self.damaged.iter();
        let mut unplaced = unplaced.filter(|key| !checked.places.contains_key(key));
        if fresh.is_empty() && fresh_runs.is_empty() && unplaced.next().is_none() {
            return Ok(());
        }
        let broken = self.broken_chunks(cube, shown, checked).await?;
        for (place, step) in fresh {
            // Told of already, by its object.
            if broken.steps.contains(&(place as u32)) {
                continue;
            }
            match complete::compare(cube, place, BAND_CELLS).await {
                Ok(()) => {}
                Err(error @ (CubeError::Chunk { .. } | CubeError::Step { .. })) => {
                    let mut finding = self.finding(&error);
                    finding.reason = format!("{error} (step {} of {shown})", step.period);
                    checked.findings.push(finding);
                }
                Err(error) => return Err(error),
            }
        }
        for run in fresh_runs {
            let mut steps = series::steps_of(run, cube.steps());
            // Told of already, by the objects of its steps or its own.
            if broken.runs.contains(&(run as u32))
                || steps.any(|step| broken.steps.contains(&(step as u32)))
            {
                continue;
            }
            match stacked::compare(cube, run).await {
                Ok(()) => {}
                Err(error @ CubeError::Chunk { .. }) => {
                    let mut finding = self.finding(&error);
                    finding.reason = format!("{error} (in {shown})");
                    checked.findings.push(finding);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Notes where chunks are that are damaged or gone, and returns whose values those are.
    async fn broken_chunks(
        &self,
        cube: &Cube,
        shown: &str,
        checked: &mut Checked,
    ) -> Result<Broken, CubeError> {
        let session = cube.session();
        let session = session.read().await;
        let failed = |e| CubeError::library(&self.folder, "listing chunks", e);
        let mut chunks = std::pin::pin!(session.all_chunks().await.map_err(failed)?);
        let mut broken = Broken::default();
        let of_levels = cube.level_array_names();
        while let Some((path, chunk)) = chunks.try_next().await.map_err(failed)? {
            let ChunkPayload::Ref(reference) = &chunk.payload else {
                continue;
            };
            let key = format!("{}/chunks/{}", self.folder, reference.id);
            let key: ObjectKey = key.parse().map_err(|e| named(&self.folder, &e))?;
            let (array, index) = (path.to_string(), &chunk.coord.0);
            let array = array.trim_start_matches('/');
            let is_gone = self.is_gone(&key).await?;
            if !is_gone && !self.damaged.contains(&key) {
                continue;
            }
            if array == cube.array_name() || of_levels.iter().any(|own| own == array) {
                broken.steps.extend(index.first());
            } else if [cube.series_name(), cube.sums_name()].contains(&Some(array.to_owned())) {
                broken.runs.extend(index.last());
            }
            let place = format!("chunk {index:?} of {array} in {shown}");
            if is_gone && !checked.places.contains_key(&key) {
                checked.findings.push(Finding {
                    key: key.clone(),
                    fault: Fault::Missing,
                    reason: format!("a cube names it as {place}"),
                });
            }
            checked.places.entry(key).or_insert(place);
        }
        Ok(broken)
    }
}
