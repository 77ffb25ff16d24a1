//! One statement that stores a batch and says what became of it.

use std::time::{Duration, SystemTime};

use contract::observation::Observation;
use contract::time::TimeMs;

use super::pool::Connections;
use crate::error::ObservationError;
use crate::store::Counts;

/// Rows of one statement: some megabytes, some tenths of a second.
pub(super) const ROWS: usize = 5000;

/// Rows come sorted by key, so that two writers lock them in one order and neither waits for the other for ever. A row
/// that says the same is not rewritten. A row that was inserted has no earlier version (`xmax` is 0).
const UPSERT: &str = r"
WITH written AS (
    INSERT INTO observation (dataset, platform, kind, obs_time, place, depth_m, property, value, unit, quality)
    SELECT dataset, platform, kind, obs_time, ST_SetSRID(ST_MakePoint(lon, lat), 4326), depth_m, property, value, unit, quality
    FROM UNNEST($1::text[], $2::text[], $3::text[], $4::timestamptz[], $5::float8[], $6::float8[], $7::float8[],
        $8::text[], $9::float8[], $10::text[], $11::int2[])
        AS given (dataset, platform, kind, obs_time, lon, lat, depth_m, property, value, unit, quality)
    ON CONFLICT (obs_time, dataset, platform, property, depth_m) DO UPDATE
    SET kind = EXCLUDED.kind, place = EXCLUDED.place, value = EXCLUDED.value, unit = EXCLUDED.unit,
        quality = EXCLUDED.quality
    WHERE (observation.kind, ST_X(observation.place), ST_Y(observation.place), observation.value, observation.unit,
        observation.quality)
        IS DISTINCT FROM (EXCLUDED.kind, ST_X(EXCLUDED.place), ST_Y(EXCLUDED.place), EXCLUDED.value, EXCLUDED.unit,
        EXCLUDED.quality)
    RETURNING (xmax = 0) AS is_new
)
SELECT count(*) FILTER (WHERE is_new), count(*) FILTER (WHERE NOT is_new) FROM written";

/// Stores rows that are sorted by key, each key once.
pub(super) async fn run(
    connections: &Connections,
    rows: &[Observation],
) -> Result<Counts, ObservationError> {
    let action = "storing observations";
    let texts = |text: fn(&Observation) -> &str| rows.iter().map(text).collect::<Vec<&str>>();
    let numbers = |number: fn(&Observation) -> f64| rows.iter().map(number).collect::<Vec<f64>>();
    let datasets = texts(|o| o.dataset.as_str());
    let platforms = texts(|o| o.platform.as_str());
    let kinds = texts(|o| o.kind.as_str());
    let times: Vec<SystemTime> = rows.iter().map(|o| system_time(o.time)).collect();
    let (lons, lats) = (numbers(|o| o.lon_deg), numbers(|o| o.lat_deg));
    let (depths, values) = (numbers(|o| o.depth_m), numbers(|o| o.value));
    let properties = texts(|o| o.property.as_str());
    let units = texts(|o| o.unit.as_str());
    let qualities: Vec<i16> = rows.iter().map(|o| o.quality.flag().into()).collect();
    let given: [&(dyn tokio_postgres::types::ToSql + Sync); 11] = [
        &datasets,
        &platforms,
        &kinds,
        &times,
        &lons,
        &lats,
        &depths,
        &properties,
        &values,
        &units,
        &qualities,
    ];
    let client = connections.client().await?;
    let asked = async {
        let statement = client.prepare_cached(UPSERT).await?;
        client.query_one(&statement, &given).await
    };
    let answer = connections.within(asked).await;
    let row = connections.settle(action, client, answer)?;
    let count = |column: usize| row.try_get::<_, i64>(column).map(i64::cast_unsigned);
    let failed = || ObservationError::database(action);
    let (new, replaced) = (count(0).map_err(failed())?, count(1).map_err(failed())?);
    Ok(Counts {
        new,
        replaced,
        same: (rows.len() as u64).saturating_sub(new + replaced),
    })
}

/// An instant as the driver takes it.
pub(super) fn system_time(time: TimeMs) -> SystemTime {
    let distance = Duration::from_millis(time.ms().unsigned_abs());
    if time.ms() >= 0 {
        SystemTime::UNIX_EPOCH + distance
    } else {
        SystemTime::UNIX_EPOCH - distance
    }
}
