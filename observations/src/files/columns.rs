//! The columns of a file of observations: how a row is written, and how it is read back.

use std::sync::{Arc, LazyLock};

use arrow::array::{
    Array as _, ArrayRef, AsArray, Float64Array, RecordBatch, StringArray,
    TimestampMillisecondArray, UInt8Array,
};
use arrow::datatypes::{
    DataType, Field, Float64Type, Schema, SchemaRef, TimeUnit, TimestampMillisecondType, UInt8Type,
};
use contract::observation::{Observation, PlatformKind, Quality};
use contract::time::TimeMs;
use geoarrow_array::GeoArrowArray as _;
use geoarrow_array::builder::PointBuilder;
use geoarrow_schema::error::GeoArrowError;
use geoarrow_schema::{Dimension, Metadata, PointType};

use crate::error::ObservationError;

/// Name of the column of times.
pub(super) const TIME: &str = "time";
/// Bytes of a point in well-known binary: byte order, type, longitude, latitude.
const POINT_BYTES: usize = 1 + 4 + 8 + 8;

/// Longitude and latitude, as `GeoArrow`; the coordinate system is that of GeoParquet's default, OGC:CRS84.
static POINT: LazyLock<PointType> =
    LazyLock::new(|| PointType::new(Dimension::XY, Arc::new(Metadata::default())));

/// The columns before they become GeoParquet.
pub(super) static SCHEMA: LazyLock<SchemaRef> = LazyLock::new(|| {
    let time = DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    let text = |name: &str| Field::new(name, DataType::Utf8, false);
    let number = |name: &str| Field::new(name, DataType::Float64, false);
    Arc::new(Schema::new(vec![
        Field::new(TIME, time, false),
        text("dataset"),
        text("platform"),
        text("property"),
        number("depth_m"),
        text("kind"),
        POINT.to_field("geometry", false),
        number("value"),
        text("unit"),
        Field::new("quality", DataType::UInt8, false),
    ]))
});

/// Rows as columns.
pub(super) fn batch<'a>(
    rows: &(impl Iterator<Item = &'a Observation> + Clone),
) -> Result<RecordBatch, GeoArrowError> {
    let texts = |text: fn(&Observation) -> &str| -> ArrayRef {
        Arc::new(StringArray::from_iter_values(rows.clone().map(text)))
    };
    let numbers = |number: fn(&Observation) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(rows.clone().map(number)))
    };
    let times = TimestampMillisecondArray::from_iter_values(rows.clone().map(|o| o.time.ms()));
    let mut points = PointBuilder::new(POINT.clone());
    for row in rows.clone() {
        points.try_push_coord(Some(&(row.lon_deg, row.lat_deg)))?;
    }
    let qualities = UInt8Array::from_iter_values(rows.clone().map(|o| o.quality.flag()));
    let columns: Vec<ArrayRef> = vec![
        Arc::new(times.with_timezone("UTC")),
        texts(|o| o.dataset.as_str()),
        texts(|o| &o.platform),
        texts(|o| &o.property),
        numbers(|o| o.depth_m),
        texts(|o| o.kind.as_str()),
        points.finish().to_array_ref(),
        numbers(|o| o.value),
        texts(|o| &o.unit),
        Arc::new(qualities),
    ];
    Ok(RecordBatch::try_new(Arc::clone(&SCHEMA), columns)?)
}

/// Calls `take` with every row of a batch that was read.
pub(super) fn rows(
    object: &str,
    batch: &RecordBatch,
    mut take: impl FnMut(Observation),
) -> Result<(), ObservationError> {
    let damaged = |reason: &str| ObservationError::damaged(object, reason);
    let column = |name: &str, kind: &DataType| {
        let found = batch.column_by_name(name).filter(|c| c.data_type() == kind);
        found
            .filter(|column| column.null_count() == 0)
            .ok_or_else(|| damaged(&format!("no column {name} of {kind}")))
    };
    let text = |name: &str| column(name, &DataType::Utf8).map(AsArray::as_string::<i32>);
    let number =
        |name: &str| column(name, &DataType::Float64).map(AsArray::as_primitive::<Float64Type>);
    let time = DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    let times = column(TIME, &time)?.as_primitive::<TimestampMillisecondType>();
    let (datasets, platforms) = (text("dataset")?, text("platform")?);
    let (properties, kinds, units) = (text("property")?, text("kind")?, text("unit")?);
    let (depths, values) = (number("depth_m")?, number("value")?);
    let points = column("geometry", &DataType::Binary)?.as_binary::<i32>();
    let qualities = column("quality", &DataType::UInt8)?.as_primitive::<UInt8Type>();
    let contract = |e: contract::ContractError| ObservationError::damaged(object, e);
    for row in 0..batch.num_rows() {
        let [lon_deg, lat_deg] =
            point(points.value(row)).ok_or_else(|| damaged("a place is no point"))?;
        take(Observation {
            dataset: datasets.value(row).parse().map_err(contract)?,
            platform: platforms.value(row).to_owned(),
            kind: kinds.value(row).parse::<PlatformKind>().map_err(contract)?,
            time: TimeMs::new(times.value(row)).map_err(contract)?,
            lon_deg,
            lat_deg,
            depth_m: depths.value(row),
            property: properties.value(row).to_owned(),
            value: values.value(row),
            unit: units.value(row).to_owned(),
            quality: Quality::from_flag(qualities.value(row)).map_err(contract)?,
        });
    }
    Ok(())
}

/// Longitude and latitude of a point in little-endian well-known binary (OGC 06-103r4).
fn point(wkb: &[u8]) -> Option<[f64; 2]> {
    let wkb: &[u8; POINT_BYTES] = wkb.try_into().ok()?;
    let (head, numbers) = wkb.split_at(5);
    let number = |at: usize| {
        let bytes = numbers.get(at..at + 8)?.try_into().ok()?;
        Some(f64::from_le_bytes(bytes))
    };
    if head == [1, 1, 0, 0, 0] {
        Some([number(0)?, number(8)?])
    } else {
        None
    }
}
