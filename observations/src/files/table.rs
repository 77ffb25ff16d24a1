//! Observations to GeoParquet 1.1 bytes and back: equal rows make equal bytes, and only the groups of rows that a span of
//! time touches are decoded.

use arrow::array::RecordBatch;
use bytes::Bytes;
use contract::observation::Observation;
use contract::time::TimeMs;
use geoparquet::writer::{GeoParquetRecordBatchEncoder, GeoParquetWriterOptionsBuilder};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::statistics::Statistics;

use super::columns;
use crate::error::ObservationError;

/// Rows that are decoded together: a day of some hundred platforms.
const ROWS_PER_GROUP: usize = 8192;
/// What is told as the object of a failure to write.
const WRITING: &str = "a file of observations to write";

/// Bytes of rows that are in the order of their keys.
pub(super) fn encode<'a>(
    rows: &(impl Iterator<Item = &'a Observation> + Clone),
) -> Result<Bytes, ObservationError> {
    let failed = |e: &dyn std::fmt::Display| ObservationError::damaged(WRITING, e);
    let batch = columns::batch(rows).map_err(|e| failed(&e))?;
    let options = GeoParquetWriterOptionsBuilder::default()
        .set_primary_column("geometry".to_owned())
        .set_generate_covering(true)
        .build();
    let mut encoder = GeoParquetRecordBatchEncoder::try_new(&columns::SCHEMA, &options)
        .map_err(|e| failed(&e))?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("fluxglobe".to_owned())
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_max_row_group_row_count(Some(ROWS_PER_GROUP))
        .build();
    // Arrow's own copy of the schema says nothing that GeoParquet does not.
    let options = ArrowWriterOptions::new()
        .with_properties(properties)
        .with_skip_arrow_metadata(true);
    let mut out = Vec::new();
    let mut writer = ArrowWriter::try_new_with_options(&mut out, encoder.target_schema(), options)
        .map_err(|e| failed(&e))?;
    let encoded: RecordBatch = encoder
        .encode_record_batch(&batch)
        .map_err(|e| failed(&e))?;
    writer.write(&encoded).map_err(|e| failed(&e))?;
    writer.append_key_value_metadata(encoder.into_keyvalue().map_err(|e| failed(&e))?);
    writer.close().map_err(|e| failed(&e))?;
    Ok(Bytes::from(out))
}

/// Rows of a file that are wanted, in the order of their keys.
///
/// `from` and `to` only save work: rows outside them may be given to `wants` too.
pub(super) fn decode(
    object: &str,
    content: Bytes,
    from: Option<TimeMs>,
    to: Option<TimeMs>,
    wants: impl Fn(&Observation) -> bool,
) -> Result<Vec<Observation>, ObservationError> {
    let damaged = |e: &dyn std::fmt::Display| ObservationError::damaged(object, e);
    let builder = ParquetRecordBatchReaderBuilder::try_new(content).map_err(|e| damaged(&e))?;
    let groups = groups(builder.metadata(), from, to);
    let reader = builder
        .with_row_groups(groups)
        .build()
        .map_err(|e| damaged(&e))?;
    let mut found = vec![];
    for batch in reader {
        let batch = batch.map_err(|e| damaged(&e))?;
        columns::rows(object, &batch, |row| {
            if wants(&row) {
                found.push(row);
            }
        })?;
    }
    Ok(found)
}

/// Groups of rows that a span of time touches, by their least and greatest time.
fn groups(metadata: &ParquetMetaData, from: Option<TimeMs>, to: Option<TimeMs>) -> Vec<usize> {
    let touches = |group: &RowGroupMetaData| {
        let times = group.columns().iter();
        let time = times.filter(|c| c.column_descr().name() == columns::TIME);
        let span = time.filter_map(|column| match column.statistics()? {
            Statistics::Int64(times) => Some((*times.min_opt()?, *times.max_opt()?)),
            _ => None,
        });
        span.last().is_none_or(|(first, last)| {
            from.is_none_or(|from| from.ms() <= last) && to.is_none_or(|to| first < to.ms())
        })
    };
    let all = metadata.row_groups().iter().enumerate();
    all.filter(|(_, group)| touches(group))
        .map(|(at, _)| at)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::tests::observation;
    use geoparquet::metadata::GeoParquetMetadata;
    use parquet::file::reader::{FileReader as _, SerializedFileReader};

    fn rows(count: i64) -> Vec<Observation> {
        let row = |i: i64| Observation {
            time: TimeMs::new(1_325_376_000_000 + i * 60_000).unwrap(),
            lon_deg: (i % 360) as f64 - 180.0,
            lat_deg: 0.1 * (i % 900) as f64,
            ..observation("44005", i as f64 / 3.0)
        };
        (0..count).map(row).collect()
    }

    #[test]
    fn rows_round_trip_with_every_bit() {
        let rows = rows(20_000);
        let bytes = encode(&rows.iter()).unwrap();
        assert_eq!(
            bytes,
            encode(&rows.iter()).unwrap(),
            "other bytes for equal rows"
        );
        let back = decode("f", bytes, None, None, |_| true).unwrap();
        assert_eq!(back, rows);
    }

    #[test]
    fn only_groups_within_the_time_are_decoded() {
        let rows = rows(20_000);
        let (from, to) = (rows[9000].time, rows[9001].time);
        let bytes = encode(&rows.iter()).unwrap();
        let seen = std::cell::Cell::new(0);
        let wants = |o: &Observation| {
            seen.set(seen.get() + 1);
            from <= o.time && o.time < to
        };
        let found = decode("f", bytes, Some(from), Some(to), wants).unwrap();
        assert_eq!(found, rows[9000..9001]);
        assert_eq!(seen.get(), ROWS_PER_GROUP);
    }

    /// What GeoParquet 1.1 asks of a file, read by the metadata reader of its library and by hand.
    #[test]
    fn the_file_is_geoparquet() {
        let bytes = encode(&rows(100).iter()).unwrap();
        let reader = SerializedFileReader::new(bytes).unwrap();
        let metadata = reader.metadata().file_metadata();
        let geo = GeoParquetMetadata::from_parquet_meta(metadata)
            .unwrap()
            .unwrap();
        assert_eq!(
            (geo.version.as_str(), geo.primary_column.as_str()),
            ("1.1.0", "geometry")
        );
        let pairs = metadata.key_value_metadata().unwrap();
        let text = pairs
            .iter()
            .find(|pair| pair.key == "geo")
            .unwrap()
            .value
            .clone()
            .unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let column = &json["columns"]["geometry"];
        assert_eq!(column["encoding"], "WKB");
        assert_eq!(column["geometry_types"], serde_json::json!(["Point"]));
        assert_eq!(column["bbox"], serde_json::json!([-180.0, 0.0, -81.0, 9.9]));
        assert_eq!(
            column["covering"]["bbox"]["xmin"],
            serde_json::json!(["bbox", "xmin"])
        );
        assert!(
            column.get("crs").is_none(),
            "absent means longitude, latitude on WGS 84"
        );
    }

    #[test]
    fn bytes_that_are_no_file_of_observations_are_damaged() {
        let bytes = encode(&rows(100).iter()).unwrap();
        for part in [
            Bytes::new(),
            Bytes::from("text"),
            bytes.slice(..bytes.len() / 2),
        ] {
            let error = decode("f", part, None, None, |_| true).unwrap_err();
            assert!(matches!(error, ObservationError::Damaged { .. }), "{error}");
        }
    }
}
