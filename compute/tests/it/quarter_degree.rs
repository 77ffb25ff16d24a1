//! What a question about one degree reads of a global product of a quarter of a degree: no more than twice the chunks that it
//! touches.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use compute::Engine;
use compute::reduce::statistics;
use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use cube::RUN_STEPS;
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
/// A degree inside of one chunk of a field and one block along time.
const INSIDE: &str = "40.2,20.6,41.2,21.6";
const INSIDE_BLOCK: [[u32; 2]; 1] = [[34, 110]];
/// A degree across the corner of four chunks, and two blocks side by side.
const ACROSS: &str = "29.5,14.5,30.5,15.5";
const ACROSS_BLOCKS: [[u32; 2]; 2] = [[37, 104], [37, 105]];
/// Bytes that say where the blocks of a shard lie: 16 for each of 45 x 60, and their checksum.
const INDEX_BYTES: u64 = 45 * 60 * 16 + 4;
/// More than the cube's own lists of shards and of parts of levels have, which are read once.
const LIST_BYTES: u64 = 4 << 10;

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

/// The store with its requests for objects of a folder counted.
pub(crate) fn counted(store: &Store, folder: &'static str) -> (Store, Arc<Counting>) {
    let made = Mutex::new(vec![]);
    let counted = store.through(|objects| {
        let counting = Arc::new(Counting::under(objects, folder));
        made.lock().unwrap().push(Arc::clone(&counting));
        counting
    });
    // The first is of objects by their keys; the other, of those that SQL scans name, reads no cube.
    let first = made.into_inner().unwrap().swap_remove(0);
    (counted, first)
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
    for (degree, chunks) in [(INSIDE, 1), (ACROSS, 4)] {
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
async fn before_steps_lie_along_time_a_degree_reads_less_than_the_chunks_of_their_maps() {
    let (_folder, store, manifest) = landed(4).await;
    let (counted, counting) = counted(&store, "");
    let values = cube::Values::of(&counted, &Arc::new(manifest))
        .await
        .unwrap();
    let opened = counting.bytes();
    // The four corners of the box lie in one chunk of 360 x 480 cells of a map, and in one of a field.
    let blocks = [[34, 110], [34, 111]];
    values.blocks(&blocks, 0..4).await.unwrap();
    let read = counting.bytes() - opened;
    let mut chunks = 0;
    for key in store.list("cubes/noise/chunks").await.unwrap() {
        chunks += store.size_bytes(&key).await.unwrap();
    }
    eprintln!("{read} of {chunks} bytes in chunks of maps; {opened} to open it");
    assert!(read > 0 && read < chunks);
}

/// What the engine reads of the cube for a question about a degree, bytes, and what the blocks that it touches hold.
async fn read(
    engine: &Engine,
    manifest: &Manifest,
    counting: &Counting,
    degree: (&str, &[[u32; 2]]),
) -> (u64, u64) {
    let values = engine.values(manifest, &manifest.id()).await.unwrap();
    let before = counting.bytes();
    statistics(engine, &of(degree.0)).await.unwrap();
    let read = counting.bytes() - before;
    // Blocks that one question read are not read again for another one.
    let held = values.encoded(degree.1, 0..RUN_STEPS).await.unwrap();
    let stored_bytes = held.unwrap().stored_bytes() as u64;
    assert_eq!(counting.bytes() - before, read);
    (read, stored_bytes)
}

#[tokio::test(flavor = "multi_thread")]
async fn of_the_time_major_copy_a_degree_reads_its_blocks_and_once_where_they_lie() {
    let (_folder, store, manifest) = landed(RUN_STEPS).await;
    assert_eq!(cube::compact(&store, "cubes/noise").await.unwrap(), 1);
    let engine = || {
        // As another process opens it.
        let own = Store::open(store.url()).unwrap();
        let (counted, counting) = counted(&own, "cubes/");
        (Engine::in_process(counted, parts(1)), counting)
    };
    let (cold, counting) = engine();
    let across = (ACROSS, &ACROSS_BLOCKS[..]);
    let (first, blocks) = read(&cold, &manifest, &counting, across).await;
    eprintln!("along time, two blocks: {first} for {blocks}");
    let is_told = |first: u64, blocks: u64| {
        let told = first - blocks;
        (INDEX_BYTES..INDEX_BYTES + LIST_BYTES).contains(&told)
    };
    assert!(is_told(first, blocks), "{first} {blocks}");
    assert!(first as f64 <= MOST * blocks as f64);
    let (again, inside) = read(&cold, &manifest, &counting, (INSIDE, &INSIDE_BLOCK)).await;
    assert_eq!(again, inside);
    // A single block is less than what says where it lies: the first of a shard is dearer than the bound, and nothing else.
    let (cold, counting) = engine();
    let (first, inside) = read(&cold, &manifest, &counting, (INSIDE, &INSIDE_BLOCK)).await;
    eprintln!("along time, one block: {first} for {inside}");
    assert!(is_told(first, inside), "{first} {inside}");
}
