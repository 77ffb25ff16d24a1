//! What changed between two states of a repository, damage of what names its chunks, and chunks that lie elsewhere; arrays that do
//! not answer.

use std::ops::Range;
use std::path::Path as FilePath;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use icechunk::asset_manager::AssetManager;
use icechunk::format::format_constants::SpecVersionBin;
use icechunk::format::manifest::{ChunkPayload, VirtualChunkLocation, VirtualChunkRef};
use icechunk::format::repo_info::RepoInfo;
use icechunk::format::snapshot::NodeData;
use icechunk::format::{ChunkIndices, Path};
use icechunk::storage::Settings;
use icechunk::virtual_chunks::VirtualChunkContainer;
use icechunk::{ObjectStoreConfig, RepositoryConfig};
use object_store::GetRange;
use serde_json::json;
use storage::Store;
use storage::attached::StoreKind;
use tempfile::TempDir;

use super::read_only::ReadOnly;
use super::{Absent, Foreign, ForeignError, Found, Objects, StoredObjects};
use crate::{Description, Edit, Repository, cf};

/// Two chunks side by side.
const GRID: Grid = Grid {
    rows: 450,
    cols: 615,
    north_deg: 30.0,
    west_deg: 100.0,
    dlat_deg: 0.05,
    dlon_deg: 0.05,
};
const QUANTITY: Quantity = Quantity::SeaSurfaceTemperature;
/// First column of the second chunk.
const SECOND: u64 = 308;

/// A repository in a folder.
struct Other {
    folder: TempDir,
    repository: Repository,
}

impl Other {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let description = Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: QUANTITY,
            synthetic: true,
            source: "a test".to_owned(),
            grid: GRID,
            version: None,
            statistic: None,
        };
        let repository = Repository::create(&store, "p", &description).await;
        let own = Self {
            folder,
            repository: repository.unwrap(),
        };
        own.put(290.0, 291.0).await;
        own
    }

    /// Has the second chunk hold what the first one does.
    async fn replace_second(&self) {
        let session = self.repository.session().await.unwrap();
        let mut session = session.write().await;
        let path = Path::new(&format!("/{}", variable())).unwrap();
        let [first, second] = [0, 1].map(|col| ChunkIndices(vec![0, 0, col]));
        let payload = session.get_chunk_ref(&path, &first).await.unwrap();
        assert!(payload.is_some());
        session.set_chunk_ref(path, second, payload).await.unwrap();
        session.commit("one chunk").execute().await.unwrap();
    }

    /// Has the second chunk be a part of a file elsewhere.
    async fn refer_second_to(&self, location: &str) {
        let session = self.repository.session().await.unwrap();
        let mut session = session.write().await;
        let path = Path::new(&format!("/{}", variable())).unwrap();
        let chunk = VirtualChunkRef {
            location: VirtualChunkLocation::from_url(location).unwrap(),
            offset: 0,
            length: 8,
            checksum: None,
        };
        let (second, chunk) = (ChunkIndices(vec![0, 0, 1]), ChunkPayload::Virtual(chunk));
        let set = session.set_chunk_ref(path, second, Some(chunk));
        set.await.unwrap();
        session.commit("elsewhere").execute().await.unwrap();
    }

    /// Gives it another configuration.
    async fn configure(&self, config: &impl serde::Serialize) {
        let inner = &self.repository.inner;
        let version = inner.spec_version();
        let update = |info: Arc<RepoInfo>, backup: &str, _version| {
            Ok(Arc::new(
                info.set_config(version, config, backup, 100).unwrap(),
            ))
        };
        let retries = inner.config().repo_update_retries();
        let update = inner.asset_manager().update_repo_info(retries, update);
        update.await.unwrap();
    }

    /// Its one step, with a value for each of its chunks.
    async fn put(&self, west: f32, east: f32) {
        let of = |cell: usize| {
            let is_west = ((cell % GRID.cols as usize) as u64) < SECOND;
            if is_west { west } else { east }
        };
        let values: Arc<[f32]> = (0..GRID.cell_count()).map(of).collect();
        let mut edit = Edit::begin(&self.repository).await.unwrap();
        edit.put(Period::month(2000, 1).unwrap(), values)
            .await
            .unwrap();
        edit.commit("a step").await.unwrap();
    }

    fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("p")
    }

    async fn open(&self) -> Result<Foreign, ForeignError> {
        let objects = Arc::new(StoredObjects::open(self.path().to_str().unwrap())?);
        let found = Found {
            kind: StoreKind::Icechunk,
            snapshot: None,
        };
        Foreign::open(objects, found, None).await
    }

    async fn state(&self) -> String {
        self.open().await.unwrap().found.snapshot.unwrap()
    }
}

fn variable() -> String {
    cf::variable(QUANTITY)
}

/// Columns of the step.
fn part(cols: Range<u64>) -> [Range<u64>; 3] {
    [0..1, 0..u64::from(GRID.rows), cols]
}

#[tokio::test]
async fn what_changed_since_a_state_is_told_chunk_by_chunk() {
    let other = Other::new().await;
    let before = other.state().await;
    other.replace_second().await;
    let now = other.open().await.unwrap();
    let changed = now.changed_since(&before, &variable()).await.unwrap();
    let is_unchanged = |cols: Range<u64>| {
        now.is_unchanged(&variable(), &part(cols), &changed)
            .unwrap()
    };
    assert!(is_unchanged(0..SECOND), "only the second chunk is another");
    assert!(!is_unchanged(SECOND..615) && !is_unchanged(0..615));
    assert!(!is_unchanged(0..SECOND + 1), "one column of it is enough");
    // Of another array nothing is said by these chunks.
    let of_other = now.changed_since(&before, "lat").await.unwrap();
    let whole = now.is_unchanged(&variable(), &part(0..615), &of_other);
    assert!(whole.unwrap());
    let east = read(&other, SECOND).await.unwrap();
    assert_eq!(east[0].to_bits(), 290f64.to_bits());
    let own = now.found.snapshot.clone().unwrap();
    let none = now.changed_since(&own, &variable()).await.unwrap();
    assert!(now.is_unchanged(&variable(), &part(0..615), &none).unwrap());
    let array = variable();
    let unknown = now.changed_since("VY76P925PRY57WFEK410", &array).await;
    assert!(unknown.is_none());
}

#[tokio::test]
async fn an_array_that_was_made_anew_has_nothing_in_common_with_the_one_before() {
    let other = Other::new().await;
    let before = other.state().await;
    let session = other.repository.session().await.unwrap();
    let mut session = session.write().await;
    let path = Path::new(&format!("/{}", variable())).unwrap();
    let node = session.get_array(&path).await.unwrap();
    let NodeData::Array {
        shape,
        dimension_names,
        ..
    } = node.node_data
    else {
        panic!("it is an array")
    };
    session.delete_array(path.clone()).await.unwrap();
    let made = session.add_array(path, shape, dimension_names, node.user_data);
    made.await.unwrap();
    session
        .commit("the same, and empty")
        .execute()
        .await
        .unwrap();
    drop(session);
    let now = other.open().await.unwrap();
    assert!(now.changed_since(&before, &variable()).await.is_none());
    let values = now.read(&variable(), &part(0..1), Absent::Fill).await;
    assert!(values.unwrap().iter().all(|value| value.is_nan()));
    // Of others all is as it was.
    assert!(now.changed_since(&before, "lat").await.is_some());
}

/// Opens it and reads a column.
async fn read(other: &Other, col: u64) -> Result<Vec<f64>, ForeignError> {
    let opened = other.open().await?;
    let (variable, part) = (variable(), part(col..col + 1));
    opened.read(&variable, &part, Absent::Fill).await
}

fn files(folder: &FilePath) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut all: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    all.sort();
    all
}

#[tokio::test]
async fn a_flipped_bit_of_what_names_the_chunks_is_an_error() {
    let other = Other::new().await;
    assert_eq!(
        read(&other, 0).await.unwrap()[0].to_bits(),
        290f64.to_bits()
    );
    let now = other.open().await.unwrap().found.snapshot.unwrap();
    let path = other.path();
    for file in [path.join("repo"), path.join("snapshots").join(now)] {
        let whole = std::fs::read(&file).unwrap();
        for at in (0..whole.len()).step_by(whole.len() / 16) {
            let mut flipped = whole.clone();
            flipped[at] ^= 4;
            std::fs::write(&file, &flipped).unwrap();
            assert!(
                read(&other, 0).await.is_err(),
                "byte {at} of {}",
                file.display()
            );
        }
        std::fs::write(&file, &whole).unwrap();
    }
    // All manifests: those of this state are among them.
    let manifests = files(&path.join("manifests"));
    assert!(!manifests.is_empty());
    let mut wholes = vec![];
    for file in &manifests {
        let whole = std::fs::read(file).unwrap();
        let mut flipped = whole.clone();
        *flipped.last_mut().unwrap() ^= 4;
        std::fs::write(file, &flipped).unwrap();
        wholes.push(whole);
    }
    let error = read(&other, 0).await.unwrap_err();
    assert!(error.to_string().contains("damaged"), "{error}");
    for (file, whole) in manifests.iter().zip(wholes) {
        std::fs::write(file, whole).unwrap();
    }
    assert!(read(&other, 0).await.is_ok());
}

/// The library is never asked for what lies elsewhere, and says nothing of it: the reader does.
#[tokio::test]
async fn a_virtual_chunk_is_refused_with_where_it_lies_and_all_others_are_read() {
    let other = Other::new().await;
    let mut config = RepositoryConfig::default();
    let container = VirtualChunkContainer::new(
        "s3://theirs/".to_owned(),
        ObjectStoreConfig::S3(icechunk::config::S3Options::default()),
    );
    config
        .set_virtual_chunk_container(container.unwrap())
        .unwrap();
    other.configure(&config).await;
    for location in ["s3://theirs/sst.nc", "https://theirs.example/sst.nc"] {
        other
            .refer_second_to(&format!("{location}?signature=secret"))
            .await;
        let west = read(&other, 0).await.unwrap();
        assert_eq!(west[0].to_bits(), 290f64.to_bits());
        let error = read(&other, SECOND).await.unwrap_err().to_string();
        for part in [
            &format!("array {} chunk [0, 0, 1]", variable())[..],
            location,
            "virtual chunk",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert!(!error.contains("secret"), "{error}");
    }
}

/// What the library was built without here is needed by nobody who reads what lies in the repository.
#[tokio::test]
async fn a_repository_with_containers_of_other_kinds_is_read() {
    let other = Other::new().await;
    let before = other.state().await;
    for (prefix, kind) in [
        ("file:///theirs/", "local_file_system"),
        ("gcs://theirs/", "gcs"),
    ] {
        let container =
            serde_json::json!({"name": "theirs", "url_prefix": prefix, "store": {kind: {}}});
        let config = serde_json::json!({"virtual_chunk_containers": {prefix: container}});
        other.configure(&config).await;
        let store = Store::open(other.folder.path().to_str().unwrap()).unwrap();
        assert!(Repository::open(&store, "p").await.is_err(), "{prefix}");
        let west = read(&other, 0).await.unwrap();
        assert_eq!(west[0].to_bits(), 290f64.to_bits());
        assert_eq!(other.state().await, before);
    }
    // A state that is pinned, and one array alone.
    let objects = Arc::new(StoredObjects::open(other.path().to_str().unwrap()).unwrap());
    let found = Found {
        kind: StoreKind::Icechunk,
        snapshot: Some(before),
    };
    let one = Foreign::open_one(objects, found, &variable())
        .await
        .unwrap();
    let values = one.read(&variable(), &part(0..1), Absent::Refused).await;
    assert_eq!(values.unwrap()[0].to_bits(), 290f64.to_bits());
}

/// Repositories of version 1 have it in an object of its own.
#[tokio::test]
async fn the_configuration_of_a_repository_of_version_1_is_never_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = "virtual_chunk_containers: {theirs: {url_prefix: 'file:///theirs/', store: {local_file_system: /theirs}}}";
    std::fs::write(folder.path().join("config.yaml"), text).unwrap();
    let objects = StoredObjects::open(folder.path().to_str().unwrap()).unwrap();
    let storage = Arc::new(ReadOnly(Arc::new(objects)));
    let settings = Settings::default();
    let assets = AssetManager::new_no_cache(storage, settings, SpecVersionBin::V1, 1, 16);
    assert!(assets.fetch_config().await.unwrap().is_none());
}

/// A group of a latitude and its bounds, each with a document of its own.
#[derive(Debug)]
struct Latitudes {
    /// An object that does not answer.
    silent: Option<&'static str>,
}

#[async_trait]
impl Objects for Latitudes {
    fn place(&self) -> String {
        "latitudes".to_owned()
    }

    async fn get(
        &self,
        name: &str,
        _part: Option<GetRange>,
        _most_bytes: u64,
    ) -> Result<Option<Bytes>, ForeignError> {
        if self.silent == Some(name) {
            return Err(ForeignError::away(name, "does not answer"));
        }
        let array = |shape: &[u64]| {
            json!({
                "zarr_format": 3,
                "node_type": "array",
                "shape": shape,
                "data_type": "float64",
                "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shape}},
                "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
                "fill_value": 0.0,
                "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
                "attributes": {},
            })
        };
        let document = match name {
            "zarr.json" => json!({"zarr_format": 3, "node_type": "group", "attributes": {}}),
            "lat/zarr.json" => array(&[4]),
            "lat_bnds/zarr.json" => array(&[4, 2]),
            _ => return Ok(None),
        };
        Ok(Some(document.to_string().into()))
    }

    async fn size(&self, _name: &str) -> Result<Option<u64>, ForeignError> {
        Ok(None)
    }

    async fn folders(&self, _folder: &str) -> Result<Option<Vec<String>>, ForeignError> {
        Ok(Some(vec!["lat".to_owned(), "lat_bnds".to_owned()]))
    }
}

#[tokio::test]
async fn an_array_that_does_not_answer_is_not_one_that_is_not_there() {
    let open = async |silent| {
        let found = Found {
            kind: StoreKind::Zarr3,
            snapshot: None,
        };
        Foreign::open(Arc::new(Latitudes { silent }), found, None).await
    };
    assert_eq!(open(None).await.unwrap().arrays().count(), 2);
    let error = open(Some("lat_bnds/zarr.json")).await.err().unwrap();
    assert!(error.is_retryable(), "{error}");
    assert!(error.to_string().contains("array lat_bnds"), "{error}");
}
