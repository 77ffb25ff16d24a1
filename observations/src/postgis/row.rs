//! Rows of the database's answers as values of the contract.

use std::time::SystemTime;

use contract::observation::{Observation, Platform, PlatformKind, Quality, TrackPoint};
use contract::product::ProductId;
use contract::time::TimeMs;
use tokio_postgres::Row;
use tokio_postgres::types::FromSql;

use crate::error::ObservationError;
use crate::platform::bounds_deg;

/// A row of [`super::question::observations`].
pub(super) fn observation(row: &Row) -> Result<Observation, ObservationError> {
    Ok(Observation {
        dataset: parsed(row, 0)?,
        platform: get(row, 1)?,
        kind: parsed::<PlatformKind>(row, 2)?,
        time: time(row, 3)?,
        lon_deg: get(row, 4)?,
        lat_deg: get(row, 5)?,
        depth_m: get(row, 6)?,
        property: get(row, 7)?,
        value: get(row, 8)?,
        unit: get(row, 9)?,
        quality: quality(row, 10)?,
    })
}

/// A row of [`super::question::platforms`].
pub(super) fn platform(row: &Row) -> Result<Platform, ObservationError> {
    let range =
        |first: usize| Ok::<[f64; 2], ObservationError>([get(row, first)?, get(row, first + 1)?]);
    Ok(Platform {
        dataset: parsed(row, 0)?,
        platform: get(row, 1)?,
        kind: parsed::<PlatformKind>(row, 2)?,
        first: time(row, 3)?,
        last: time(row, 4)?,
        bounds_deg: bounds_deg(range(5)?, range(7)?, range(9)?),
        lon_deg: get(row, 11)?,
        lat_deg: get(row, 12)?,
        properties: get(row, 13)?,
        count: get::<i64>(row, 14)?.cast_unsigned(),
    })
}

/// A row of [`super::question::datasets`].
pub(super) fn dataset(row: &Row) -> Result<ProductId, ObservationError> {
    parsed(row, 0)
}

/// A row of [`super::question::track`].
pub(super) fn track_point(row: &Row) -> Result<TrackPoint, ObservationError> {
    Ok(TrackPoint {
        time: time(row, 0)?,
        lon_deg: get(row, 1)?,
        lat_deg: get(row, 2)?,
    })
}

fn get<'a, T: FromSql<'a>>(row: &'a Row, column: usize) -> Result<T, ObservationError> {
    row.try_get(column)
        .map_err(ObservationError::database("reading a row"))
}

fn parsed<T: std::str::FromStr<Err = contract::ContractError>>(
    row: &Row,
    column: usize,
) -> Result<T, ObservationError> {
    let text: &str = get(row, column)?;
    text.parse()
        .map_err(|e| ObservationError::damaged("a row of the database", e))
}

fn quality(row: &Row, column: usize) -> Result<Quality, ObservationError> {
    let flag: i16 = get(row, column)?;
    let flag = u8::try_from(flag).unwrap_or(u8::MAX);
    Quality::from_flag(flag).map_err(|e| ObservationError::damaged("a row of the database", e))
}

fn time(row: &Row, column: usize) -> Result<TimeMs, ObservationError> {
    let instant: SystemTime = get(row, column)?;
    let ms = match instant.duration_since(SystemTime::UNIX_EPOCH) {
        Ok(after) => i64::try_from(after.as_millis()),
        Err(before) => i64::try_from(before.duration().as_millis()).map(|ms| -ms),
    };
    let ms = ms.map_err(|e| ObservationError::damaged("a row of the database", e))?;
    TimeMs::new(ms).map_err(|e| ObservationError::damaged("a row of the database", e))
}
