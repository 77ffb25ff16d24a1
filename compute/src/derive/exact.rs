//! The exact sums that accumulation has come to after a step, kept so that the next step needs no earlier one.
//!
//! They can be computed again at any time, so that whatever is wrong with a stored one counts as not there. What is
//! stored is sealed; what was stored before it was is computed again, too.

use std::sync::Arc;

use contract::digest::Digest;
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

/// The key of the sums after a step, named by what that step is made of.
pub(crate) fn key(made_of: Digest) -> ObjectKey {
    format!("{}/{made_of}.parquet", Kind::Accumulating.folder())
        .parse()
        .expect("a folder and a digest make a key")
}

/// Stores the sums after a step: `[row, col]`, kg m⁻² in steps of 10⁻¹⁵.
pub(super) async fn keep(store: &Store, made_of: Digest, sums: &[i64]) -> Result<(), ComputeError> {
    let key = key(made_of);
    let content = encode(sums).map_err(|e| ComputeError::inconsistent(key.as_str(), e))?;
    match store.put_new(&key, content.clone().into()).await {
        // Another version of the encoder may have written the same sums.
        Err(StorageError::Conflict { .. })
            if kept(store, made_of, sums.len()).await?.as_deref() != Some(sums) =>
        {
            store.put_over(&key, content.into()).await?;
            Ok(())
        }
        Ok(_) | Err(StorageError::Conflict { .. }) => Ok(()),
        Err(e) => Err(e.into()),
    }
}

/// The stored sums after a step, if they are there and whole.
pub(super) async fn kept(
    store: &Store,
    made_of: Digest,
    cell_count: usize,
) -> Result<Option<Vec<i64>>, ComputeError> {
    let key = key(made_of);
    let damaged = |error: &dyn std::fmt::Display| {
        tracing::warn!(%key, %error, "stored sums cannot be read; they are computed again");
        Ok(None)
    };
    let content = match store.get_with_soundness(&key).await {
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

    #[tokio::test]
    async fn sums_round_trip_and_damaged_ones_are_as_if_not_there() {
        let store = Store::memory();
        let sums = [0, i64::MIN, 9_000_000_000_000_000_000, -1];
        let made_of = Digest::of(b"a");
        keep(&store, made_of, &sums).await.unwrap();
        keep(&store, made_of, &sums).await.unwrap();
        assert_eq!(kept(&store, made_of, 4).await.unwrap().unwrap(), sums);
        assert!(kept(&store, made_of, 5).await.unwrap().is_none());
        let other = Digest::of(b"b");
        assert!(kept(&store, other, 4).await.unwrap().is_none());
        store.put_new(&key(other), "PAR1".into()).await.unwrap();
        assert!(kept(&store, other, 4).await.unwrap().is_none());
        let mut flipped = store.get(&key(made_of)).await.unwrap().to_vec();
        flipped[30] ^= 1;
        for damaged in [flipped.into(), "PAR1".into()] {
            store.put_over(&key(made_of), damaged).await.unwrap();
            assert!(kept(&store, made_of, 4).await.unwrap().is_none());
            keep(&store, made_of, &sums).await.unwrap();
            assert_eq!(kept(&store, made_of, 4).await.unwrap().unwrap(), sums);
        }
    }
}
