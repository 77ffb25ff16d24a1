//! Limits on memory: what a file unpacks to counts, and not what it weighs.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ingest::{Outcome, Progress, Settings, Stage};

use crate::fixture::{Place, SmallFile, settings, text};

const ROWS: usize = 1440;
const COLS: usize = 2880;
const CELLS: u64 = (ROWS * COLS) as u64;

/// A map of one value, packed to far less than a hundredth of its values.
fn write_compressible(path: &Path, month: u32) {
    let step = 180.0 / ROWS as f64;
    let file = SmallFile {
        lat: (0..ROWS).map(|i| 90.0 - (i as f64 + 0.5) * step).collect(),
        lon: (0..COLS)
            .map(|i| -180.0 + (i as f64 + 0.5) * step)
            .collect(),
        // A day of the month that is meant.
        time: vec![f64::from(month * 31 - 20)],
        values: vec![],
        ..SmallFile::new()
    }
    .write_axes(path);
    let dataset = file
        .new_dataset::<f32>()
        .chunk([1, ROWS / 4, COLS / 4])
        .shuffle()
        .deflate(9)
        .shape([1, ROWS, COLS])
        .create("fgco2")
        .unwrap();
    dataset.write_raw(&vec![3.5f32; ROWS * COLS]).unwrap();
    text(&dataset, "units", "g C m-2 month-1");
    let name = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
    text(&dataset, "standard_name", name);
    drop(dataset);
    file.close().unwrap();
}

/// Files in the order in which their maps were begun and stored.
#[derive(Default)]
struct Order(Mutex<Vec<(PathBuf, Stage)>>);

impl Progress for Order {
    fn stage(&self, file: &Path, stage: Stage, _step: usize, _steps: usize) {
        if matches!(stage, Stage::Decode | Stage::Put) {
            self.0.lock().unwrap().push((file.to_owned(), stage));
        }
    }

    fn done(&self, _outcome: &Outcome) {}
}

/// Lands two files that may go side by side as far as their number goes: was a map begun while another one was worked on?
async fn go_side_by_side(place: &Place, parallel_bytes: u64) -> bool {
    let files = vec![place.path("a.h5"), place.path("b.h5")];
    for (file, month) in files.iter().zip(1..) {
        write_compressible(file, month);
        let weight = std::fs::metadata(file).unwrap().len();
        assert!(weight * 100 < CELLS * 4, "{weight} bytes");
    }
    let settings = Settings {
        parallel_files: 2,
        parallel_bytes,
        ..settings()
    };
    let order = Order::default();
    let outcomes = place.land_as(settings, &files, &order).await.unwrap();
    assert!(
        outcomes.iter().all(|o| matches!(o, Outcome::Landed { .. })),
        "{outcomes:?}"
    );
    let told = order.0.into_inner().unwrap();
    assert_eq!(told.len(), 4);
    told.windows(2)
        .any(|pair| pair[0].1 == Stage::Decode && pair[0].0 != pair[1].0)
}

/// Together the two files weigh less than a thousandth of the limit; one map of theirs takes more than half of it.
#[tokio::test]
async fn files_that_unpack_to_more_than_the_limit_go_one_after_the_other() {
    assert!(!go_side_by_side(&Place::new(), CELLS * 40).await);
}

/// A limit that no file fits into lets each through alone.
#[tokio::test]
async fn files_larger_than_the_whole_limit_go_alone_and_end() {
    assert!(!go_side_by_side(&Place::new(), 1).await);
}
