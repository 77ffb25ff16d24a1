//! A product's repository: made, opened, its versions.

use std::sync::Arc;

use futures::future::BoxFuture;
use icechunk::RepositoryConfig;
use icechunk::config::{
    ManifestConfig, ManifestPreloadCondition, ManifestPreloadConfig, ManifestSplitCondition,
    ManifestSplitDim, ManifestSplitDimCondition, ManifestSplittingConfig,
};
use icechunk::format::SnapshotId;
use icechunk::format::format_constants::SpecVersionBin;
use icechunk::format::snapshot::Snapshot;
use icechunk::refs::RefErrorKind;
use icechunk::repository::{RepositoryError, RepositoryErrorKind, VersionInfo};
use storage::Store;
use tokio::sync::RwLock;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::object_storage::ObjectStorage;
use crate::{Cube, CubeError, Description, Layout, held_steps, plain};

/// The branch that commits go to.
pub(crate) const BRANCH: &str = "main";
/// References of chunks in one manifest: what a commit writes again of those that are there, 40 bytes each.
const MANIFEST_CHUNKS: u32 = 512;

/// Changes that `repo` tells of, for people; what came before is not kept.
const LOGGED_UPDATES: u16 = 100;

/// The repository of one product.
pub struct Repository {
    pub(crate) inner: icechunk::Repository,
    pub(crate) description: Description,
    /// Where its objects are.
    objects: ObjectStorage,
    /// For messages.
    pub(crate) place: String,
}

/// Which state of a cube to read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum At {
    /// What was committed last.
    Newest,
    /// What was tagged with this name.
    Version(String),
}

impl Repository {
    /// Makes a repository without steps in a folder of a store; `""` is the whole store.
    ///
    /// # Errors
    /// `Exists` if the folder is not empty.
    pub fn create<'a>(
        store: &'a Store,
        folder: &'a str,
        description: &'a Description,
    ) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move {
            let objects = ObjectStorage::new(store.clone(), folder);
            let place = objects.to_string();
            let made = icechunk::Repository::create(Arc::new(objects.clone()))
                .config(config(description))
                .spec_version(SpecVersionBin::V2)
                .execute();
            let inner = made.await.map_err(|e| match e.kind {
                RepositoryErrorKind::ParentDirectoryNotClean => CubeError::Exists {
                    place: place.clone(),
                },
                _ => CubeError::library(&place, "making a repository", e),
            })?;
            let repository = Self {
                inner,
                description: description.clone(),
                objects,
                place,
            };
            let session = repository.session().await?;
            let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&session)));
            plain::write_frame_of_reference(&arrays, description).await?;
            let mut session = session.write().await;
            let made = session.commit("an empty cube").execute().await;
            made.map_err(|e| repository.failed("committing an empty cube", &e))?;
            Ok(repository)
        })
    }

    /// Opens the repository in a folder of a store, or makes one, for a change that gives it this description: it may have
    /// been made by somebody who was killed before it was of anything.
    pub(crate) async fn for_change(
        store: &Store,
        folder: &str,
        description: &Description,
    ) -> Result<Self, CubeError> {
        let inner = match Self::open_inner(store, folder, Some(config(description))).await {
            Err(CubeError::Missing { place }) => {
                let storage = ObjectStorage::new(store.clone(), folder);
                let made = icechunk::Repository::create(Arc::new(storage))
                    .config(config(description))
                    .spec_version(SpecVersionBin::V2)
                    // What somebody left who was killed over this is no reason to stop.
                    .check_clean_root(false)
                    .execute();
                match made.await {
                    Ok(inner) => inner,
                    Err(error) => {
                        // Others made it meanwhile, or it cannot be made.
                        let there = Self::open_inner(store, folder, Some(config(description)));
                        there.await.map_err(|_missing| {
                            CubeError::library(&place, "making a repository", error)
                        })?
                    }
                }
            }
            opened => opened?,
        };
        let objects = ObjectStorage::new(store.clone(), folder);
        Ok(Self {
            inner,
            description: description.clone(),
            place: objects.to_string(),
            objects,
        })
    }

    async fn open_inner(
        store: &Store,
        folder: &str,
        config: Option<RepositoryConfig>,
    ) -> Result<icechunk::Repository, CubeError> {
        let storage = ObjectStorage::new(store.clone(), folder);
        let place = storage.to_string();
        let opened = icechunk::Repository::open(Arc::new(storage))
            .config(read_when_needed(config.unwrap_or_default()));
        opened.execute().await.map_err(|e| match e.kind {
            RepositoryErrorKind::RepositoryDoesntExist => CubeError::Missing { place },
            _ => CubeError::library(&place, "opening the repository", e),
        })
    }

    /// Opens the repository in a folder of a store.
    ///
    /// # Errors
    /// `Missing` if there is none, or nothing was committed to it yet; `Foreign` if it is not of a product.
    pub fn open<'a>(store: &'a Store, folder: &'a str) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move {
            let inner = Self::open_inner(store, folder, None).await?;
            let place = ObjectStorage::new(store.clone(), folder).to_string();
            let version = VersionInfo::BranchTipRef(BRANCH.to_owned());
            let session = inner.readonly_session(&version).await;
            let session =
                session.map_err(|e| CubeError::library(&place, "reading the newest state", e))?;
            // Somebody is making it, or was killed over that.
            if *session.snapshot_id() == Snapshot::INITIAL_SNAPSHOT_ID {
                return Err(CubeError::Missing { place });
            }
            let arrays = Arc::new(AsyncIcechunkStore::new(session));
            let description = Description::of_group(&arrays, &place).await?;
            Ok(Self {
                inner,
                description,
                objects: ObjectStorage::new(store.clone(), folder),
                place,
            })
        })
    }

    /// What it is of.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Where it is, for people.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Opens a state to read.
    ///
    /// # Errors
    /// `NoVersion` with the versions there are.
    pub fn at<'a>(&'a self, at: &'a At) -> BoxFuture<'a, Result<Cube, CubeError>> {
        Box::pin(async move {
            let version = match at {
                At::Newest => VersionInfo::BranchTipRef(BRANCH.to_owned()),
                At::Version(tag) => VersionInfo::TagRef(tag.clone()),
            };
            let session = match (self.inner.readonly_session(&version).await, at) {
                (Ok(session), _) => session,
                (Err(error), At::Newest) => {
                    return Err(self.failed("reading the newest state", &error));
                }
                // By the error alone: a list of versions that is read now may have one that was named meanwhile.
                (Err(error), At::Version(version)) if is_no_tag(&error) => {
                    let mut there = self.versions().await?;
                    there.retain(|it| it != version);
                    return Err(CubeError::NoVersion {
                        place: self.place.clone(),
                        version: version.clone(),
                        there: if there.is_empty() {
                            "none".to_owned()
                        } else {
                            there.join(", ")
                        },
                    });
                }
                (Err(error), At::Version(_)) => {
                    return Err(self.failed("reading a version", &error));
                }
            };
            Cube::open(session, &self.objects, None).await
        })
    }

    /// The newest state for what is made of it behind whoever lands versions: steps that this process has committed are not read again.
    pub(crate) async fn newest(&self) -> Result<Cube, CubeError> {
        let version = VersionInfo::BranchTipRef(BRANCH.to_owned());
        let session = self.inner.readonly_session(&version).await;
        let session = session.map_err(|e| self.failed("reading the newest state", &e))?;
        let steps = held_steps::of(&self.place, &session.snapshot_id().to_string());
        Cube::open(session, &self.objects, steps).await
    }

    /// Names a state for good: what cites it is answered the same ever after. Nothing is done if it has that name.
    pub fn tag<'a>(
        &'a self,
        version: &'a str,
        snapshot: &'a str,
    ) -> BoxFuture<'a, Result<(), CubeError>> {
        Box::pin(async move {
            let id = SnapshotId::try_from(snapshot)
                .map_err(|e| CubeError::library(&self.place, "naming a version", e))?;
            let Err(error) = self.inner.create_tag(version, &id).await else {
                return Ok(());
            };
            // Named before, by somebody else.
            if self.is_tagged(version, snapshot).await {
                Ok(())
            } else {
                Err(self.failed("naming a version", &error))
            }
        })
    }

    /// Names the newest state.
    pub(crate) async fn newest_snapshot(&self) -> Result<String, CubeError> {
        let newest = self.inner.lookup_branch(BRANCH).await;
        let newest = newest.map_err(|e| self.failed("looking for the newest state", &e))?;
        Ok(newest.to_string())
    }

    /// Has a state this name?
    pub(crate) async fn is_tagged(&self, version: &str, snapshot: &str) -> bool {
        let there = self.inner.lookup_tag(version).await;
        there.is_ok_and(|there| there.to_string() == snapshot)
    }

    /// Is there a state of this name?
    ///
    /// # Errors
    /// A store that does not answer.
    pub(crate) async fn has_version(&self, version: &str) -> Result<bool, CubeError> {
        match self.inner.lookup_tag(version).await {
            Ok(_snapshot) => Ok(true),
            Err(error) if is_no_tag(&error) => Ok(false),
            Err(error) => Err(self.failed("looking for a version", &error)),
        }
    }

    /// Names of versions, sorted.
    pub fn versions(&self) -> BoxFuture<'_, Result<Vec<String>, CubeError>> {
        Box::pin(async move {
            let tags = self.inner.list_tags().await;
            let tags = tags.map_err(|e| self.failed("listing versions", &e))?;
            Ok(tags.into_iter().collect())
        })
    }

    /// A session that changes the newest state.
    pub(crate) async fn session(
        &self,
    ) -> Result<Arc<RwLock<icechunk::session::Session>>, CubeError> {
        let session = self.inner.writable_session(BRANCH).await;
        let session = session.map_err(|e| self.failed("beginning a change", &e))?;
        Ok(Arc::new(RwLock::new(session)))
    }

    pub(crate) fn failed(&self, doing: &'static str, error: &dyn std::fmt::Display) -> CubeError {
        CubeError::library(&self.place, doing, error)
    }
}

/// Does it say that there is no such tag?
pub(crate) fn is_no_tag(error: &RepositoryError) -> bool {
    matches!(
        error.kind,
        RepositoryErrorKind::Ref(RefErrorKind::RefNotFound(_))
    )
}

/// The same for this process, which reads nothing ahead: opening a state has Icechunk read the manifests of all coordinates beside
/// it, those of every level too, which are known from the description.
pub(crate) fn read_when_needed(config: RepositoryConfig) -> RepositoryConfig {
    let preload = ManifestPreloadConfig {
        preload_if: Some(ManifestPreloadCondition::False),
        ..ManifestPreloadConfig::default()
    };
    RepositoryConfig {
        manifest: Some(ManifestConfig {
            preload: Some(preload),
            ..config.manifest.unwrap_or_default()
        }),
        ..config
    }
}

/// Manifests end at so many steps: a commit writes the last one again, however many steps there are.
fn config(description: &Description) -> RepositoryConfig {
    let [rows, cols] = Layout::of(&description.grid).objects(&description.grid);
    let split = ManifestSplitDim {
        condition: ManifestSplitDimCondition::DimensionName("^(series_)?time$".to_owned()),
        num_chunks: (MANIFEST_CHUNKS / (rows * cols)).max(1),
    };
    let splitting = ManifestSplittingConfig {
        split_sizes: Some(vec![(ManifestSplitCondition::AnyArray, vec![split])]),
    };
    RepositoryConfig {
        manifest: Some(ManifestConfig {
            splitting: Some(splitting),
            ..ManifestConfig::default()
        }),
        num_updates_per_repo_info_file: Some(LOGGED_UPDATES),
        ..RepositoryConfig::default()
    }
}
