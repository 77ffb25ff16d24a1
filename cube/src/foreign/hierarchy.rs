//! A store of others: what kind it is, its group and the arrays in it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use icechunk::repository::VersionInfo;
use icechunk::session::Session;
use serde_json::{Map, Value};
use storage::attached::{Cause, StoreKind};
use tokio::sync::RwLock;
use zarrs::array::Array;
use zarrs::config::MetadataRetrieveVersion;
use zarrs::storage::{
    AsyncListableStorageTraits as _, AsyncReadableStorageTraits, StoreKey, StorePrefix,
};
use zarrs_icechunk::AsyncIcechunkStore;

use super::adapter::{self, Adapter, MAX_DOCUMENT_BYTES};
use super::array::{Absent, ForeignArray};
use super::chunks::Chunks;
use super::error::ForeignError;
use super::failures::{Failures, Noted};
use super::objects::Objects;
use super::state::State;
use crate::error::first_lines;

/// Most arrays of a group that are looked at.
const MAX_ARRAYS: usize = 4096;
/// Groups that are told where one without arrays is given.
const TOLD_GROUPS: usize = 8;

/// What was found at an address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// What kind of store it is.
    pub kind: StoreKind,
    /// Of a repository the state to read; none: the newest of its branch `main`.
    pub snapshot: Option<String>,
}

/// A group of arrays of others, opened.
pub struct Foreign {
    /// What it is.
    pub found: Found,
    /// Attributes of the group.
    pub attributes: Map<String, Value>,
    arrays: BTreeMap<String, Result<ForeignArray, ForeignError>>,
    /// Some groups in it, where it has no arrays.
    groups: Vec<String>,
    chunks: Chunks,
    place: String,
    failures: Arc<Failures>,
    /// Of a repository: its chunks.
    session: Option<Arc<RwLock<Session>>>,
    /// Of a repository: tells what changed between its states.
    repository: Option<icechunk::Repository>,
}

/// Chunks of an array that differ between two states of a repository, by their indexes.
#[derive(Debug)]
pub struct Changed(BTreeSet<Vec<u64>>);

/// Which arrays of a store to open.
enum Wanted<'a> {
    All(Vec<String>),
    /// Where nothing is listed: this one, its coordinates, and their bounds.
    Around(&'a str),
    One(&'a str),
}

type Arrays = Arc<dyn AsyncReadableStorageTraits>;

impl Found {
    /// Looks what lies at an address.
    ///
    /// # Errors
    /// Nothing that is read, or no answer.
    pub async fn at(objects: &Arc<dyn Objects>) -> Result<Self, ForeignError> {
        // Where nothing may be listed, what is not there is refused as what must not be read is.
        let mut denied = None;
        for (name, kind) in [
            ("zarr.json", Some(StoreKind::Zarr3)),
            (".zmetadata", Some(StoreKind::Zarr2)),
            (".zgroup", Some(StoreKind::Zarr2)),
            ("repo", Some(StoreKind::Icechunk)),
            ("refs/branch.main/ref.json", Some(StoreKind::Icechunk)),
            (".zarray", None),
        ] {
            let is_there = match objects.size(name).await {
                Err(e) if e.cause == Cause::Access => {
                    denied.get_or_insert(e);
                    false
                }
                size => size?.is_some(),
            };
            if !is_there {
                continue;
            }
            let Some(kind) = kind else {
                let reason =
                    "is a single array: give the group that it lies in, with its coordinates";
                return Err(ForeignError::refused(objects.place(), reason));
            };
            return Ok(Self {
                kind,
                snapshot: None,
            });
        }
        let reason =
            "is neither a Zarr group (zarr.json, .zgroup) nor an Icechunk repository (repo)";
        Err(denied.unwrap_or_else(|| ForeignError::absent(objects.place(), reason)))
    }
}

impl Foreign {
    /// Opens a group with all of its arrays. `wanted` is the one that is asked for: where nothing can be listed it is opened
    /// with what it names.
    ///
    /// # Errors
    /// It cannot be read, or an array does not answer now. An array that cannot be read is told where it is asked for.
    pub async fn open(
        objects: Arc<dyn Objects>,
        found: Found,
        wanted: Option<&str>,
    ) -> Result<Self, ForeignError> {
        let place = objects.place();
        let (objects, failures) = Noted::of(objects);
        match found.kind {
            StoreKind::Icechunk => {
                let (state, found) = state(objects, found, &failures).await?;
                let store = AsyncIcechunkStore::from(Arc::clone(&state.session));
                let names = store.list_dir(&StorePrefix::root()).await;
                let names = names.map_err(|e| failures.told(&place, "listing its arrays", &e))?;
                let names = names.prefixes().iter();
                let names = names.map(|name| name.as_str().trim_end_matches('/').to_owned());
                let wanted = Wanted::All(names.collect());
                let store: Arrays = Arc::new(store);
                let store = (store, Some(state.session));
                let mut own = Self::of(store, (found, place, failures), wanted).await?;
                own.repository = state.repository;
                Ok(own)
            }
            StoreKind::Zarr2 | StoreKind::Zarr3 => {
                let documents = documents(&objects, found.kind).await?;
                let names = match named(&documents) {
                    names if names.is_empty() => objects.folders("").await?,
                    names => Some(names),
                };
                let wanted = match (names, wanted) {
                    (Some(names), _) => Wanted::All(names),
                    (None, Some(wanted)) => Wanted::Around(wanted),
                    (None, None) => {
                        let reason = "has no consolidated metadata, and nothing can be listed here: say --variable, or write it with consolidated metadata";
                        return Err(ForeignError::refused(place, reason));
                    }
                };
                let documents = Arc::new(documents);
                let store: Arrays = Arc::new(Adapter { objects, documents });
                Self::of((store, None), (found, place, failures), wanted).await
            }
        }
    }

    /// Opens one array alone.
    ///
    /// # Errors
    /// It cannot be read.
    pub async fn open_one(
        objects: Arc<dyn Objects>,
        found: Found,
        array: &str,
    ) -> Result<Self, ForeignError> {
        let place = objects.place();
        let (objects, failures) = Noted::of(objects);
        let (store, session, found): (Arrays, _, Found) = match found.kind {
            StoreKind::Icechunk => {
                let (state, found) = state(objects, found, &failures).await?;
                let store = AsyncIcechunkStore::from(Arc::clone(&state.session));
                (Arc::new(store), Some(state.session), found)
            }
            StoreKind::Zarr2 | StoreKind::Zarr3 => {
                let documents = Arc::default();
                (Arc::new(Adapter { objects, documents }), None, found)
            }
        };
        let (store, wanted) = ((store, session), Wanted::One(array));
        let own = Self::of(store, (found, place, failures), wanted).await?;
        // Who keeps it open must not keep what may pass.
        own.array(array)?;
        Ok(own)
    }

    async fn of(
        (store, session): (Arrays, Option<Arc<RwLock<Session>>>),
        (found, place, failures): (Found, String, Arc<Failures>),
        wanted: Wanted<'_>,
    ) -> Result<Self, ForeignError> {
        let mut own = Self {
            attributes: Map::new(),
            arrays: BTreeMap::new(),
            groups: vec![],
            chunks: Chunks::default(),
            place,
            failures,
            found,
            session,
            repository: None,
        };
        match wanted {
            Wanted::One(name) => own.add(&store, name).await,
            Wanted::All(names) => {
                if names.len() > MAX_ARRAYS {
                    let reason =
                        format!("has {} arrays, at most {MAX_ARRAYS} are read", names.len());
                    return Err(ForeignError::refused(own.place, reason));
                }
                own.attributes = group(&store, own.found.kind, (&own.place, &own.failures)).await?;
                for name in &names {
                    own.add(&store, name).await;
                }
                if own.arrays().next().is_none() {
                    own.groups = groups(&store, own.found.kind, &names).await;
                }
            }
            Wanted::Around(name) => {
                own.attributes = group(&store, own.found.kind, (&own.place, &own.failures)).await?;
                own.add(&store, name).await;
                for _with_bounds in 0..2 {
                    for name in own.mentioned() {
                        own.add(&store, &name).await;
                    }
                }
            }
        }
        // What does not answer now is not what is not there: without its bounds a coordinate means something else.
        let mut failed = own.arrays.values().filter_map(|array| array.as_ref().err());
        let away = failed.find(|error| error.is_retryable()).cloned();
        away.map_or(Ok(own), Err)
    }

    /// Opens an array; what is none is left out.
    async fn add(&mut self, store: &Arrays, name: &str) {
        if self.arrays.contains_key(name) {
            return;
        }
        let version = match self.found.kind {
            StoreKind::Zarr2 => MetadataRetrieveVersion::V2,
            StoreKind::Zarr3 | StoreKind::Icechunk => MetadataRetrieveVersion::V3,
        };
        let opened = Array::async_open_opt(Arc::clone(store), &format!("/{name}"), &version).await;
        let array = match opened {
            Ok(array) => ForeignArray::new(name, (&self.place, &self.failures), array)
                .map(|array| array.of(self.session.clone())),
            Err(zarrs::array::ArrayCreateError::MissingMetadata) => return,
            Err(e) => {
                let place = format!("{} array {name}", self.place);
                Err(self
                    .failures
                    .told(&place, "cannot be read by this program", &e))
            }
        };
        self.arrays.insert(name.to_owned(), array);
    }

    /// Names of dimensions and of what attributes name, which may be arrays.
    fn mentioned(&self) -> Vec<String> {
        let mut names = vec![];
        for array in self.arrays() {
            names.extend(array.dimensions.iter().filter_map(|(name, _)| name.clone()));
            for attribute in ["bounds", "climatology", "grid_mapping"] {
                let name = array.attributes.get(attribute).and_then(Value::as_str);
                names.extend(name.map(str::to_owned));
            }
            let coordinates = array.attributes.get("coordinates").and_then(Value::as_str);
            let coordinates = coordinates.unwrap_or_default().split_whitespace();
            names.extend(coordinates.map(str::to_owned));
        }
        let is_name = |name: &String| !name.contains('/') && !name.is_empty();
        names.retain(is_name);
        names.truncate(MAX_ARRAYS);
        names
    }

    /// Arrays that can be read.
    pub fn arrays(&self) -> impl Iterator<Item = &ForeignArray> {
        self.arrays.values().filter_map(|array| array.as_ref().ok())
    }

    /// The array of a name.
    ///
    /// # Errors
    /// It is not there, or cannot be read: a codec, say, that this program does not have.
    pub fn array(&self, name: &str) -> Result<&ForeignArray, ForeignError> {
        match self.arrays.get(name) {
            Some(Ok(array)) => Ok(array),
            Some(Err(error)) => Err(error.clone()),
            None => {
                let there: Vec<&str> = self.arrays().map(|array| array.name.as_str()).collect();
                let groups = self.groups.join(", ");
                let rest = match (self.groups.first(), self.found.kind) {
                    _ if !there.is_empty() => format!("; it has {}", there.join(", ")),
                    (None, _) => ", nor any other that can be read".to_owned(),
                    (Some(_), StoreKind::Icechunk) => format!(
                        " but groups ({groups}), and of a repository the arrays of its root are read"
                    ),
                    (Some(first), _) => format!(
                        " but groups ({groups}): give the one with the array, {}/{first} say",
                        self.place
                    ),
                };
                let reason = format!("has no array {name:?}{rest}");
                Err(ForeignError::refused(&self.place, reason))
            }
        }
    }

    /// Why an array that is there cannot be read; none of one that can be, or that is not there.
    pub fn unread(&self, name: &str) -> Option<&ForeignError> {
        self.arrays.get(name)?.as_ref().err()
    }

    /// What of an array changed since an earlier state of the repository. None where that cannot be told: it is no repository,
    /// the state is no ancestor of this one or has been let go, or the array was made anew.
    pub async fn changed_since(&self, snapshot: &str, array: &str) -> Option<Changed> {
        let (repository, own) = (self.repository.as_ref()?, self.found.snapshot.as_deref()?);
        if own == snapshot {
            return Some(Changed(BTreeSet::new()));
        }
        let state = |text: &str| -> Option<VersionInfo> {
            Some(VersionInfo::SnapshotId(text.try_into().ok()?))
        };
        let diff = repository.diff(&state(snapshot)?, &state(own)?).await;
        let diff = diff
            .inspect_err(|e| tracing::info!(error = first_lines(e), "what changed is not known"))
            .ok()?;
        let is_own = |path: &icechunk::format::Path| {
            let path = path.to_string();
            path == "/" || path.trim_start_matches('/') == array
        };
        let is_anew = diff.new_arrays.iter().any(is_own)
            || diff.deleted_arrays.iter().any(is_own)
            || diff.deleted_groups.iter().any(is_own)
            || !diff.moved_nodes.is_empty();
        if is_anew {
            return None;
        }
        let chunks = diff.updated_chunks.iter().filter(|(path, _)| is_own(path));
        let indexes = chunks.flat_map(|(_, chunks)| chunks);
        let index = |chunk: &icechunk::format::ChunkIndices| {
            chunk.0.iter().map(|index| u64::from(*index)).collect()
        };
        Some(Changed(indexes.map(index).collect()))
    }

    /// Does a part of an array lie in chunks that did not change?
    ///
    /// # Errors
    /// There is no such part.
    pub fn is_unchanged(
        &self,
        array: &str,
        part: &[Range<u64>],
        changed: &Changed,
    ) -> Result<bool, ForeignError> {
        let chunks = self.array(array)?.chunks_of(part)?;
        Ok(!chunks.iter().any(|(index, _)| changed.0.contains(index)))
    }

    /// Values of a part of an array, row-major, as float64.
    ///
    /// # Errors
    /// With place, array and chunk: what is not there, damaged, too large, or does not answer.
    pub async fn read(
        &self,
        array: &str,
        part: &[Range<u64>],
        absent: Absent,
    ) -> Result<Vec<f64>, ForeignError> {
        self.chunks.read(self.array(array)?, part, absent).await
    }
}

/// Opens a state of a repository, and says which.
async fn state(
    objects: Arc<dyn Objects>,
    found: Found,
    failures: &Failures,
) -> Result<(State, Found), ForeignError> {
    let state = State::open(objects, found.snapshot.as_deref(), failures).await?;
    let snapshot = Some(state.snapshot.to_string());
    Ok((state, Found { snapshot, ..found }))
}

/// Documents of all arrays that came in one; nothing where they lie apart.
async fn documents(
    objects: &Arc<dyn Objects>,
    kind: StoreKind,
) -> Result<BTreeMap<String, Bytes>, ForeignError> {
    let name = match kind {
        StoreKind::Zarr2 => ".zmetadata",
        StoreKind::Zarr3 | StoreKind::Icechunk => "zarr.json",
    };
    let mut all = BTreeMap::new();
    let content = match objects.get(name, None, MAX_DOCUMENT_BYTES).await {
        // Where nothing may be listed, this is how what is not there is told.
        Err(e) if kind == StoreKind::Zarr2 && e.cause == Cause::Access => None,
        content => content?,
    };
    let Some(content) = content.map(|content| adapter::plain(&content)) else {
        return Ok(all);
    };
    let place = format!("{}/{name}", objects.place());
    let root: Value = serde_json::from_slice(&content)
        .map_err(|e| ForeignError::refused(&place, format!("is no JSON document: {e}")))?;
    if root.get("node_type").and_then(Value::as_str) == Some("array") {
        let reason = "is a single array: give the group that it lies in, with its coordinates";
        return Err(ForeignError::refused(objects.place(), reason));
    }
    let together = match kind {
        StoreKind::Zarr2 => root.get("metadata"),
        StoreKind::Zarr3 | StoreKind::Icechunk => root
            .get("consolidated_metadata")
            .and_then(|own| own.get("metadata")),
    };
    for (name, document) in together.and_then(Value::as_object).into_iter().flatten() {
        let name = match kind {
            StoreKind::Zarr2 => name.clone(),
            StoreKind::Zarr3 | StoreKind::Icechunk => format!("{name}/zarr.json"),
        };
        all.insert(name, document.to_string().into());
    }
    if kind == StoreKind::Zarr3 && !all.is_empty() {
        all.insert(name.to_owned(), content);
    }
    Ok(all)
}

/// Arrays directly in the group that documents tell of.
fn named(documents: &BTreeMap<String, Bytes>) -> Vec<String> {
    let name = |key: &String| {
        let (name, document) = key.split_once('/')?;
        matches!(document, "zarr.json" | ".zarray").then(|| name.to_owned())
    };
    documents.keys().filter_map(name).collect()
}

/// The first groups of these names.
async fn groups(store: &Arrays, kind: StoreKind, names: &[String]) -> Vec<String> {
    let document = match kind {
        StoreKind::Zarr2 => ".zgroup",
        StoreKind::Zarr3 | StoreKind::Icechunk => "zarr.json",
    };
    let mut groups = vec![];
    for name in names.iter().take(TOLD_GROUPS) {
        let Ok(key) = StoreKey::new(format!("{name}/{document}")) else {
            continue;
        };
        let Ok(Some(content)) = store.get(&key).await else {
            continue;
        };
        let says = serde_json::from_slice::<Value>(&content).unwrap_or_default();
        if kind == StoreKind::Zarr2 || says["node_type"] == "group" {
            groups.push(name.clone());
        }
    }
    groups
}

/// Attributes of the group.
async fn group(
    store: &Arrays,
    kind: StoreKind,
    (place, failures): (&str, &Failures),
) -> Result<Map<String, Value>, ForeignError> {
    let name = match kind {
        StoreKind::Zarr2 => ".zattrs",
        StoreKind::Zarr3 | StoreKind::Icechunk => "zarr.json",
    };
    let refused = |e: String| ForeignError::refused(format!("{place}/{name}"), e);
    let key = StoreKey::new(name).map_err(|e| refused(e.to_string()))?;
    let document = store.get(&key).await;
    let failed = |e| failures.told(place, "reading what it says of itself", &e);
    let Some(document) = document.map_err(failed)? else {
        return Ok(Map::new());
    };
    let mut root: Value = serde_json::from_slice(&document)
        .map_err(|e| refused(format!("is no JSON document: {e}")))?;
    let own = match kind {
        StoreKind::Zarr2 => root,
        StoreKind::Zarr3 | StoreKind::Icechunk => root["attributes"].take(),
    };
    Ok(match own {
        Value::Object(attributes) => attributes,
        _ => Map::new(),
    })
}
