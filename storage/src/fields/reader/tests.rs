//! Fields written and read in bands: the same bytes, the same values, and damage is named where it lies.

use std::sync::Arc;

use bytes::Bytes;
use contract::product::ProductId;

use super::*;
use crate::content::Content;
use crate::fields::{Writer, encode, read};

/// Seven rows of chunks and a part, three columns of chunks and a part: more than one group of the file.
const GRID: Grid = Grid {
    rows: 435,
    cols: 1270,
    north_deg: 43.5,
    west_deg: 0.0,
    dlat_deg: 0.1,
    dlon_deg: 0.1,
};

fn values() -> Vec<f32> {
    let value = |i: usize| match i % 7 {
        0 => f32::NAN,
        // Another bit pattern that is no number.
        1 if i > 100_000 => -f32::NAN,
        _ => (i as f32).sin(),
    };
    (0..GRID.cell_count()).map(value).collect()
}

fn january() -> Period {
    Period::month(2000, 1).unwrap()
}

/// The field as it is written in bands of so many rows.
fn in_bands(band_rows: usize, values: &[f32]) -> (Digest, Bytes) {
    let mut field = Writer::new(vec![], &GRID, january()).unwrap();
    for band in values.chunks(band_rows * GRID.cols as usize) {
        field.band(band).unwrap();
    }
    let (digest, bytes) = field.finish().unwrap();
    (digest, bytes.into())
}

async fn stored(store: &Store) -> ObjectKey {
    let field = encode(&GRID, &values(), january()).unwrap();
    let key = ObjectKey::field(&product(), &field.values_sha256);
    store.put_new(&key, field.content).await.unwrap();
    key
}

fn product() -> ProductId {
    "p".parse().unwrap()
}

fn bits(values: &[f32]) -> Vec<u32> {
    // All that is no number is alike.
    let bits = |value: &f32| if value.is_nan() { 0 } else { value.to_bits() };
    values.iter().map(bits).collect()
}

#[test]
fn a_field_is_the_same_bytes_and_has_the_same_name_in_whatever_bands_it_comes() {
    let values = values();
    let whole = encode(&GRID, &values, january()).unwrap();
    for band_rows in [60, 180, 420, 435] {
        let (digest, bytes) = in_bands(band_rows, &values);
        assert_eq!(digest, whole.values_sha256, "bands of {band_rows} rows");
        assert!(bytes == whole.content, "bands of {band_rows} rows");
    }
    let mut other = values;
    other[GRID.cell_count() - 1] += 1.0;
    assert_ne!(in_bands(60, &other).0, whole.values_sha256);
}

#[test]
fn rows_that_are_missing_too_many_or_no_whole_chunks_are_refused() {
    let values = values();
    let cols = GRID.cols as usize;
    let field = || Writer::new(vec![], &GRID, january()).unwrap();
    let mut short = field();
    short.band(&values[..60 * cols]).unwrap();
    assert!(
        short
            .finish()
            .err()
            .unwrap()
            .to_string()
            .contains("60 of 435")
    );
    for length in [59 * cols, 60 * cols + 1, values.len() + cols] {
        let some = vec![0.0; length];
        assert!(field().band(&some).is_err(), "{length} values");
    }
}

#[tokio::test]
async fn rows_and_windows_are_those_of_the_whole_field() {
    let store = Store::memory();
    let key = stored(&store).await;
    let values = values();
    let reader = Reader::open(&store, &key, Some(&GRID)).await.unwrap();
    assert_eq!(reader.period(), january());
    let cols = GRID.cols as usize;
    for rows in [0..1, 59..61, 100..300, 434..435, 0..435] {
        let found = reader.rows(rows.clone()).await.unwrap();
        let own = &values[rows.start as usize * cols..rows.end as usize * cols];
        assert_eq!(bits(&found), bits(own), "{rows:?}");
    }
    let window = Window {
        row: 50,
        col: 110,
        rows: 80,
        cols: 250,
    };
    let found = reader.window(window).await.unwrap();
    let own: Vec<f32> = window.cell_indices(&GRID).map(|i| values[i]).collect();
    assert_eq!(bits(&found), bits(&own));
    for (rows, outside) in [(430..436, "436"), (5..5, "0"), (0..u32::MAX, "all")] {
        assert!(reader.rows(rows).await.is_err(), "{outside}");
    }
    let narrower = Grid { cols: 1269, ..GRID };
    let error = Reader::open(&store, &key, Some(&narrower))
        .await
        .unwrap_err();
    assert!(error.to_string().contains("435 x 1270"), "{error}");
}

#[tokio::test]
async fn windows_are_read_together_as_they_are_one_by_one() {
    let (store, whole) = (Store::memory(), values());
    let key = stored(&store).await;
    let reader = Reader::open(&store, &key, Some(&GRID)).await.unwrap();
    let window = |row: u32, col: u32, rows: u32, cols: u32| Window {
        row,
        col,
        rows,
        cols,
    };
    // In one chunk, in two of them, over the corner of four, and twice the same.
    let one = window(3, 5, 1, 1);
    let asked = [one, window(58, 7, 4, 2), window(119, 239, 2, 2), one];
    for some in [&asked[..1], &asked[..2], &asked] {
        let found = reader.windows(some).await.unwrap();
        for (window, found) in some.iter().zip(found) {
            let own: Vec<f32> = window.cell_indices(&GRID).map(|at| whole[at]).collect();
            assert_eq!(bits(&found), bits(&own), "{window:?}");
        }
    }
    assert!(reader.windows(&[one, window(435, 0, 1, 1)]).await.is_err());
}

#[tokio::test]
async fn only_the_bytes_of_a_window_are_read() {
    let store = Store::memory();
    let key = stored(&store).await;
    let size_bytes = store.size_bytes(&key).await.unwrap();
    let (counted, traffic) = store.counted();
    let reader = Reader::open(&counted, &key, None).await.unwrap();
    reader.rows(0..60).await.unwrap();
    let read_bytes = traffic.counts().read_bytes;
    assert!(read_bytes * 3 < size_bytes, "{read_bytes} of {size_bytes}");
}

#[tokio::test]
async fn bands_are_the_whole_field_and_their_values_are_compared_with_its_name() {
    let store = Store::memory();
    let key = stored(&store).await;
    for cells in [1, 200_000, BAND_CELLS] {
        let reader = Reader::open(&store, &key, Some(&GRID)).await.unwrap();
        let mut bands = reader.bands_of(cells);
        let mut found = vec![];
        while let Some((rows, band)) = bands.next().await.unwrap() {
            assert_eq!(rows.start as usize * GRID.cols as usize, found.len());
            found.extend(band);
        }
        assert_eq!(bits(&found), bits(&values()));
    }
    // A whole file of other values under this name: each of its rows is what its check says.
    let mut other = values();
    other[7 * 60_000 + 2] += 1.0;
    let (_, content) = in_bands(60, &other);
    store.put_over(&key, content).await.unwrap();
    let mut bands = Reader::open(&store, &key, None).await.unwrap().bands_of(1);
    let mut count = 0;
    let error = loop {
        match bands.next().await {
            Ok(Some(_)) => count += 1,
            Ok(None) => panic!("nothing was said of it"),
            Err(error) => break error.to_string(),
        }
    };
    assert_eq!(count, 8, "only all bands together tell");
    assert!(
        error.contains(key.as_str()) && error.contains("its name"),
        "{error}"
    );
}

#[tokio::test]
async fn a_damaged_row_is_named_by_those_who_read_it_and_no_others() {
    let store = Store::memory();
    let key = stored(&store).await;
    let mut content = store.get(&key).await.unwrap().to_vec();
    let at = content.len() / 2;
    content[at] ^= 4;
    store.put_over(&key, content.into()).await.unwrap();
    let reader = Reader::open(&store, &key, Some(&GRID)).await.unwrap();
    let mut faults = 0;
    for rows in contract::chunk::bands(&GRID, 1) {
        if let Err(error) = reader.rows(rows).await {
            assert!(matches!(error, StorageError::Damaged { .. }), "{error}");
            assert!(error.to_string().contains(key.as_str()), "{error}");
            faults += 1;
        }
    }
    assert_eq!(faults, 1);
    assert!(reader.bands().next().await.is_err());
    assert!(read(&store, &key, &GRID).await.is_err());
}

#[tokio::test]
async fn a_field_from_a_file_is_stored_once_and_takes_the_place_of_a_damaged_one() {
    let folder = tempfile::tempdir().unwrap();
    let on_disk = Store::open(folder.path().to_str().unwrap()).unwrap();
    for store in [Store::memory(), on_disk] {
        let file = tempfile::tempfile().unwrap();
        let mut field = Writer::new(file, &GRID, january()).unwrap();
        for band in values().chunks(60 * GRID.cols as usize) {
            field.band(band).unwrap();
        }
        let (digest, file) = field.finish().unwrap();
        let key = ObjectKey::field(&product(), &digest);
        let content = Content::of_file(file).unwrap();
        let whole = encode(&GRID, &values(), january()).unwrap();
        assert_eq!(key, ObjectKey::field(&product(), &whole.values_sha256));
        assert!(store.put_new_content(&key, content.clone()).await.unwrap());
        assert!(!store.put_new_content(&key, content.clone()).await.unwrap());
        assert!(store.get(&key).await.unwrap() == whole.content);
        let mut damaged = whole.content.to_vec();
        damaged[5000] ^= 1;
        store.put_over(&key, damaged.into()).await.unwrap();
        assert!(store.put_new_content(&key, content).await.unwrap());
        assert!(store.get(&key).await.unwrap() == whole.content);
    }
}

#[tokio::test]
async fn a_file_of_other_bytes_than_its_name_is_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let key = ObjectKey::raw(&product(), &Digest::of(b"as it was"));
    let file = folder.path().join("raw.nc");
    std::fs::write(&file, "as it is now").unwrap();
    let content = Content::of_file(std::fs::File::open(&file).unwrap()).unwrap();
    let error = store.put_new_content(&key, content).await.unwrap_err();
    assert!(
        !error.is_retryable() && error.to_string().contains("changed"),
        "{error}"
    );
    assert!(!store.exists(&key).await.unwrap());
}

#[test]
fn readers_can_go_to_other_threads() {
    fn sent<T: Send + Sync + 'static>() {}
    sent::<Arc<Reader>>();
    sent::<Bands>();
}
