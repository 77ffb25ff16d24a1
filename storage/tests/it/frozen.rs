//! Stores as earlier versions of this program wrote them, kept in `tests/frozen` (its README says how): a folder a version
//! of the manifest, each read whole here and compared with what was put in. What other crates write into a store is read
//! there; `kinds` lists who reads what, and lets no kind of object be without.

mod jobs;
mod kinds;
mod made;
mod told;

use std::path::{Path, PathBuf};

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, OLDEST_MANIFEST_SCHEMA, SeriesSegment, Step};
use contract::manifest::{OLDEST_PAGED_SCHEMA, PAGED_SCHEMA, Page};
use contract::masked::MaskedCells;
use contract::notice::NoticeRun;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use storage::contributed::{self, Contributed};
use storage::pins::{self, Pinned};
use storage::{Store, document, domain, fields, manifests, verify, weights};

const ROWS: u32 = 61;
const COLS: u32 = 20;
const GRID: Grid = Grid {
    rows: ROWS,
    cols: COLS,
    north_deg: 61.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
/// No fixture is larger.
const MAX_BYTES: u64 = 16 << 10;

fn frozen(version: u32) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/frozen")
        .join(version.to_string())
}

/// Where what is written now is to be frozen, if that is asked for.
fn to_freeze() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("FLUXGLOBE_FREEZE")?);
    std::fs::create_dir_all(&folder).unwrap();
    Some(folder)
}

/// A copy of a frozen store: nothing here may change the one that is kept.
fn copy(version: u32) -> (tempfile::TempDir, Store) {
    let folder = copy_of(version, "objects");
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

/// A copy of a part of what is frozen of a version.
fn copy_of(version: u32, part: &str) -> tempfile::TempDir {
    fn copy_all(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            let to = to.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                copy_all(&entry.path(), &to);
            } else {
                assert!(entry.metadata().unwrap().len() <= MAX_BYTES, "{entry:?}");
                std::fs::copy(entry.path(), to).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    copy_all(&frozen(version).join(part), folder.path());
    folder
}

/// What the file that the frozen product came from holds, g C m⁻² a month.
fn grams(month: u32, row: u32, col: u32) -> Option<f32> {
    let is_gap = (row + col).is_multiple_of(11) || (month, row, col) == (1, 60, 7);
    let value = row as f32 - 30.0 + 2.0 * month as f32 + (col % 4) as f32 * 0.5;
    (!is_gap).then_some(value)
}

/// The same, kg m⁻² s⁻¹, `[row, col]`.
fn values(month: u32) -> (Period, Vec<f32>) {
    let period = Period::month(2001, month).unwrap();
    let value = |index: u32| match grams(month, index / COLS, index % COLS) {
        Some(grams) => (f64::from(grams) * 1e-3 / period.seconds()) as f32,
        None => f32::NAN,
    };
    (period, (0..ROWS * COLS).map(value).collect())
}

fn is_near(a: f32, b: f32) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-6 * b.abs()
}

fn product() -> ProductId {
    "fgco2".parse().unwrap()
}

#[tokio::test]
async fn every_frozen_object_is_what_its_name_or_its_seal_says() {
    for version in OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA {
        let (_folder, store) = copy(version);
        let keys = verify::keys(&store, None).await.unwrap();
        let report = verify::run(&store, &keys, &|_, _| ()).await.unwrap();
        assert_eq!(report.findings, [], "version {version}");
        // What was written before there were seals has none, and is read.
        assert_eq!(report.unsealed_count > 0, version == 1);
    }
}

#[tokio::test]
async fn frozen_products_hold_the_values_that_were_put_in() {
    for version in OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA {
        let (_folder, store) = copy(version);
        let manifest = manifests::latest(&store, &product()).await;
        let manifest = manifest.unwrap().unwrap();
        assert_eq!((manifest.schema, manifest.steps.len()), (version, 2));
        assert_eq!(manifest.grid, GRID);
        let cells = domain::read(&store, &manifest.domain).await.unwrap();
        for (month, step) in (1..).zip(&manifest.steps) {
            let (period, expected) = values(month);
            assert_eq!(step.period, period);
            let is_of_bytes = matches!(step.field.vouches(), Vouched::Bytes(_));
            assert_eq!(is_of_bytes, version == 1);
            let found = fields::read(&store, &step.field, &GRID).await.unwrap();
            for (index, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert!(
                    is_near(*found, *expected),
                    "{version}, month {month}, cell {index}"
                );
                assert!(expected.is_nan() || cells[index]);
            }
        }
        // Series are named by versions of then, and whole.
        let segment = &manifest.series[0];
        assert_eq!((segment.first_step, segment.steps), (0, 2));
        verify::sound(&store, &segment.series).await.unwrap();
    }
}

#[tokio::test]
async fn version_1_keeps_the_names_that_were_cited_and_its_fields_keep_theirs() {
    let (_folder, store) = copy(1);
    let id = "fgco2@1-72149538".parse().unwrap();
    let manifest = manifests::load(&store, &id).await.unwrap();
    for step in &manifest.steps {
        let values = fields::read(&store, &step.field, &GRID).await.unwrap();
        let named_now = fields::write(&store, &product(), &GRID, &values, step.period).await;
        let named_now = named_now.unwrap();
        assert_ne!(named_now, step.field);
        let settled = fields::settle(&store, &step.field, &named_now, &GRID).await;
        assert_eq!(
            settled.unwrap(),
            step.field,
            "the same values are no revision"
        );
    }
}

/// The series that a version named when there were any.
const SERIES: &str =
    "series/fgco2/v2-824ffb3aefcdee2cde255e535bc04ff4c108285b52efa9c7a5fb8c5c8c359300.parquet";

/// Writes the objects of version 2.
async fn write(store: &Store) -> Manifest {
    let raw = "a file that nobody keeps";
    let raw_sha256 = Digest::of(raw.as_bytes());
    let key = ObjectKey::raw(&product(), &raw_sha256);
    store.put_new(&key, raw.into()).await.unwrap();
    let mut steps = vec![];
    let mut cells = vec![false; GRID.cell_count()];
    let months = [values(1), values(2)];
    for (period, values) in &months {
        for (cell, value) in cells.iter_mut().zip(values) {
            *cell |= !value.is_nan();
        }
        let field = fields::write(store, &product(), &GRID, values, *period).await;
        steps.push(Step {
            period: *period,
            field: field.unwrap(),
            raw_sha256,
            origin: "frozen-flux.nc".to_owned(),
            valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
            contributed: None,
            masked: None,
        });
    }
    let areas = [(0, vec![0.1; 60 * 20]), (1, vec![2.0 / 3.0; 20])];
    let job = ObjectKey::weights(&Digest::of(b"a region"));
    weights::write(store, &job, &areas).await.unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product: product(),
        number: 1,
        title: "Frozen flux".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "made by a test".to_owned(),
        grid: GRID,
        steps,
        domain: domain_of_then(store, &cells).await,
        series: vec![SeriesSegment {
            first_step: 0,
            steps: 2,
            series: SERIES.parse().unwrap(),
        }],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    };
    manifests::commit(store, &manifest).await.unwrap();
    let because = Some(BECAUSE.to_owned());
    let pinned = pins::pin(store, &manifest, because, pinned_at()).await;
    // Over what is frozen by the commands before, it was.
    assert!(!matches!(pinned.unwrap(), Pinned::Not(_)));
    contributed::write(store, &product(), &GRID, &counts())
        .await
        .unwrap();
    let manifest = revised(manifest);
    manifests::commit(store, &manifest).await.unwrap();
    manifest
}

/// Stores a domain as it was stored when version 2 was frozen: a byte a cell.
async fn domain_of_then(store: &Store, cells: &[bool]) -> ObjectKey {
    let bytes: Vec<u8> = cells.iter().map(|&cell| u8::from(cell)).collect();
    let key = ObjectKey::domain(&product(), &Digest::of(&bytes));
    store.put_new(&key, bytes.into()).await.unwrap();
    key
}

/// Why the first version is kept.
const BECAUSE: &str = "Table 2 of a paper that nobody wrote";

/// When it was pinned.
fn pinned_at() -> TimeMs {
    "2001-03-03T00:00:00Z".parse().unwrap()
}

/// The next version, with all that a version may say.
fn revised(first: Manifest) -> Manifest {
    let given = ["2001-03-01T00:00:00.007Z/3/17/1", "2001-03-02/0/18/0"];
    let orders = given.map(|order| order.parse().ok());
    let mut next = Manifest {
        number: 2,
        notices: NoticeRun::of(&orders),
        ..first
    };
    next.steps[0].masked = Some(MaskedCells {
        out_of_range: 3,
        poor_quality: 0,
        implausible: 7,
    });
    next.steps[1].masked = Some(MaskedCells::default());
    next
}

/// What both months together hold.
fn counts() -> Contributed {
    let [january, february] = [values(1), values(2)];
    let mut counts = Contributed::nothing(&GRID, january.0.start);
    for (period, values) in [january, february] {
        let has_data: Vec<bool> = values.iter().map(|value| !value.is_nan()).collect();
        counts.add(period, &has_data);
    }
    counts
}

/// The objects of a store that this crate alone writes.
async fn own(store: &Store) -> Vec<ObjectKey> {
    let mut keys = vec![];
    for kind in [
        Kind::Raw,
        Kind::Field,
        Kind::Domain,
        Kind::Contributed,
        Kind::Manifest,
        Kind::Newest,
        Kind::Pin,
    ] {
        let folder = format!("{}/{}", kind.folder(), product());
        keys.extend(store.list(&folder).await.unwrap());
    }
    keys
}

/// Names, schemas and what they hold: a change of any of them is a new version.
#[tokio::test]
async fn what_is_written_now_is_named_as_in_the_newest_frozen_store() {
    if let Some(folder) = to_freeze() {
        let objects = folder.join("objects");
        write(&Store::open(objects.to_str().unwrap()).unwrap()).await;
    }
    let (_folder, kept) = copy(MANIFEST_SCHEMA);
    let now = Store::memory();
    let manifest = write(&now).await;
    let newest = manifests::latest(&kept, &product()).await.unwrap();
    assert_eq!(newest.unwrap(), manifest);
    assert_eq!(own(&kept).await, own(&now).await);
    let pinned = pins::all(&kept).await.unwrap();
    assert_eq!(pinned, pins::all(&now).await.unwrap());
    let job = ObjectKey::weights(&Digest::of(b"a region"));
    let both = (
        weights::read(&kept, &job).await.unwrap(),
        weights::read(&now, &job).await.unwrap(),
    );
    assert_eq!(both.0, both.1);
    assert_eq!(
        weights::LAYOUT,
        MANIFEST_SCHEMA,
        "freeze weights of the new layout too"
    );
}

#[tokio::test]
async fn a_frozen_domain_is_the_one_that_is_written_now_of_the_cells_of_before() {
    let (_folder, before) = copy(2);
    let manifest = manifests::latest(&before, &product()).await;
    let key = manifest.unwrap().unwrap().domain;
    let bytes = before.get(&key).await.unwrap();
    assert_eq!(bytes.len(), GRID.cell_count(), "a byte a cell");
    let cells = domain::read(&before, &key).await.unwrap();
    if let Some(folder) = to_freeze() {
        let store = Store::open(folder.join("domains").to_str().unwrap()).unwrap();
        domain::write(&store, &product(), &cells).await.unwrap();
    }
    let folder = copy_of(2, "domains");
    let kept = Store::open(folder.path().to_str().unwrap()).unwrap();
    let keys = kept.list("domain/fgco2").await.unwrap();
    assert_eq!(domain::read(&kept, &keys[0]).await.unwrap(), cells);
    let now = domain::write(&Store::memory(), &product(), &cells).await;
    assert_eq!(keys, [now.unwrap()]);
}

#[tokio::test]
async fn a_frozen_version_says_what_was_masked_and_in_which_order_files_came() {
    let (_folder, store) = copy(2);
    let id = product();
    let [first, second] = [1, 2].map(|number| manifests::numbered(&store, &id, number));
    let (first, second) = (
        first.await.unwrap().unwrap(),
        second.await.unwrap().unwrap(),
    );
    assert_eq!(
        (first.masked().1, first.notice_orders()),
        (2, vec![None; 2])
    );
    let (masked, uncounted) = second.masked();
    assert_eq!((masked.out_of_range, masked.implausible), (3, 7));
    assert_eq!((masked.total(), uncounted), (10, 0));
    let orders: Vec<_> = second.notice_orders().into_iter().flatten().collect();
    let at = "2001-03-01T00:00:00.007Z".parse().unwrap();
    assert_eq!(
        (orders[0].given, orders[0].partition, orders[0].offset),
        (at, 3, 17)
    );
    assert!(orders[0].file == 1 && orders[0] < orders[1]);
}

#[tokio::test]
async fn a_frozen_page_holds_the_steps_of_its_manifest() {
    let (_folder, store) = copy(2);
    let keys = store.list("manifest-pages/fgco2").await.unwrap();
    let manifest = manifests::numbered(&store, &product(), 2).await.unwrap();
    let manifest = manifest.unwrap();
    let mut schemas = vec![];
    for key in keys {
        let page: Page = document::get(&store, &key).await.unwrap().unwrap();
        assert_eq!(key, ObjectKey::manifest_page(&product(), &page.name()));
        assert_eq!(page.steps, manifest.steps);
        assert_eq!(page.notices, manifest.notices);
        schemas.push(page.schema);
    }
    schemas.sort_unstable();
    let all: Vec<u32> = (OLDEST_PAGED_SCHEMA..=PAGED_SCHEMA).collect();
    assert_eq!(schemas, all, "freeze a page of each");
}

#[tokio::test]
async fn a_frozen_pin_says_which_version_is_kept_and_why() {
    let (_folder, store) = copy(2);
    let all = pins::all(&store).await.unwrap();
    let [pin] = &all[..] else {
        panic!("one is frozen")
    };
    assert_eq!(pin.version.to_string(), "fgco2@1-429db3bf");
    assert_eq!(pin.because.as_deref(), Some(BECAUSE));
    assert_eq!(pin.since, pinned_at());
    // The version is there, by the name that it was pinned under.
    assert_eq!(pins::lacking(&store, &pin.version).await.unwrap(), None);
}

#[tokio::test]
async fn a_frozen_hint_leads_to_the_newest_version() {
    let (_folder, store) = copy(2);
    let (counted, traffic) = store.counted();
    let newest = manifests::latest(&counted, &product()).await.unwrap();
    assert_eq!(newest.unwrap().number, 2);
    assert_eq!(traffic.counts().lists, 0, "nobody read the hint");
}

#[tokio::test]
async fn frozen_counts_are_the_numbers_that_were_put_in() {
    let (_folder, store) = copy(2);
    let keys = store.list("contributed/fgco2").await.unwrap();
    let found = contributed::read(&store, &keys[0], &GRID).await.unwrap();
    assert_eq!((keys.len(), &found), (1, &counts()));
    // A cell without data in January, one without any, one with all.
    let at = |row: u32, col: u32| (row * COLS + col) as usize;
    let day_ms = 86_400_000;
    let hold = |cell: usize| (found.steps[cell], found.milliseconds[cell] / day_ms);
    assert_eq!(hold(at(60, 7)), (1, 28));
    assert_eq!((hold(at(5, 6)), hold(at(5, 7))), ((0, 0), (2, 59)));
    assert_eq!(
        (found.of_steps, found.period.seconds()),
        (2, 59.0 * 86_400.0)
    );
}
