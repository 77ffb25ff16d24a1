//! The exact sums that accumulation has come to after a step, kept so that the next step needs no earlier one: an object a band of
//! rows.
//!
//! They can be computed again at any time, so that whatever is wrong with a stored one counts as not there. What is
//! stored is sealed; what was stored before it was is computed again, too.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{BAND_CELLS, bands};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Kind;
use datafusion::arrow::array::{AsArray as _, Int64Array, RecordBatch};
use datafusion::arrow::datatypes::{DataType, Field, Int64Type, Schema};
use datafusion::parquet::arrow::ArrowWriter;
use datafusion::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use datafusion::parquet::basic::{Compression, ZstdLevel};
use datafusion::parquet::errors::ParquetError;
use datafusion::parquet::file::properties::WriterProperties;
use storage::sound::{Soundness, seal};
use storage::{StorageError, Store};

use crate::ComputeError;

/// The key of the sums of a band of rows after a step, named by what that step is made of; of a grid of one band by that alone.
pub(crate) fn key(made_of: Digest, grid: &Grid, rows: &Range<u32>) -> ObjectKey {
    let name = if rows.len() == grid.rows as usize {
        made_of
    } else {
        Digest::of_json(&("exact sums", made_of, rows.start, rows.end))
    };
    format!("{}/{name}.parquet", Kind::Accumulating.folder())
        .parse()
        .expect("a folder and a digest make a key")
}

/// Those of all bands of a grid.
pub(crate) fn keys(made_of: Digest, grid: &Grid) -> impl Iterator<Item = ObjectKey> {
    bands(grid, BAND_CELLS).map(move |rows| key(made_of, grid, &rows))
}

/// Stores sums: `[row, col]`, kg m⁻² in steps of 10⁻¹⁵.
pub(super) async fn keep(store: &Store, key: &ObjectKey, sums: &[i64]) -> Result<(), ComputeError> {
    let content = encode(sums).map_err(|e| ComputeError::inconsistent(key.as_str(), e))?;
    match store.put_new(key, content.clone().into()).await {
        // Another version of the encoder may have written the same sums.
        Err(StorageError::Conflict { .. })
            if kept(store, key, sums.len()).await?.as_deref() != Some(sums) =>
        {
            store.put_over(key, content.into()).await?;
            Ok(())
        }
        Ok(_) | Err(StorageError::Conflict { .. }) => Ok(()),
        Err(e) => Err(e.into()),
    }
}

/// Stored sums, if they are there and whole.
pub(super) async fn kept(
    store: &Store,
    key: &ObjectKey,
    cell_count: usize,
) -> Result<Option<Vec<i64>>, ComputeError> {
    let damaged = |error: &dyn std::fmt::Display| {
        tracing::warn!(%key, %error, "stored sums cannot be read; they are computed again");
        Ok(None)
    };
    let content = match store.get_with_soundness(key).await {
        Ok((content, Soundness::Sound)) => content,
        Ok((_, Soundness::Unsealed)) => return Ok(None),
        Err(e) if e.is_not_found() => return Ok(None),
        Err(error @ StorageError::Damaged { .. }) => return damaged(&error),
        Err(e) => return Err(e.into()),
    };
    match decode(content) {
        Ok(sums) if sums.len() == cell_count => Ok(Some(sums)),
        Ok(_) => Ok(None),
        Err(error) => damaged(&error),
    }
}

fn encode(sums: &[i64]) -> Result<Vec<u8>, ParquetError> {
    let schema = Arc::new(Schema::new(vec![Field::new("sum", DataType::Int64, false)]));
    let column = Arc::new(Int64Array::from_iter_values(sums.iter().copied()));
    let batch = RecordBatch::try_new(Arc::clone(&schema), vec![column])?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("fluxglobe".to_owned())
        .set_dictionary_enabled(false)
        .build();
    let mut out = vec![];
    let mut writer = ArrowWriter::try_new(&mut out, schema, Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(seal::parquet(out))
}

fn decode(content: bytes::Bytes) -> Result<Vec<i64>, ParquetError> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(content)?.build()?;
    let mut sums = vec![];
    for batch in reader {
        let batch = batch?;
        let column = batch
            .columns()
            .first()
            .and_then(|column| column.as_primitive_opt::<Int64Type>());
        let column = column.ok_or_else(|| ParquetError::General("no column of sums".to_owned()))?;
        sums.extend_from_slice(column.values());
    }
    Ok(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 130,
        cols: 2,
        north_deg: 65.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn a_band_has_a_name_of_its_own_and_a_grid_of_one_band_that_of_the_step() {
        let made_of = Digest::of(b"a");
        let whole = key(made_of, &GRID, &(0..130));
        assert!(whole.as_str().contains(&made_of.to_string()));
        assert_eq!(
            keys(made_of, &GRID).collect::<Vec<_>>(),
            std::slice::from_ref(&whole)
        );
        let bands = [0..60, 60..120, 120..130].map(|rows| key(made_of, &GRID, &rows));
        assert!(bands[0] != bands[1] && bands[1] != bands[2] && !bands.contains(&whole));
        assert_ne!(bands[0], key(Digest::of(b"b"), &GRID, &(0..60)));
    }

    #[tokio::test]
    async fn sums_round_trip_and_damaged_ones_are_as_if_not_there() {
        let store = Store::memory();
        let sums = [0, i64::MIN, 9_000_000_000_000_000_000, -1];
        let [own, other] = ["a", "b"].map(|of| key(Digest::of(of.as_bytes()), &GRID, &(0..130)));
        keep(&store, &own, &sums).await.unwrap();
        keep(&store, &own, &sums).await.unwrap();
        assert_eq!(kept(&store, &own, 4).await.unwrap().unwrap(), sums);
        assert!(kept(&store, &own, 5).await.unwrap().is_none());
        assert!(kept(&store, &other, 4).await.unwrap().is_none());
        store.put_new(&other, "PAR1".into()).await.unwrap();
        assert!(kept(&store, &other, 4).await.unwrap().is_none());
        let mut flipped = store.get(&own).await.unwrap().to_vec();
        flipped[30] ^= 1;
        for damaged in [flipped.into(), "PAR1".into()] {
            store.put_over(&own, damaged).await.unwrap();
            assert!(kept(&store, &own, 4).await.unwrap().is_none());
            keep(&store, &own, &sums).await.unwrap();
            assert_eq!(kept(&store, &own, 4).await.unwrap().unwrap(), sums);
        }
    }
}
