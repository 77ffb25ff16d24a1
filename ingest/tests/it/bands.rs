//! Maps that are read, checked and encoded in bands of rows: what lands is the same, and memory is that of the bands.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use contract::event::RejectReason;
use contract::manifest::Manifest;
use ingest::{Outcome, Progress, Settings, Stage};
use storage::Store;

use crate::fixture::{FILL, Place, SmallFile, refusal, settings, text};
use crate::made::{Made, MadeFile, Says, Values};

/// Rows of three bands at the least, of 60 rows each, and columns of two chunks and a part.
const ROWS: usize = 150;
const COLS: usize = 250;

/// How a file has its map.
#[derive(Debug, Clone, Copy)]
struct Lie {
    south_first: bool,
    from_greenwich: bool,
    lon_first: bool,
}

const USUAL: Lie = Lie {
    south_first: false,
    from_greenwich: false,
    lon_first: false,
};

/// What a place holds, by row from the north and column from -180: gaps, and values beyond the valid range and beyond what can
/// be true, some in each band.
fn value(row: usize, col: usize) -> f32 {
    match (row * COLS + col) % 977 {
        0 => FILL,
        1 => 1e6,
        2 => 30_000.0,
        n => n as f32 / 50.0 - 2.0,
    }
}

/// A classic file of one day of temperature.
fn write(path: &Path, lie: Lie, value: impl Fn(usize, usize) -> f32) {
    let (dlat, dlon) = (180.0 / ROWS as f64, 360.0 / COLS as f64);
    let row_of = |i: usize| if lie.south_first { ROWS - 1 - i } else { i };
    let col_of = |i: usize| {
        if lie.from_greenwich {
            (i + COLS / 2) % COLS
        } else {
            i
        }
    };
    let west = if lie.from_greenwich { 0.0 } else { -180.0 };
    let lat = (0..ROWS).map(|i| 90.0 - (row_of(i) as f64 + 0.5) * dlat);
    let lon = (0..COLS).map(|i| west + (i as f64 + 0.5) * dlon);
    let values: Vec<f32> = if lie.lon_first {
        let at = |i: usize| value(row_of(i % ROWS), col_of(i / ROWS));
        (0..ROWS * COLS).map(at).collect()
    } else {
        let at = |i: usize| value(row_of(i / COLS), col_of(i % COLS));
        (0..ROWS * COLS).map(at).collect()
    };
    let axes: [&'static str; 3] = if lie.lon_first {
        ["time", "lon", "lat"]
    } else {
        ["time", "lat", "lon"]
    };
    let sst = Made::new("sst", &axes, Values::Floats(values))
        .text("standard_name", "sea_surface_temperature")
        .text("units", "degC")
        .says("_FillValue", Says::Floats(&[FILL]))
        .says("valid_max", Says::Floats(&[100_000.0]));
    let mut file = MadeFile::days(1)
        .text("time_coverage_resolution", "P1D")
        .numbers("lat", &lat.collect::<Vec<_>>())
        .numbers("lon", &lon.collect::<Vec<_>>())
        .with(sst);
    file.dimensions = vec![("time", 1), ("lat", ROWS), ("lon", COLS)];
    file.write(path);
}

fn in_bands_of(cells: u64) -> Settings {
    let mut settings = settings();
    settings.limits.band_cells = cells;
    settings
}

/// What a file becomes, its map worked on in bands of so many cells.
async fn landed(band_cells: u64, lie: Lie) -> (Manifest, bytes::Bytes) {
    let place = Place::new();
    let path = place.path("a.nc");
    write(&path, lie, value);
    let outcomes = place
        .land_as(in_bands_of(band_cells), &[path], &ingest::Quiet)
        .await
        .unwrap();
    let [Outcome::Landed { manifest, .. }] = &outcomes[..] else {
        panic!("{outcomes:?}");
    };
    let manifest = place.newest(manifest.product.as_str()).await;
    let field = place.store.get(&manifest.steps[0].field).await.unwrap();
    (manifest, field)
}

#[tokio::test]
async fn bands_of_any_size_and_files_of_any_direction_land_as_the_same_bytes() {
    let (whole, field) = landed(1 << 30, USUAL).await;
    let step = &whole.steps[0];
    let count = |wanted: fn(usize) -> bool| {
        let cells = (0..ROWS * COLS).filter(|i| wanted(i % 977));
        cells.count() as u64
    };
    let masked = step.masked.unwrap();
    assert_eq!(masked.out_of_range, count(|n| n == 1));
    assert_eq!(masked.implausible, count(|n| n == 2));
    assert_eq!(step.valid_cells, count(|n| n > 2));
    for bits in 0..8 {
        let lie = Lie {
            south_first: bits & 1 > 0,
            from_greenwich: bits & 2 > 0,
            lon_first: bits & 4 > 0,
        };
        for band_cells in [1, 2 * 60 * COLS as u64] {
            let (manifest, found) = landed(band_cells, lie).await;
            assert_eq!(manifest.grid, whole.grid, "{lie:?}");
            let own = &manifest.steps[0];
            assert_eq!(own.field, step.field, "{lie:?} in bands of {band_cells}");
            assert_eq!(
                (own.valid_cells, own.masked),
                (step.valid_cells, step.masked)
            );
            assert_eq!(manifest.domain, whole.domain);
            assert!(found == field, "{lie:?} in bands of {band_cells}");
        }
    }
}

#[tokio::test]
async fn what_is_implausible_is_judged_over_the_whole_map() {
    let place = Place::new();
    let path = place.path("a.nc");
    let mut landed = vec![];
    // All of a band, which is a fifth of the map; and two rows, which are much of a band and little of the map.
    for rows in [120, 148] {
        write(
            &path,
            USUAL,
            |row, _col| if row >= rows { 5e3 } else { 4.0 },
        );
        let files = [path.clone()];
        let outcomes = place.land_as(in_bands_of(1), &files, &ingest::Quiet).await;
        landed.extend(outcomes.unwrap());
    }
    let (reason, line) = refusal(&landed[..1]);
    assert_eq!(reason, RejectReason::Values, "{line}");
    let (wrong, all) = (30 * COLS, ROWS * COLS);
    assert!(line.contains(&format!("{wrong} of {all} values")), "{line}");
    assert!(matches!(landed[1], Outcome::Landed { .. }), "{landed:?}");
    let fields = place.store.list("frames").await.unwrap();
    assert_eq!(fields.len(), 1, "of what is refused nothing is stored");
}

#[tokio::test]
async fn a_band_without_a_value_before_the_first_is_of_the_field() {
    let place = Place::new();
    let path = place.path("a.nc");
    let south = |row: usize, _col: usize| if row < 130 { FILL } else { 4.0 };
    write(&path, USUAL, south);
    let outcomes = place.land_as(in_bands_of(1), &[path], &ingest::Quiet).await;
    let [Outcome::Landed { manifest, .. }] = &outcomes.unwrap()[..] else {
        panic!("it did not land");
    };
    let manifest = place.newest(manifest.product.as_str()).await;
    let values = place.values(&manifest, 0).await;
    assert_eq!(values.iter().filter(|v| !v.is_nan()).count(), 20 * COLS);
    assert!(values[130 * COLS - 1].is_nan() && !values[130 * COLS].is_nan());
}

#[tokio::test]
async fn files_that_end_or_are_damaged_in_the_middle_of_a_band_are_refused_and_nothing_of_them_stays()
 {
    let place = Place::new();
    let (short, damaged) = (place.path("short.nc"), place.path("damaged.h5"));
    write(&short, USUAL, value);
    let mut bytes = std::fs::read(&short).unwrap();
    bytes.truncate(bytes.len() - 40 * COLS * 4);
    std::fs::write(&short, bytes).unwrap();
    write_chunked(&damaged, ROWS, COLS, 10);
    let mut bytes = std::fs::read(&damaged).unwrap();
    // Most of the file is its chunks; the last rows lie at its end.
    let at = bytes.len() * 3 / 4;
    bytes[at..at + 64].fill(0x55);
    std::fs::write(&damaged, bytes).unwrap();
    for file in [short, damaged] {
        let files = [file];
        let outcomes = place.land_as(in_bands_of(1), &files, &ingest::Quiet).await;
        let (reason, line) = refusal(&outcomes.unwrap());
        assert_eq!(reason, RejectReason::Corrupt, "{line}");
    }
    assert_eq!(place.store.list("frames").await.unwrap(), []);
    assert_eq!(place.store.list("manifests").await.unwrap(), []);
}

#[tokio::test]
async fn more_cells_than_the_largest_grid_are_refused_before_they_are_read() {
    let place = Place::new();
    let path = place.path("a.h5");
    let file = SmallFile {
        lat: (0..1 << 16)
            .map(|i| 89.999 - f64::from(i) * 0.0027)
            .collect(),
        lon: (0..1 << 16)
            .map(|i| -179.997 + f64::from(i) * 0.0054)
            .collect(),
        time: vec![15.0],
        ..SmallFile::new()
    }
    .write_axes(&path);
    let dataset = file
        .new_dataset::<f32>()
        .chunk([1, 1024, 1024])
        .shape([1, 1 << 16, 1 << 16])
        .create("fgco2")
        .unwrap();
    text(&dataset, "units", "g C m-2 month-1");
    let name = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
    text(&dataset, "standard_name", name);
    drop(dataset);
    file.close().unwrap();
    let outcomes = place.land(&[path]).await;
    let (reason, line) = refusal(&outcomes);
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(
        line.contains("65536 x 65536") && line.contains("2147483648"),
        "{line}"
    );
}

/// A map of carbon flux in chunks of so many rows, written in parts.
fn write_chunked(path: &Path, rows: usize, cols: usize, chunk_rows: usize) {
    let (dlat, dlon) = (180.0 / rows as f64, 360.0 / cols as f64);
    let file = SmallFile {
        lat: (0..rows).map(|i| 90.0 - (i as f64 + 0.5) * dlat).collect(),
        lon: (0..cols)
            .map(|i| -180.0 + (i as f64 + 0.5) * dlon)
            .collect(),
        time: vec![15.0],
        values: vec![],
        ..SmallFile::new()
    }
    .write_axes(path);
    let dataset = file
        .new_dataset::<f32>()
        .chunk([1, chunk_rows, cols])
        .shuffle()
        .deflate(1)
        .shape([1, rows, cols])
        .create("fgco2")
        .unwrap();
    for first in (0..rows).step_by(chunk_rows) {
        let count = chunk_rows.min(rows - first);
        let value = |i: usize| (((first * cols + i) * 7919) % 10_007) as f32 / 1000.0;
        let values: Vec<f32> = (0..count * cols).map(value).collect();
        let part = ndarray::ArrayView2::from_shape((count, cols), &values).unwrap();
        dataset
            .write_slice(part, (0, first..first + count, ..))
            .unwrap();
    }
    text(&dataset, "units", "g C m-2 month-1");
    let name = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
    text(&dataset, "standard_name", name);
    drop(dataset);
    file.close().unwrap();
}

/// Names the folder of the process that lands a large map.
const INNER: &str = "FLUXGLOBE_TEST_LANDS_IN";
/// Cells of that map, and of a band.
const LARGE: (usize, usize) = (4000, 8000);
const BAND_CELLS: u64 = 1 << 20;
/// What the reader may have: the map alone is 256 MB as it gives it out.
const READER_BYTES: u64 = 384 << 20;
/// What this process may take for it: the map alone is 128 MB as it is stored, and 768 MB while it is worked on.
const OWN_BYTES: u64 = 256 << 20;

/// Most memory that this process had so far, bytes.
pub(crate) fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:"));
    let kib = line.unwrap().split_whitespace().nth(1).unwrap();
    kib.parse::<u64>().unwrap() << 10
}

/// The peak when everything but the manifest was durable: that a cube follows is another matter.
#[derive(Default)]
struct Peak(Mutex<Option<u64>>);

impl Progress for Peak {
    fn stage(&self, _file: &Path, stage: Stage, _step: usize, _steps: usize) {
        if stage == Stage::Commit {
            *self.0.lock().unwrap() = Some(peak_bytes());
        }
    }

    fn done(&self, _outcome: &Outcome) {}
}

/// Lands the map of a folder, in a process that does nothing else, and fails if it takes too much.
async fn land_large(folder: PathBuf) {
    let place = Place {
        store: Store::open(folder.join("store").to_str().unwrap()).unwrap(),
        ..Place::new()
    };
    let mut settings = in_bands_of(BAND_CELLS);
    settings.limits.memory_bytes = READER_BYTES;
    settings.limits.cpu_s = 120;
    settings.spool.clone_from(&folder);
    let (peak, before) = (Peak::default(), peak_bytes());
    let files = [folder.join("large.h5")];
    let outcomes = place.land_as(settings, &files, &peak).await.unwrap();
    assert!(
        matches!(outcomes[0], Outcome::Landed { .. }),
        "{outcomes:?}"
    );
    let taken = peak.0.into_inner().unwrap().unwrap() - before;
    eprintln!("{} MiB were taken", taken >> 20);
    assert!(taken < OWN_BYTES, "{} MiB were taken", taken >> 20);
}

/// Runs itself in a process of its own, whose peak is that of this one map.
#[tokio::test]
async fn a_large_map_takes_the_memory_of_its_bands_here_and_in_its_reader() {
    if let Some(folder) = std::env::var_os(INNER) {
        return land_large(folder.into()).await;
    }
    let folder = tempfile::tempdir().unwrap();
    write_chunked(&folder.path().join("large.h5"), LARGE.0, LARGE.1, 100);
    let name = "bands::a_large_map_takes_the_memory_of_its_bands_here_and_in_its_reader";
    let landed = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(INNER, folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&landed.stderr);
    assert!(landed.status.success(), "{said}");
    assert!(said.contains("MiB were taken"), "it did not run: {said}");
    eprintln!("{}", said.lines().last().unwrap_or_default());
}
