//! Maps of stores of others that are read in bands of their chunks: the same steps as of maps in one band, and memory is that of
//! the bands.

use std::path::Path;
use std::process::Command;

use contract::manifest::Manifest;
use serde_json::json;
use storage::fields;

use crate::attached::{Own, copy, fixture, request};
use crate::bands::peak_bytes;

/// Cells of a map of more than a band.
const SMALL: [usize; 2] = [2900, 2900];
/// Stored numbers that stand for no data, and for what cannot be true.
const MISSING: u8 = 255;
const IMPLAUSIBLE: u8 = 254;

/// What a place holds, by row from the north: some of each kind in each band.
fn stored(row: usize, col: usize) -> u8 {
    match (row * 7919 + col * 31) % 10_007 {
        0..5 => MISSING,
        5..9 => IMPLAUSIBLE,
        n => (n % 200) as u8,
    }
}

/// What is stored, K. All but one can be true of the sea.
fn value(stored: u8) -> f64 {
    f64::from(stored) * 0.25 + 1.0 + 273.15
}

/// How a store has its map.
#[derive(Clone, Copy)]
struct Lies {
    chunk_rows: usize,
    south_first: bool,
    lon_first: bool,
}

fn numbers(path: &Path, name: &str, values: impl Iterator<Item = f64>) {
    let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
    let count = bytes.len() / size_of::<f64>();
    let array = json!({
        "zarr_format": 2, "shape": [count], "chunks": [count], "dtype": "<f8", "compressor": null,
        "fill_value": "NaN", "order": "C", "filters": null,
    });
    std::fs::write(path.join(name).join(".zarray"), array.to_string()).unwrap();
    std::fs::write(path.join(name).join("0"), bytes).unwrap();
}

/// Writes a store of one day of temperature, a byte a cell, without compression.
fn write(path: &Path, [rows, cols]: [usize; 2], lies: Lies) {
    copy(&fixture("v2-plain.zarr"), path);
    for step in 0..3 {
        std::fs::remove_file(path.join(format!("sst/{step}.0.0"))).unwrap();
    }
    for name in ["time", "time_bnds"] {
        let document = path.join(name).join(".zarray");
        let text = std::fs::read(&document).unwrap();
        let mut array: serde_json::Value = serde_json::from_slice(&text).unwrap();
        array["shape"][0] = json!(1);
        std::fs::write(document, array.to_string()).unwrap();
    }
    let degrees = 1.0 / 128.0;
    let row_of = |i: usize| if lies.south_first { rows - 1 - i } else { i };
    let lat = |i: usize| 60.0 - (row_of(i) as f64 + 0.5) * degrees;
    numbers(path, "lat", (0..rows).map(lat));
    let lon = |i: usize| -120.0 + (i as f64 + 0.5) * degrees;
    numbers(path, "lon", (0..cols).map(lon));
    let (shape, chunks, dimensions) = if lies.lon_first {
        let names = ["time", "lon", "lat"];
        ([1, cols, rows], [1, cols, lies.chunk_rows], names)
    } else {
        let names = ["time", "lat", "lon"];
        ([1, rows, cols], [1, lies.chunk_rows, cols], names)
    };
    let array = json!({
        "zarr_format": 2, "shape": shape, "chunks": chunks, "dtype": "|u1", "compressor": null,
        "fill_value": MISSING, "order": "C", "filters": null,
    });
    std::fs::write(path.join("sst/.zarray"), array.to_string()).unwrap();
    let attributes = json!({
        "_ARRAY_DIMENSIONS": dimensions, "standard_name": "sea_surface_temperature",
        "units": "degC", "scale_factor": 0.25, "add_offset": 1.0, "_FillValue": MISSING,
    });
    std::fs::write(path.join("sst/.zattrs"), attributes.to_string()).unwrap();
    for (number, first) in (0..rows).step_by(lies.chunk_rows).enumerate() {
        // Chunks at the end are as large as others.
        let cell = |row: usize, col: usize| match first + row {
            row if row < rows => stored(row_of(row), col),
            _ => MISSING,
        };
        let count = lies.chunk_rows * cols;
        let (bytes, name): (Vec<u8>, _) = if lies.lon_first {
            let at = |i: usize| cell(i % lies.chunk_rows, i / lies.chunk_rows);
            ((0..count).map(at).collect(), format!("0.0.{number}"))
        } else {
            let at = |i: usize| cell(i / cols, i % cols);
            ((0..count).map(at).collect(), format!("0.{number}.0"))
        };
        std::fs::write(path.join("sst").join(name), bytes).unwrap();
    }
}

async fn attached(lies: Lies) -> (Own, Manifest) {
    let own = Own::new();
    write(&own.path(), SMALL, lies);
    own.attach().await.unwrap();
    let newest = own.newest().await;
    (own, newest)
}

#[tokio::test]
async fn maps_of_several_bands_are_those_of_one() {
    let usual = Lies {
        chunk_rows: SMALL[0],
        south_first: false,
        lon_first: false,
    };
    let (own, whole) = attached(usual).await;
    let step = &whole.steps[0];
    let cells = (0..SMALL[0] * SMALL[1]).map(|i| stored(i / SMALL[1], i % SMALL[1]));
    let valid = cells.filter(|stored| *stored < IMPLAUSIBLE).count() as u64;
    assert_eq!(step.valid_cells, valid);
    let values = own.values(&whole, 0).await.unwrap();
    for (row, col) in [(0, 0), (17, 2899), (1500, 1), (2899, 2899), (2796, 40)] {
        let (found, wanted) = (values[row * SMALL[1] + col], stored(row, col));
        assert!(
            found.is_nan() == (wanted >= IMPLAUSIBLE)
                && (found.is_nan() || (f64::from(found) - value(wanted)).abs() < 1e-4),
            "{row} {col}: {found}, stored {wanted}"
        );
    }
    // Chunks that divide the rows, and chunks that do not.
    for (chunk_rows, south_first, lon_first) in
        [(1000, false, false), (700, true, false), (61, true, true)]
    {
        let lies = Lies {
            chunk_rows,
            south_first,
            lon_first,
        };
        let (own, newest) = attached(lies).await;
        let found = &newest.steps[0];
        assert_eq!(found.field, step.field, "chunks of {chunk_rows} rows");
        assert_eq!(
            (found.valid_cells, found.masked),
            (step.valid_cells, step.masked)
        );
        assert_eq!(newest.domain, whole.domain);
        // The way back compares them with their name.
        assert!(own.values(&newest, 0).await.is_ok());
    }
}

/// Names the folder of the process that attaches a large map.
const INNER: &str = "FLUXGLOBE_TEST_ATTACHES_IN";
/// Cells of that map: 192 MB as they are stored, 384 MB as they come.
const LARGE: [usize; 2] = [6000, 8000];
/// What this process may take to attach it, and for a point of it.
const OWN_BYTES: u64 = 480 << 20;

/// Attaches the map of a folder and reads some rows of it, in a process that does nothing else, and fails if it takes too much.
async fn attach_large(folder: &str) {
    let (own, before) = (Own::new(), peak_bytes());
    own.ask(&request(folder, "sst")).await.unwrap();
    let newest = own.newest().await;
    let field = &newest.steps[0].field;
    let reader = fields::Reader::open(&own.store, field, Some(&newest.grid)).await;
    let rows = reader.unwrap().rows(3000..3060).await.unwrap();
    let wanted = value(stored(3000, 8));
    assert!((f64::from(rows[8]) - wanted).abs() < 1e-4, "{}", rows[8]);
    let taken = peak_bytes() - before;
    eprintln!("{} MiB were taken", taken >> 20);
    assert!(taken < OWN_BYTES, "{} MiB were taken", taken >> 20);
}

/// Runs itself in a process of its own, whose peak is that of this one map.
#[tokio::test]
async fn a_large_map_is_attached_and_read_within_the_memory_of_its_bands() {
    if let Some(folder) = std::env::var_os(INNER) {
        return attach_large(folder.to_str().unwrap()).await;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.zarr");
    let lies = Lies {
        chunk_rows: 100,
        south_first: false,
        lon_first: false,
    };
    write(&path, LARGE, lies);
    let name = "attached_bands::a_large_map_is_attached_and_read_within_the_memory_of_its_bands";
    let attached = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(INNER, &path)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&attached.stderr);
    assert!(attached.status.success(), "{said}");
    assert!(said.contains("MiB were taken"), "it did not run: {said}");
}
