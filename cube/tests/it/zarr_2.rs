//! The keys of Zarr version 2: what a repository answers is what is written as files, and holds the values.

use contract::chunk::Window;
use contract::quantity::Quantity;
use cube::{At, CubeError, Edit, Keys, Layout, PlainZarr, Repository, ZarrVersion};
use storage::Store;

use crate::product::{bits, description, grid, month, values};

/// A repository of two steps, and the same as files of version 2 in a store of their own.
async fn written(rows: u32, cols: u32) -> (Store, Keys, Store) {
    let description = description(Quantity::CarbonFlux, grid(rows, cols));
    let (store, files) = (Store::memory(), Store::memory());
    let created = Repository::create(&store, "cubes/p", &description).await;
    let repository = created.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    let plain = PlainZarr::create(&files, "", &description, ZarrVersion::Two).await;
    let mut plain = plain.unwrap();
    for number in [1, 2] {
        let values = values(&description.grid, number);
        edit.put(month(number), values.clone()).await.unwrap();
        plain.append(month(number), values).await.unwrap();
    }
    edit.commit("two months").await.unwrap();
    plain.finish().await.unwrap();
    let keys = repository.keys(&At::Newest).await.unwrap();
    (store, keys, files)
}

#[tokio::test]
async fn a_repository_answers_what_is_written_as_files_and_shards_are_their_chunks() {
    for (rows, cols, is_sharded) in [(20, 30, false), (100, 33_792, true)] {
        let (_store, keys, files) = written(rows, cols).await;
        let grid = grid(rows, cols);
        let layout = Layout::of(&grid);
        assert_eq!(layout.is_sharded(), is_sharded);
        let all = files.list("").await.unwrap();
        assert!(all.len() > 25, "{}", all.len());
        for file in &all {
            let content = files.get(file).await.unwrap();
            let key = file.as_str();
            assert_eq!(
                keys.get_2(key).await.unwrap(),
                Some(content.clone()),
                "{key}"
            );
            assert_eq!(
                keys.length_2(key).await.unwrap(),
                Some(content.len() as u64),
                "{key}"
            );
        }
        let [chunk_rows, chunk_cols] = layout.chunk;
        for (row, col) in [(0, 0), (0, grid.cols.div_ceil(chunk_cols) - 1)] {
            let packed = keys
                .get_2(&format!("carbon_flux/1.{row}.{col}"))
                .await
                .unwrap();
            let bytes = zstd::bulk::decompress(&packed.unwrap(), 1 << 21).unwrap();
            let numbers = bytes.chunks_exact(4);
            let found: Vec<f32> = numbers
                .map(|it| f32::from_le_bytes(it.try_into().unwrap()))
                .collect();
            let window = Window {
                row: row * chunk_rows,
                col: col * chunk_cols,
                rows: chunk_rows.min(grid.rows),
                cols: chunk_cols.min(grid.cols - col * chunk_cols),
            };
            let values = values(&grid, 2);
            let expected: Vec<f32> = window
                .cell_indices(&grid)
                .map(|cell| values[cell])
                .collect();
            let rows = found.chunks_exact(chunk_cols as usize);
            let inside = rows
                .take(window.rows as usize)
                .flat_map(|row| &row[..window.cols as usize]);
            let inside: Vec<f32> = inside.copied().collect();
            assert_eq!(bits(&inside), bits(&expected), "{row} {col}");
        }
        for none in [
            "carbon_flux/2.0.0",
            "carbon_flux/c/0/0/0",
            "zarr.json",
            "levels/.zgroup",
            "../repo",
        ] {
            assert_eq!(keys.get_2(none).await.unwrap(), None, "{none}");
            assert_eq!(keys.length_2(none).await.unwrap(), None, "{none}");
        }
    }
}

#[tokio::test]
async fn a_damaged_chunk_is_an_error_that_names_it_for_version_2_has_no_checksum() {
    for (rows, cols) in [(20, 30), (100, 33_792)] {
        let (store, keys, _files) = written(rows, cols).await;
        let mut damaged = 0;
        for object in store.list("cubes/p/chunks").await.unwrap() {
            let mut content = store.get(&object).await.unwrap().to_vec();
            let middle = content.len() / 3;
            content[middle] ^= 4;
            store.put_over(&object, content.into()).await.unwrap();
            damaged += 1;
        }
        assert!(
            damaged > 0,
            "all chunks are in the manifests: it tests nothing"
        );
        // Of a shard one of eight chunks.
        let cols = cols.div_ceil(Layout::of(&grid(rows, cols)).chunk[1]).min(8);
        let mut failed = vec![];
        for col in 0..cols {
            match keys.get_2(&format!("carbon_flux/0.0.{col}")).await {
                Err(CubeError::Library { reason, .. }) => failed.push(reason),
                found => drop(found.unwrap()),
            }
        }
        assert_eq!(failed.len(), 1, "{failed:?}");
        let reason = &failed[0];
        let object = "carbon_flux/c/0/0/0";
        assert!(
            reason.contains(object) && reason.contains("checksum"),
            "{reason}"
        );
    }
}
