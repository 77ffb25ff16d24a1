//! References in the place of fields: what comes out is the field that they refer to, or an error.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use bytes::Bytes;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::time::Period;
use object_store::path::Path;
use storage::attached::{Attachment, Cause, Failure, Reference, Source, StoreKind};
use storage::{Store, fields};

const GRID: Grid = Grid {
    rows: 2,
    cols: 3,
    north_deg: 1.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// A store of others that holds these values in every step.
#[derive(Debug)]
struct Fixed(Vec<f32>);

#[async_trait]
impl Source for Fixed {
    async fn values(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
        _rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        Ok(self.0.clone())
    }
}

/// The same, with how often it was read.
#[derive(Debug)]
struct Counted(Vec<f32>, Mutex<u32>);

#[async_trait]
impl Source for Counted {
    async fn values(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
        _rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        *self.1.lock().unwrap() += 1;
        Ok(self.0.clone())
    }
}

/// A store of others that is gone: none of its chunks is there, which means no data.
#[derive(Debug)]
struct Gone;

#[async_trait]
impl Source for Gone {
    async fn values(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
        _rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        Ok(vec![f32::NAN; GRID.cell_count()])
    }

    async fn gone(&self, attachment: &Attachment, reference: &Reference) -> Option<Failure> {
        Some(Failure {
            place: format!("step {}, {}", reference.period, attachment.place()),
            reason: "its store is no longer there".to_owned(),
            cause: Cause::Content,
            folder: None,
        })
    }
}

/// Cells of a step of more than one band.
const LARGE: Grid = Grid {
    rows: 2900,
    cols: 2900,
    ..GRID
};

fn large_value(cell: usize) -> f32 {
    if cell.is_multiple_of(7) {
        f32::NAN
    } else {
        (cell % 1009) as f32
    }
}

/// A store of others with a large step, in chunks of so many rows; notes what is asked for, and has another last row if it has changed.
#[derive(Debug)]
struct Banded {
    chunk_rows: u32,
    has_changed: bool,
    asked: Mutex<Vec<Range<u32>>>,
}

impl Banded {
    fn new(chunk_rows: u32, has_changed: bool) -> Arc<Self> {
        let asked = Mutex::default();
        Arc::new(Self {
            chunk_rows,
            has_changed,
            asked,
        })
    }

    fn bands(&self) -> Vec<Range<u32>> {
        let starts = (0..LARGE.rows).step_by(self.chunk_rows as usize);
        let bands = starts.map(|start| start..LARGE.rows.min(start + self.chunk_rows));
        bands.collect()
    }
}

#[async_trait]
impl Source for Banded {
    async fn bands(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
    ) -> Result<Vec<Range<u32>>, Failure> {
        Ok(self.bands())
    }

    async fn values(
        &self,
        _attachment: &Arc<Attachment>,
        _reference: &Reference,
        rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        self.asked.lock().unwrap().push(rows.clone());
        let is_other = self.has_changed && rows.end == LARGE.rows;
        let cell = |row: u32| row as usize * LARGE.cols as usize;
        let mut values: Vec<f32> = (cell(rows.start)..cell(rows.end))
            .map(large_value)
            .collect();
        if is_other && let Some(last) = values.last_mut() {
            *last += 1.0;
        }
        Ok(values)
    }
}

fn values() -> Vec<f32> {
    vec![1.0, 2.0, f32::NAN, 4.0, 5.0, 6.0]
}

/// A store with one reference, and the bytes that a field of its values has.
async fn attached() -> (Store, ObjectKey, Bytes) {
    attached_as(GRID, &values()).await
}

async fn attached_as(grid: Grid, values: &[f32]) -> (Store, ObjectKey, Bytes) {
    let (store, product) = (Store::memory(), "p".parse().unwrap());
    let period = Period::month(2000, 1).unwrap();
    let encoded = fields::encode(&grid, values, period).unwrap();
    let place = ("s3://b/x".to_owned(), StoreKind::Zarr3, None);
    let attachment = Attachment::new(product, place, "sst".to_owned(), serde_json::Value::Null);
    let name = store.put_attachment(&attachment).await.unwrap();
    let shape = [grid.rows, grid.cols];
    let reference = Reference::new(name, (7, period), shape, [1.0, 0.0]);
    let product = attachment.product;
    let key = store.put_reference(&product, &encoded.values_sha256, &reference);
    (store.clone(), key.await.unwrap(), encoded.content)
}

#[tokio::test]
async fn whoever_asks_gets_the_bytes_of_the_field() {
    let (store, key, field) = attached().await;
    let layered = store.with_attached(Arc::new(Fixed(values())));
    assert_eq!(layered.get(&key).await.unwrap(), field);
    assert_eq!(layered.size_bytes(&key).await.unwrap(), field.len() as u64);
    let end = field.len() as u64;
    let part = layered.get_range(&key, end - 8..end).await.unwrap();
    assert_eq!(part, field.slice(field.len() - 8..));
    // A reader that has not asked for the size before, of a part that lies behind the end of the reference.
    let anew = store.with_attached(Arc::new(Fixed(values())));
    let path = Path::from(key.as_str());
    let (objects, ends) = (anew.object_store(), [0..4, end - 4..end]);
    let parts = objects.get_ranges(&path, &ends).await.unwrap();
    assert_eq!(parts, ["PAR1", "PAR1"]);
    let read = fields::read(&layered, &key, &GRID).await.unwrap();
    // No data is no data, whatever its bits are.
    let there = |values: &[f32]| -> Vec<Option<u32>> {
        let bits = values.iter().map(|it| (!it.is_nan()).then(|| it.to_bits()));
        bits.collect()
    };
    assert_eq!(there(&read), there(&values()));
    // The same values landed are the same field, and change nothing.
    let period = Period::month(2000, 1).unwrap();
    let product = "p".parse().unwrap();
    let landed = fields::write(&layered, &product, &GRID, &values(), period).await;
    assert_eq!(landed.unwrap(), key);
    assert!(store.size_bytes(&key).await.unwrap() < 512, "a reference");
}

#[tokio::test]
async fn other_values_than_those_of_the_name_never_come_out() {
    let (store, key, _field) = attached().await;
    let mut other = values();
    other[5] = f32::from_bits(6f32.to_bits() ^ 1);
    for other in [other, vec![1.0; 5], vec![]] {
        let layered = store.with_attached(Arc::new(Fixed(other)));
        let error = layered.get(&key).await.unwrap_err();
        assert!(
            !error.is_retryable() && error.attached().is_some(),
            "{error}"
        );
        let text = error.to_string();
        assert!(text.contains("s3://b/x array sst"), "{text}");
        assert!(text.contains("fluxglobe attach --refresh p"), "{text}");
        let path = Path::from(key.as_str());
        let range = layered.object_store();
        assert!(
            range
                .get_ranges(&path, std::slice::from_ref(&(0..4)))
                .await
                .is_err()
        );
    }
}

#[tokio::test]
async fn a_store_that_is_gone_has_not_changed() {
    let (store, key, _field) = attached().await;
    let layered = store.with_attached(Arc::new(Gone));
    let error = layered.get(&key).await.unwrap_err().to_string();
    assert!(
        error.contains("no longer there") && !error.contains("--refresh"),
        "{error}"
    );
}

#[tokio::test]
async fn a_reference_that_moves_keeps_its_name_and_a_field_is_never_replaced() {
    let (store, key, field) = attached().await;
    let before = store.reference(&key).await.unwrap().unwrap();
    let own = (8, before.period);
    let moved = Reference::new(before.attachment, own, [2, 3], [1.0, 0.0]);
    let product = "p".parse().unwrap();
    let Vouched::Values(digest) = key.vouches() else {
        panic!("{key} is named by its values");
    };
    store
        .put_reference(&product, &digest, &moved)
        .await
        .unwrap();
    assert_eq!(store.reference(&key).await.unwrap(), Some(moved));
    // Landed: the values are here now, and stay.
    store.put_over(&key, field.clone()).await.unwrap();
    store
        .put_reference(&product, &digest, &before)
        .await
        .unwrap();
    assert_eq!(store.get(&key).await.unwrap(), field);
}

#[tokio::test]
async fn a_large_step_is_read_band_by_band_once_and_is_the_same_field() {
    let all: Vec<f32> = (0..LARGE.cell_count()).map(large_value).collect();
    let (store, key, field) = attached_as(LARGE, &all).await;
    // Rows of chunks of a field end elsewhere than those there.
    for chunk_rows in [777, 1] {
        let source = Banded::new(chunk_rows, false);
        let layered = store.with_attached(Arc::clone(&source) as Arc<dyn Source>);
        assert!(layered.get(&key).await.unwrap() == field, "{chunk_rows}");
        assert_eq!(layered.size_bytes(&key).await.unwrap(), field.len() as u64);
        let reader = fields::Reader::open(&layered, &key, Some(&LARGE)).await;
        let rows = reader.unwrap().rows(1440..1500).await.unwrap();
        let first = 1440 * LARGE.cols as usize;
        let is_same = |(at, value): (usize, &f32)| {
            let wanted = large_value(first + at);
            value.to_bits() == wanted.to_bits() || (value.is_nan() && wanted.is_nan())
        };
        assert!(rows.iter().enumerate().all(is_same));
        let asked = source.asked.lock().unwrap().clone();
        assert_eq!(asked, source.bands(), "it is kept, whatever is asked of it");
    }
    let source = Banded::new(777, true);
    let layered = store.with_attached(source);
    let error = layered.get(&key).await.unwrap_err().to_string();
    assert!(
        error.contains("has changed since it was attached"),
        "{error}"
    );
}

/// The room for fields is not cut into parts that hold none of this size.
#[tokio::test]
async fn a_field_is_kept_whatever_the_number_of_processors() {
    let grid = Grid {
        rows: 2800,
        cols: 2900,
        ..GRID
    };
    let values: Vec<f32> = (0..grid.cell_count()).map(large_value).collect();
    let (store, key, field) = attached_as(grid, &values).await;
    let source = Counted(values, Mutex::default());
    let source = Arc::new(source);
    let layered = store.with_attached(Arc::clone(&source) as Arc<dyn Source>);
    for _again in 0..3 {
        let size = layered.size_bytes(&key).await.unwrap();
        assert_eq!(size, field.len() as u64);
    }
    assert_eq!(*source.1.lock().unwrap(), 1, "times that it was read");
}
