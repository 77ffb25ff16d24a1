//! What a question about one degree reads of a global product of a quarter of a degree: little more than the chunks that it touches.

use std::ops::Range;
use std::sync::Arc;

use compute::Engine;
use compute::reduce::statistics;
use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use cube::{BLOCK_CELLS, RUN_STEPS};
use object_store::ObjectStore;
use storage::Store;

use crate::fixture::{ask, folder_store, land_each, parts, product, total};
use crate::reading::{Counting, random_flux};
use crate::statistics::{area, asked};

const GRID: Grid = Grid {
    rows: 720,
    cols: 1440,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.25,
    dlon_deg: 0.25,
};
/// Most bytes that are read, beside those of the chunks that are touched.
const MOST: f64 = 2.0;
/// Boxes of one degree, and how many chunks of fields and blocks along time each touches: inside of one, and across corners.
const BOXES: [(&str, u64, u64); 2] = [("40.2,20.6,41.2,21.6", 1, 2), ("29.5,14.5,30.5,15.5", 4, 4)];
const VALUE_BYTES: u64 = 4;

/// Days of noise, which does not compress, in some rows and columns and no data anywhere else.
fn noise(
    days: usize,
    rows: Range<u32>,
    cols: Range<u32>,
) -> impl Iterator<Item = (Period, Vec<f32>)> {
    let mut next = random_flux();
    let day = |at: usize| TimeMs::new(at as i64 * 86_400_000).unwrap();
    let is_inside =
        move |cell: u32| rows.contains(&(cell / GRID.cols)) && cols.contains(&(cell % GRID.cols));
    (0..days).map(move |at| {
        let value = |cell: u32| {
            if is_inside(cell) { next() } else { f32::NAN }
        };
        let values = (0..GRID.cell_count() as u32).map(value).collect();
        (Period::new(day(at), day(at + 1)).unwrap(), values)
    })
}

/// The store with its requests for a folder counted.
fn counted(store: &Store, folder: &'static str) -> (Store, Arc<Counting>) {
    let counting = Arc::new(Counting::under(store.object_store(), folder));
    let own = Arc::clone(&counting);
    let through = move |_objects| Arc::clone(&own) as Arc<dyn ObjectStore>;
    (store.through(through), counting)
}

#[tokio::test(flavor = "multi_thread")]
async fn of_fields_a_degree_reads_no_more_than_twice_its_chunks() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("noise"), Quantity::CarbonFlux);
    let steps = noise(3, 0..GRID.rows, 0..GRID.cols);
    let manifest = land_each(&store, &id, flux, GRID, steps).await;
    let mut file_bytes = 0;
    for step in &manifest.steps {
        file_bytes += store.size_bytes(&step.field).await.unwrap();
    }
    let chunk_count = u64::from(GRID.rows / CHUNK_ROWS * (GRID.cols / CHUNK_COLS));
    for (degree, chunks, _blocks) in BOXES {
        let touched = file_bytes * chunks / chunk_count;
        for question in ["budget", "statistics"] {
            let (root, inner) = store.sql_root();
            let counting = Arc::new(Counting::of(inner));
            let objects =
                compute::Objects::new(root, Arc::clone(&counting) as Arc<dyn ObjectStore>);
            let engine = Engine::in_process(store.clone(), parts(1)).reading(objects);
            if question == "budget" {
                ask(&engine, &total(&id, degree)).await;
            } else {
                statistics(&engine, &of(degree)).await.unwrap();
            }
            let share = counting.bytes() as f64 / touched as f64;
            eprintln!("{question} of {degree}: {share:.2} of {touched} bytes in {chunks} chunks");
            assert!(
                (1.0..MOST).contains(&share),
                "{question} of {degree}: {share}"
            );
        }
    }
}

fn of(degree: &str) -> contract::statistics::StatisticsQuery {
    let query = asked(area(degree), "mean,std,max,coverage", TimeStep::Total);
    contract::statistics::StatisticsQuery {
        product: product("noise"),
        ..query
    }
}

/// A cube of some days of noise where the boxes are.
async fn landed(days: usize) -> (tempfile::TempDir, Store, Manifest) {
    let (folder, store) = folder_store();
    let steps = noise(days, 240..360, 780..960);
    let manifest = land_each(&store, &product("noise"), Quantity::CarbonFlux, GRID, steps).await;
    cube::follow(&store, &manifest).await.unwrap();
    (folder, store, manifest)
}

#[tokio::test(flavor = "multi_thread")]
async fn of_a_cube_by_maps_a_degree_reads_no_more_than_twice_its_chunks() {
    let (_folder, store, manifest) = landed(4).await;
    let (counted, counting) = counted(&store, "cubes/");
    let values = cube::Values::of(&counted, &Arc::new(manifest))
        .await
        .unwrap();
    let opened = counting.bytes();
    // The four corners of the box lie in one chunk of 360 x 480 cells.
    let blocks = [[34, 110], [34, 111]];
    values.blocks(&blocks, 0..4).await.unwrap();
    let read = counting.bytes() - opened;
    let mut chunks = 0;
    for key in store.list("cubes/noise/chunks").await.unwrap() {
        chunks += store.size_bytes(&key).await.unwrap();
    }
    eprintln!("by maps: {read} of {chunks} bytes in chunks; {opened} to open it");
    assert!(read > 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn of_the_time_major_copy_a_degree_reads_no_more_than_twice_its_blocks() {
    let (_folder, store, manifest) = landed(RUN_STEPS).await;
    assert_eq!(cube::compact(&store, "cubes/noise").await.unwrap(), 1);
    let block_bytes = u64::from(BLOCK_CELLS * BLOCK_CELLS) * RUN_STEPS as u64 * VALUE_BYTES;
    for (degree, _chunks, blocks) in BOXES {
        let (counted, counting) = counted(&store, "cubes/");
        let engine = Engine::in_process(counted, parts(1));
        engine.values(&manifest, &manifest.id()).await.unwrap();
        let opened = counting.bytes();
        statistics(&engine, &of(degree)).await.unwrap();
        let read = counting.bytes() - opened;
        eprintln!("along time, {degree}: {read} of {blocks} x {block_bytes}; {opened} to open it");
        let touched = blocks * block_bytes;
        assert!(read > touched / 2 && read as f64 <= MOST * touched as f64);
    }
}
