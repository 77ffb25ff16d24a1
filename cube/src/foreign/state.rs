//! A repository of others in, the state of it that is read out; chunks that lie elsewhere are told, and never fetched.

use std::collections::HashMap;
use std::fmt::Display;
use std::sync::Arc;

use icechunk::RepositoryConfig;
use icechunk::asset_manager::AssetManager;
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path, SnapshotId};
use icechunk::repository::{DetectedSpecVersion, VersionInfo};
use icechunk::session::Session;
use icechunk::storage::Storage;
use icechunk::virtual_chunks::VirtualChunkResolver;
use tokio::sync::RwLock;

use super::error::ForeignError;
use super::failures::Failures;
use super::objects::Objects;
use super::read_only::ReadOnly;
use crate::repository::read_when_needed;

/// The branch of a repository whose newest state is read.
const BRANCH: &str = "main";
/// Characters of a location that are shown.
const SHOWN_CHARS: usize = 120;

/// One state of a repository, opened.
pub(super) struct State {
    /// Its chunks.
    pub(super) session: Arc<RwLock<Session>>,
    pub(super) snapshot: SnapshotId,
    /// Tells what changed between states; none where its configuration cannot be read.
    pub(super) repository: Option<icechunk::Repository>,
}

impl State {
    /// Opens a state, or the newest one of its branch `main`.
    pub(super) async fn open(
        objects: Arc<dyn Objects>,
        snapshot: Option<&str>,
        failures: &Failures,
    ) -> Result<Self, ForeignError> {
        let place = objects.place();
        let refused = |doing: &str, e: &dyn Display| failures.told(&place, doing, e);
        let wanted = snapshot.map(|text| {
            let id: Result<SnapshotId, _> = text.try_into();
            id.map_err(|_no_name: &str| refused("opening a state", &format!("{text:?} names none")))
        });
        let wanted = wanted.transpose()?;
        let mut config = read_when_needed(RepositoryConfig::default());
        config.clear_virtual_chunk_containers();
        let storage: Arc<dyn Storage + Send + Sync> = Arc::new(ReadOnly(objects));
        let opened = icechunk::Repository::open(Arc::clone(&storage)).config(config.clone());
        let opened = opened.execute().await;
        let opened = match opened.map_err(|e| refused("opening the Icechunk repository", &e)) {
            Ok(opened) => opened,
            Err(told) => {
                let state = Self::without_its_configuration(storage, config, wanted).await;
                return state.ok_or(told);
            }
        };
        let snapshot = match wanted {
            Some(snapshot) => snapshot,
            None => opened
                .lookup_branch(BRANCH)
                .await
                .map_err(|e| refused("reading the branch main", &e))?,
        };
        let version = VersionInfo::SnapshotId(snapshot.clone());
        let session = opened.readonly_session(&version).await;
        let session = session.map_err(|e| refused(&format!("opening the state {snapshot}"), &e))?;
        Ok(Self {
            session: Arc::new(RwLock::new(session)),
            snapshot,
            repository: Some(opened),
        })
    }

    /// The same of a repository whose configuration names what the library was built without here: containers of virtual chunks
    /// in folders or in other clouds, say. Nothing of it is needed to read what lies in the repository. None where that is not
    /// what is in the way.
    async fn without_its_configuration(
        storage: Arc<dyn Storage + Send + Sync>,
        config: RepositoryConfig,
        wanted: Option<SnapshotId>,
    ) -> Option<Self> {
        let detected = icechunk::Repository::fetch_spec_version(Arc::clone(&storage), None).await;
        // Version 1 has its configuration in an object of its own, which is never read.
        let DetectedSpecVersion::V2Plus { version, repo_info } = detected.ok()?? else {
            return None;
        };
        if repo_info.config::<RepositoryConfig>().is_ok() {
            return None;
        }
        let snapshot = match wanted {
            Some(snapshot) => snapshot,
            None => repo_info.resolve_branch(BRANCH).ok()?,
        };
        let settings = storage.default_settings().await.ok()?;
        let assets = AssetManager::new_with_config(
            Arc::clone(&storage),
            settings.clone(),
            version,
            config.caching(),
            config.compression().level(),
            config.max_concurrent_requests(),
            config.max_concurrent_decodes(),
        );
        let nowhere =
            VirtualChunkResolver::new(std::iter::empty(), HashMap::new(), settings.clone());
        let session = Session::create_readonly_session(
            config,
            settings,
            storage,
            Arc::new(assets),
            Arc::new(nowhere),
            snapshot.clone(),
        );
        Some(Self {
            session: Arc::new(RwLock::new(session)),
            snapshot,
            repository: None,
        })
    }
}

/// Where a chunk lies that is not in its repository; none of one that is, and where that cannot be told.
pub(super) async fn elsewhere(
    session: &RwLock<Session>,
    array: &str,
    index: &[u64],
) -> Option<String> {
    let path = Path::new(&format!("/{array}")).ok()?;
    let index = index.iter().map(|index| u32::try_from(*index).ok());
    let index = ChunkIndices(index.collect::<Option<_>>()?);
    let session = session.read().await;
    match session.get_chunk_ref(&path, &index).await.ok()?? {
        ChunkPayload::Virtual(chunk) => Some(shown(chunk.location.url())),
        _ => None,
    }
}

/// A location of others in one short line, without what may be secret in it: user, password, and what stands behind `?` or `#`.
fn shown(location: &str) -> String {
    let location = location.split(['?', '#']).next().unwrap_or_default();
    let (scheme, rest) = match location.split_once("://") {
        Some((scheme, rest)) => (format!("{scheme}://"), rest),
        None => (String::new(), location),
    };
    let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    let host = host.rsplit('@').next().unwrap_or_default();
    let location = format!("{scheme}{host}{path}");
    let clean = |c: char| if c.is_control() { '?' } else { c };
    location.chars().take(SHOWN_CHARS).map(clean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_location_is_shown_without_what_may_be_secret() {
        for (location, expected) in [
            ("s3://bucket/a/b.nc", "s3://bucket/a/b.nc"),
            (
                "https://me:word@host:8/a@b.nc?sig=1#c",
                "https://host:8/a@b.nc",
            ),
            ("file:///data/a.nc", "file:///data/a.nc"),
            ("vcc://theirs/a\n.nc", "vcc://theirs/a?.nc"),
        ] {
            assert_eq!(shown(location), expected);
        }
    }
}
