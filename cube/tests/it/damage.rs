//! A bit flipped, or an object gone: an error that names array and chunk, and never a number.

use std::sync::Arc;

use bytes::Bytes;
use contract::chunk::Window;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use cube::{At, Cube, CubeError, Edit, Repository};
use object_store::ObjectStoreExt as _;
use storage::Store;

use crate::product::{bits, description, grid, month, values};

/// A cube of one step of a grid, and the keys of its values.
async fn cube_of(rows: u32, cols: u32) -> (Store, Vec<ObjectKey>) {
    let grid = grid(rows, cols);
    cube_with(grid, values(&grid, 1)).await
}

async fn cube_with(grid: Grid, values: Arc<[f32]>) -> (Store, Vec<ObjectKey>) {
    let store = Store::memory();
    let description = description(Quantity::CarbonFlux, grid);
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let before = store.list("p/chunks").await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    edit.put(month(1), values).await.unwrap();
    let after = store.list("p/chunks").await.unwrap();
    edit.commit("one").await.unwrap();
    let made = after.into_iter().filter(|key| !before.contains(key));
    (store, made.collect())
}

/// The objects of values among those of a step: those of its levels are smaller, all of them.
async fn largest(store: &Store, keys: Vec<ObjectKey>, count: usize) -> Vec<ObjectKey> {
    let mut sized = vec![];
    for key in keys {
        sized.push((store.size_bytes(&key).await.unwrap(), key));
    }
    sized.sort();
    assert!(sized.len() > count, "it has levels");
    let first = sized.len() - count;
    let mut keys: Vec<ObjectKey> = sized.drain(first..).map(|(_, key)| key).collect();
    keys.sort();
    keys
}

async fn open(store: &Store) -> Cube {
    let repository = Repository::open(store, "p").await.unwrap();
    repository.at(&At::Newest).await.unwrap()
}

#[tokio::test]
async fn no_flipped_bit_of_a_chunk_gives_a_number() {
    let (store, keys) = cube_of(20, 30).await;
    let [key] = &keys[..] else {
        panic!("{keys:?}");
    };
    let objects = store.object_store();
    let path = object_store::path::Path::from(key.as_str());
    let whole = objects.get(&path).await.unwrap().bytes().await.unwrap();
    let cell = Window {
        row: 3,
        col: 4,
        rows: 1,
        cols: 1,
    };
    let put = open(&store).await.window(0, cell).await.unwrap();
    for at in (0..whole.len()).step_by(7) {
        let mut flipped = whole.to_vec();
        flipped[at] ^= 1 << (at % 8);
        objects.put(&path, flipped.into()).await.unwrap();
        let error = open(&store).await.window(0, cell).await.unwrap_err();
        let CubeError::Chunk { array, chunk, .. } = &error else {
            panic!("byte {at}: {error}");
        };
        assert_eq!(
            (array.as_str(), &chunk[..]),
            ("carbon_flux", &[0, 0, 0][..])
        );
    }
    let short = Bytes::copy_from_slice(&whole[..whole.len() - 1]);
    objects.put(&path, short.into()).await.unwrap();
    let error = open(&store).await.window(0, cell).await.unwrap_err();
    assert!(matches!(error, CubeError::Chunk { .. }), "{error}");
    objects.delete(&path).await.unwrap();
    let error = open(&store).await.window(0, cell).await.unwrap_err();
    assert!(error.to_string().contains("land the file"), "{error}");
    objects.put(&path, whole.into()).await.unwrap();
    let read = open(&store).await.window(0, cell).await.unwrap();
    assert_eq!(bits(&read), bits(&put));
}

/// Its library would take it for whole: it compresses without a checksum.
#[tokio::test]
async fn no_flipped_bit_of_what_names_chunks_is_read() {
    let (store, _chunks) = cube_of(20, 30).await;
    let mut parts = std::collections::BTreeSet::new();
    for key in store.list("p").await.unwrap() {
        let part = key.as_str().split('/').nth(1).unwrap().to_owned();
        // Logs of transactions are read by nobody here, nor is the state before the first commit once more.
        if !matches!(part.as_str(), "repo" | "manifests" | "snapshots") {
            continue;
        }
        let path = object_store::path::Path::from(key.as_str());
        let objects = store.object_store();
        let whole = objects.get(&path).await.unwrap().bytes().await.unwrap();
        for at in (0..whole.len()).step_by(5) {
            let mut flipped = whole.to_vec();
            flipped[at] ^= 1 << (at % 8);
            objects.put(&path, flipped.into()).await.unwrap();
            let read = async {
                let repository = Repository::open(&store, "p").await?;
                repository.at(&At::Newest).await?.field(0).await
            };
            if let Err(error) = read.await {
                let text = error.to_string();
                assert!(
                    text.contains(key.as_str()) && text.contains("sealed"),
                    "{text}"
                );
                parts.insert(part.clone());
            } else {
                assert_ne!(part, "repo", "byte {at}");
            }
        }
        objects.put(&path, whole.into()).await.unwrap();
    }
    assert_eq!(parts.len(), 3, "{parts:?}");
}

/// Chunks in shards are read by themselves, where the library compares no checksum.
#[tokio::test]
async fn no_flipped_bit_of_a_shard_gives_a_number() {
    let (store, keys) = cube_of(4200, 4300).await;
    let keys = largest(&store, keys, 4).await;
    let objects = store.object_store();
    let cube = open(&store).await;
    let mut errors = 0;
    for key in &keys {
        let path = object_store::path::Path::from(key.as_str());
        let whole = objects.get(&path).await.unwrap().bytes().await.unwrap();
        for at in [whole.len() / 3, whole.len() - 9] {
            let mut flipped = whole.to_vec();
            flipped[at] ^= 1;
            objects.put(&path, flipped.into()).await.unwrap();
            let grid = cube.description().grid;
            let read = open(&store).await.field(0).await;
            assert!(
                matches!(read, Err(CubeError::Chunk { .. })),
                "byte {at} of {}: {:?}",
                grid.rows,
                read.map(|values| values.len())
            );
            errors += 1;
        }
        objects.put(&path, whole.into()).await.unwrap();
    }
    assert_eq!(errors, 8);
    open(&store).await.field(0).await.unwrap();
}

/// Whole and sound objects in each other's place: their checksums are right, the field is not.
#[tokio::test]
async fn chunks_that_changed_places_are_no_field() {
    let grid = grid(700, 1500);
    // Noise in all bits is stored as it is, so that all chunks are of one length.
    let noise = |cell: u32| {
        let bits = cell.wrapping_mul(0x9E37_79B9) ^ (cell.wrapping_mul(0x85EB_CA6B) >> 15);
        let value = f32::from_bits(bits.wrapping_mul(0xC2B2_AE35));
        if value.is_nan() { 1.0 } else { value }
    };
    let noise: Vec<f32> = (0..grid.cell_count() as u32).map(noise).collect();
    let (store, keys) = cube_with(grid, noise.into()).await;
    let keys = largest(&store, keys, 6).await;
    open(&store).await.field(0).await.unwrap();
    let objects = store.object_store();
    let path = |at: usize| object_store::path::Path::from(keys[at].as_str());
    let one = objects.get(&path(0)).await.unwrap().bytes().await.unwrap();
    let two = objects.get(&path(1)).await.unwrap().bytes().await.unwrap();
    assert_eq!(one.len(), two.len());
    objects.put(&path(0), two.into()).await.unwrap();
    objects.put(&path(1), one.into()).await.unwrap();
    let error = open(&store).await.field(0).await.unwrap_err();
    assert!(matches!(error, CubeError::Step { .. }), "{error}");
}
