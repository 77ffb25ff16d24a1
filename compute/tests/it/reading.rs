//! What sums over a region read of the store: the chunks of the region.

use std::fmt::{Display, Formatter};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use async_trait::async_trait;
use bytes::Bytes;
use compute::budget::chunk::{mass_steps, valid_area_steps};
use compute::budget::fixed::{MASS_DECIMALS, decimal_text};
use compute::region::weights;
use compute::{Engine, Objects};
use contract::chunk::field_chunks;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::Period;
use futures::stream::BoxStream;
use object_store::path::Path;
use object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use storage::{Store, fields};

use crate::fixture::{ask, folder_store, land, months, parts, product, total};

/// A regional product, 8 x 6 chunks.
const GRID: Grid = Grid {
    rows: 450,
    cols: 615,
    north_deg: 41.0,
    west_deg: 100.0,
    dlat_deg: 41.0 / 450.0,
    dlon_deg: 30.0 / 615.0,
};

/// A store that counts the requests for objects of a folder, and the bytes that it hands out of them.
#[derive(Debug)]
pub(crate) struct Counting {
    inner: Arc<dyn ObjectStore>,
    folder: &'static str,
    bytes: AtomicU64,
    requests: AtomicU64,
    most: AtomicU64,
}

impl Counting {
    /// Counts those for fields.
    pub(crate) fn of(inner: Arc<dyn ObjectStore>) -> Self {
        Self::under(inner, "frames/")
    }

    pub(crate) fn under(inner: Arc<dyn ObjectStore>, folder: &'static str) -> Self {
        Self {
            inner,
            folder,
            bytes: AtomicU64::new(0),
            requests: AtomicU64::new(0),
            most: AtomicU64::new(0),
        }
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    pub(crate) fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed)
    }

    /// Bytes of the largest request.
    pub(crate) fn most_bytes(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }

    fn count(&self, at: &Path, bytes: u64) {
        if at.as_ref().contains(self.folder) {
            self.most.fetch_max(bytes, Ordering::Relaxed);
            self.bytes.fetch_add(bytes, Ordering::Relaxed);
            self.requests.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Display for Counting {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("counting")
    }
}

#[async_trait]
impl ObjectStore for Counting {
    async fn put_opts(&self, at: &Path, what: PutPayload, o: PutOptions) -> Result<PutResult> {
        self.inner.put_opts(at, what, o).await
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        o: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(at, o).await
    }

    async fn get_opts(&self, at: &Path, o: GetOptions) -> Result<GetResult> {
        let is_head = o.head;
        let found = self.inner.get_opts(at, o).await?;
        let bytes = found.range.end - found.range.start;
        self.count(at, if is_head { 0 } else { bytes });
        Ok(found)
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        self.count(at, ranges.iter().map(|range| range.end - range.start).sum());
        self.inner.get_ranges(at, ranges).await
    }

    fn delete_stream(
        &self,
        at: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(at)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, o: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, o).await
    }
}

/// Numbers that do not compress, one in five of them no data, kg m⁻² s⁻¹.
pub(crate) fn random_flux() -> impl FnMut() -> f32 {
    let mut random = 1u64;
    move || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let share = (random >> 40) as f32 / (1u32 << 24) as f32;
        if share < 0.2 {
            f32::NAN
        } else {
            (share - 0.6) * 1e-8
        }
    }
}

/// Four months of noise with gaps.
fn noise() -> Vec<(Period, Vec<f32>)> {
    let mut next = random_flux();
    let mut months = months(2000);
    months.truncate(4);
    let step = |period| (period, (0..GRID.cell_count()).map(|_| next()).collect());
    months.into_iter().map(step).collect()
}

/// Most requests that a sum over a region of one chunk may need of a field.
const MOST_REQUESTS: f64 = 4.0;

async fn field_bytes(store: &Store, manifest: &Manifest) -> u64 {
    let mut bytes = 0;
    for step in &manifest.steps {
        bytes += store.size_bytes(&step.field).await.unwrap();
    }
    bytes
}

/// What a budget of a region asks of the fields.
#[derive(Debug)]
struct Read {
    /// Share of their bytes.
    share: f64,
    /// Requests a field.
    requests: f64,
}

async fn read(store: &Store, manifest: &Manifest, region: &str) -> Read {
    let (root, inner) = store.sql_root();
    let counting = Arc::new(Counting::of(inner));
    let objects = Objects::new(root, Arc::clone(&counting) as Arc<dyn ObjectStore>);
    // One task: the end of a file that two tasks share is read by both when they start at once.
    let engine = Engine::in_process(store.clone(), parts(1)).reading(objects);
    ask(&engine, &total(&manifest.product, region)).await;
    Read {
        share: counting.bytes() as f64 / field_bytes(store, manifest).await as f64,
        requests: counting.requests() as f64 / manifest.steps.len() as f64,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_small_box_reads_its_chunks_and_no_others() {
    let (_folder, store) = folder_store();
    let flux = Quantity::CarbonFlux;
    let manifest = land(&store, &product("noise"), flux, GRID, &noise()).await;
    assert_eq!(field_chunks(&GRID).len(), 48);
    let share = |cells: f64| cells / GRID.cell_count() as f64;
    // One chunk, and the end of each file.
    let end = 0.03;
    let one = read(&store, &manifest, "110,20,111,21").await;
    let is_own =
        |share_read: f64, cells: f64| share_read > share(cells) && share_read < share(cells) + end;
    assert!(is_own(one.share, 7200.0), "{one:?}");
    // A row of six, the easternmost 15 columns wide.
    let row = read(&store, &manifest, "100,20,130,21").await;
    assert!(is_own(row.share, 60.0 * 615.0), "{row:?}");
    let all = read(&store, &manifest, "global").await;
    assert!(all.share > 0.95 && all.share < 1.1, "{all:?}");
    // Its size, its end with where its pages are, which chunks it has, their values: behind a network each takes
    // milliseconds.
    assert!(one.requests <= MOST_REQUESTS, "{one:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_remembered_of_the_end_of_a_field_is_not_believed_of_another_one_in_its_place() {
    let (_folder, store) = folder_store();
    let flux = Quantity::CarbonFlux;
    let manifest = land(&store, &product("noise"), flux, GRID, &noise()[..1]).await;
    let field = &manifest.steps[0].field;
    let engine = Engine::in_process(store.clone(), parts(2));
    let question = total(&manifest.product, "110,20,111,21");
    let right = ask(&engine, &question).await;
    let whole = store.get(field).await.unwrap();
    // The last bytes are the name of the format.
    let mut damaged = whole.to_vec();
    *damaged.last_mut().unwrap() ^= 1;
    store.put_over(field, damaged.into()).await.unwrap();
    // What it read before says where rows lie, and each of them is compared with its check.
    assert_eq!(ask(&engine, &question).await, right);
    let other = Engine::in_process(store.clone(), parts(2));
    let error = compute::budget(&other, &question).await.unwrap_err();
    assert!(error.to_string().contains(field.as_str()), "{error}");
    store.put_over(field, whole).await.unwrap();
    assert_eq!(ask(&engine, &question).await, right);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_sums_are_those_of_the_kernels_chunk_by_chunk() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("noise"), Quantity::CarbonFlux);
    let manifest = land(&store, &id, flux, GRID, &noise()[..1]).await;
    let region = "105.3,3.1,127.7,38.2";
    let weights = weights::compute(&GRID, &region.parse().unwrap(), Earth::Wgs84).unwrap();
    let step = &manifest.steps[0];
    let values = fields::read(&store, &step.field, &GRID).await.unwrap();
    let windows = field_chunks(&GRID);
    let (mut mass, mut area) = (0, 0);
    for (chunk, areas) in &weights {
        let cells = windows[*chunk as usize].cell_indices(&GRID);
        let values: Vec<f32> = cells.map(|index| values[index]).collect();
        mass += mass_steps(&values, areas, step.period.seconds()).unwrap();
        area += valid_area_steps(&values, areas).unwrap();
    }
    let answer = ask(&Engine::local(store), &total(&id, region)).await;
    assert_eq!(answer.rows[0].budget_kg, decimal_text(mass, MASS_DECIMALS));
    assert!((answer.rows[0].area_m2 / (area as f64 / 1e6) - 1.0).abs() < 1e-12);
}
