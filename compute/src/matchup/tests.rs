//! A small product in memory against observations whose partners are known by hand.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Step};
use contract::observation::{PlatformKind, Quality};
use contract::quantity::Quantity;
use contract::time::Period;
use storage::fields;

use super::*;
use crate::ErrorClass;

/// Four cells of 90 x 90 degrees north of the equator.
const GRID: Grid = Grid {
    rows: 1,
    cols: 4,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 90.0,
    dlon_deg: 90.0,
};

/// January and February 2010, K; the last cell has no data in February.
async fn product(store: &Store) -> Manifest {
    let product: ProductId = "sst".parse().unwrap();
    let months = [
        (1, [280.0, 281.0, 282.0, 283.0]),
        (2, [290.0, 291.0, 292.0, f32::NAN]),
    ];
    let mut steps = vec![];
    for (month, values) in months {
        let period = Period::month(2010, month).unwrap();
        let field = fields::write(store, &product, &GRID, &values, period);
        steps.push(Step {
            masked: None,
            period,
            field: field.await.unwrap(),
            raw_sha256: Digest::of(b""),
            origin: "f.nc".into(),
            valid_cells: 4,
            contributed: None,
        });
    }
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: "Sea".into(),
        quantity: Quantity::SeaSurfaceTemperature,
        synthetic: false,
        source: String::new(),
        grid: GRID,
        steps,
        domain: ObjectKey::domain(&product, &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

fn observation(time: &str, lon_deg: f64, lat_deg: f64, value: f64) -> Observation {
    Observation {
        dataset: "ships".parse().unwrap(),
        platform: "s".to_owned(),
        kind: PlatformKind::Ship,
        time: time.parse().unwrap(),
        lon_deg,
        lat_deg,
        depth_m: 0.0,
        property: "sea_surface_temperature".to_owned(),
        value,
        unit: "K".to_owned(),
        quality: Quality::Good,
    }
}

fn near(found: Option<f64>, expected: f64) {
    assert!((found.unwrap() - expected).abs() < 1e-9, "{found:?}");
}

#[tokio::test]
async fn each_observation_meets_its_cell_and_month_and_the_rest_is_counted() {
    let store = Store::memory();
    let manifest = product(&store).await;
    let observations = [
        observation("2010-01-10", -100.0, 45.0, 279.0),
        observation("2010-02-10", 10.0, 45.0, 295.0),
        observation("2010-02-10", 100.0, 45.0, 280.0),
        observation("2010-01-10", 100.0, 45.0, 283.0),
        observation("2010-01-10", 10.0, -45.0, 280.0),
        observation("2011-01-10", 10.0, 45.0, 280.0),
    ];
    let found = matchup(&store, &manifest, &observations, TimeMatch::Nearest)
        .await
        .unwrap();
    let pairs: Vec<_> = found
        .rows
        .iter()
        .map(|row| {
            (
                (row.observed + 273.15).round(),
                (row.gridded + 273.15).round(),
            )
        })
        .collect();
    assert_eq!(pairs, [(279.0, 280.0), (295.0, 292.0), (283.0, 283.0)]);
    let left_out = LeftOut {
        other_time: 1,
        outside: 1,
        no_data: 1,
        ..LeftOut::default()
    };
    assert_eq!((found.left_out, found.unit.as_str()), (left_out, "°C"));
    // Differences 1, -3 and 0.
    near(found.statistics.bias, -2.0 / 3.0);
    near(found.statistics.rmse, (10.0f64 / 3.0).sqrt());
}

#[test]
fn what_failed_a_test_or_lies_deep_is_not_held_against_a_surface() {
    let at = |depth_m, quality| Observation {
        depth_m,
        quality,
        ..observation("2010-01-10", 0.0, 45.0, 280.0)
    };
    let mut left_out = LeftOut::default();
    let mut takes = |depth_m, quality| Fit::default().takes(&at(depth_m, quality), &mut left_out);
    assert!(takes(10.0, Quality::Good) && takes(-10.0, Quality::NotEvaluated));
    assert!(!takes(0.0, Quality::Questionable) && !takes(5.0, Quality::Bad));
    assert!(!takes(2000.0, Quality::Bad) && !takes(10.5, Quality::Good));
    assert_eq!((left_out.quality, left_out.depth), (3, 1));
    let told = Fit::default().to_string();
    assert_eq!(
        told,
        "at most 10 m deep and of quality not_evaluated or better"
    );
}

#[tokio::test]
async fn between_two_months_the_value_is_between_theirs() {
    let store = Store::memory();
    let manifest = product(&store).await;
    // Half way between 16 January 12:00 and 15 February 0:00.
    let middle = [observation("2010-01-31T06:00:00Z", -100.0, 45.0, 285.0)];
    let found = matchup(&store, &manifest, &middle, TimeMatch::Linear)
        .await
        .unwrap();
    near(found.statistics.bias, 0.0);
    let gap = [observation("2010-01-31T06:00:00Z", 100.0, 45.0, 285.0)];
    let found = matchup(&store, &manifest, &gap, TimeMatch::Linear)
        .await
        .unwrap();
    assert_eq!(
        (found.rows.len(), found.left_out.no_data),
        (0, 1),
        "half of it is missing"
    );
}

#[tokio::test]
async fn apples_are_not_compared_with_pears() {
    let store = Store::memory();
    let manifest = product(&store).await;
    let good = observation("2010-01-10", 10.0, 45.0, 280.0);
    let wind = Observation {
        property: "wind_speed".to_owned(),
        unit: "m s-1".to_owned(),
        ..good.clone()
    };
    for observations in [vec![], vec![wind.clone()], vec![good.clone(), wind]] {
        let error = matchup(&store, &manifest, &observations, TimeMatch::Nearest)
            .await
            .unwrap_err();
        assert_eq!(error.class(), ErrorClass::BadRequest, "{error}");
        let is_none = error.to_string().contains("there is no observation to");
        assert_eq!(is_none, observations.is_empty(), "{error}");
    }
    assert!(
        matchup(&store, &manifest, &[good], TimeMatch::Nearest)
            .await
            .is_ok()
    );
}

#[tokio::test]
async fn directions_are_not_subtracted() {
    let store = Store::memory();
    let manifest = Manifest {
        quantity: Quantity::open("wind_from_direction", "degree", "Wind direction").unwrap(),
        ..product(&store).await
    };
    let wind = Observation {
        property: "wind_from_direction".to_owned(),
        unit: "degree".to_owned(),
        ..observation("2010-01-10", 10.0, 45.0, 280.0)
    };
    let error = matchup(&store, &manifest, &[wind], TimeMatch::Nearest).await;
    let error = error.unwrap_err();
    assert_eq!(error.class(), ErrorClass::BadRequest, "{error}");
    assert!(error.to_string().contains("go round"), "{error}");
}
