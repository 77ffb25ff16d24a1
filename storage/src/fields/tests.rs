//! Fields in memory: what is written is what is read, and nothing else is.

use super::*;
use arrow::compute::concat_batches;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;

const GRID: Grid = Grid {
    rows: 70,
    cols: 130,
    north_deg: 35.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

fn values() -> Vec<f32> {
    let value = |i: usize| {
        if i.is_multiple_of(7) {
            f32::NAN
        } else {
            i as f32
        }
    };
    (0..GRID.cell_count()).map(value).collect()
}

fn january() -> Period {
    Period::month(2000, 1).unwrap()
}

fn product() -> ProductId {
    "p".parse().unwrap()
}

fn field(values: &[f32]) -> (ObjectKey, Bytes) {
    let encoded = encode(&GRID, values, january()).unwrap();
    let key = ObjectKey::field(&product(), &encoded.values_sha256);
    (key, encoded.content)
}

/// The rows of a field.
fn batch(values: &[f32]) -> RecordBatch {
    let (key, content) = field(values);
    parquet_table::decode(&key, content, &SCHEMA).unwrap().batch
}

/// The same values as another program might write them.
fn otherwise(values: &[f32]) -> Bytes {
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(9).unwrap()))
        .set_max_row_group_row_count(Some(2));
    let batch = batch(values);
    parquet_table::encode_as(&batch, &[GRID.rows, GRID.cols], properties).unwrap()
}

#[test]
fn a_field_round_trips_with_its_gaps() {
    let (key, content) = field(&values());
    let (_, back, period) = decode(&key, content, Some(&GRID)).unwrap();
    let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&back), bits(&values()));
    assert_eq!(period, january());
}

#[test]
fn equal_values_have_one_name_whatever_their_nan_and_their_bytes() {
    let mut other = values();
    other[0] = -f32::NAN;
    assert_eq!(field(&other), field(&values()));
    let (key, content) = field(&values());
    let otherwise = otherwise(&values());
    assert_ne!(
        otherwise, content,
        "these are the same bytes: this tests nothing"
    );
    assert!(decode(&key, otherwise, Some(&GRID)).is_ok());
    other[1] = 2.0;
    assert_ne!(field(&other).0, key);
    let february = Period::month(2000, 2).unwrap();
    let later = encode(&GRID, &values(), february).unwrap();
    assert_ne!(ObjectKey::field(&product(), &later.values_sha256), key);
}

#[test]
fn bytes_that_are_not_the_field_of_their_name_are_damaged() {
    let (key, content) = field(&values());
    let other_grid = Grid { rows: 69, ..GRID };
    let half = content.slice(..content.len() / 2);
    let mut other = values();
    other[1] += 1.0;
    for (content, grid) in [
        (content, &other_grid),
        (half, &GRID),
        (Bytes::from("text"), &GRID),
        (field(&other).1, &GRID),
    ] {
        let error = decode(&key, content, Some(grid)).unwrap_err();
        assert!(matches!(error, StorageError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains(key.as_str()), "{error}");
    }
}

#[test]
fn a_field_that_lacks_a_chunk_or_has_one_twice_is_damaged_though_its_values_are_those_of_its_name()
{
    let mut values = values();
    let last = field_chunks(&GRID).pop().unwrap();
    for cell in last.cell_indices(&GRID) {
        values[cell] = f32::NAN;
    }
    let (key, content) = field(&values);
    assert!(decode(&key, content, Some(&GRID)).is_ok());
    let whole = batch(&values);
    let without = whole.slice(0, whole.num_rows() - 1);
    let twice = concat_batches(&SCHEMA, [&whole, &whole.slice(0, 1)]).unwrap();
    for batch in [without, twice] {
        let shape = [GRID.rows, GRID.cols];
        let content = parquet_table::encode(&batch, CHUNKS_PER_GROUP, &shape).unwrap();
        let error = decode(&key, content, Some(&GRID)).unwrap_err().to_string();
        assert!(error.contains("chunks, its grid has 4"), "{error}");
    }
}

#[tokio::test]
async fn the_same_values_in_other_bytes_are_no_conflict() {
    let store = Store::memory();
    let (key, content) = field(&values());
    assert!(store.put_new(&key, otherwise(&values())).await.unwrap());
    assert!(!store.put_new(&key, content).await.unwrap());
    let back = read(&store, &key, &GRID).await.unwrap();
    assert_eq!(digest_of(&GRID, &back, january()).to_string().len(), 64);
}

#[tokio::test]
async fn a_damaged_field_is_an_error_until_it_is_written_again() {
    let store = Store::memory();
    let (key, content) = field(&values());
    let mut damaged = content.to_vec();
    damaged[content.len() / 2] ^= 1;
    store.put_over(&key, damaged.into()).await.unwrap();
    let error = read(&store, &key, &GRID).await.unwrap_err();
    assert!(error.to_string().contains(key.as_str()), "{error}");
    assert!(store.put_new(&key, content.clone()).await.unwrap());
    assert_eq!(store.get(&key).await.unwrap(), content);
}

/// A field as it was written when fields were named by their bytes.
fn of_bytes(values: &[f32]) -> (ObjectKey, Bytes) {
    let batch = batch(values);
    let batch = batch.project(&[0, 1, 2, 3]).unwrap();
    let mut out = vec![];
    let mut writer = parquet::arrow::ArrowWriter::try_new(&mut out, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    let name = format!("frames/p/{}.parquet", Digest::of(&out));
    (name.parse().unwrap(), out.into())
}

#[tokio::test]
async fn a_field_named_by_its_bytes_keeps_its_name_as_long_as_it_holds_its_values() {
    let store = Store::memory();
    let (old, content) = of_bytes(&values());
    store.put_new(&old, content).await.unwrap();
    let (new, _) = field(&values());
    assert_eq!(
        read(&store, &old, &GRID).await.unwrap().len(),
        values().len()
    );
    assert_eq!(settle(&store, &old, &new, &GRID).await.unwrap(), old);
    let mut other = values();
    other[1] += 1.0;
    let (other, _) = field(&other);
    assert_eq!(settle(&store, &old, &other, &GRID).await.unwrap(), other);
    let (lost, content) = of_bytes(&vec![1.0; GRID.cell_count()]);
    let mut damaged = content.to_vec();
    damaged[100] ^= 1;
    assert_eq!(settle(&store, &lost, &new, &GRID).await.unwrap(), new);
    store.put_over(&lost, damaged.into()).await.unwrap();
    assert_eq!(settle(&store, &lost, &new, &GRID).await.unwrap(), new);
    assert!(read(&store, &lost, &GRID).await.is_err());
}
