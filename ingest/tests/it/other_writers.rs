//! Committed files made by the netCDF library (`tests/data/make.py`): two packed, south first, 0 to 360 degrees, and one in szip.

use std::path::{Path, PathBuf};

use contract::event::RejectReason;
use contract::quantity::Quantity;
use contract::time::Period;
use ingest::Profile;

use crate::fixture::{Place, refusal};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// What `make.py` packed, unpacked by hand: 0.01 (float32) times the stored number, plus 20 degC.
fn expected(month: usize, row: usize, col: usize) -> Option<f64> {
    let (south, east) = (5 - row, (col + 6) % 12);
    let stored = (((month * 6 + south) * 12 + east) * 10) as f64 - 700.0;
    let is_gap = (month, south, east) == (0, 0, 0) || (month, south, east) == (1, 5, 11);
    (!is_gap).then(|| stored * f64::from(0.01f32) + 20.0 + 273.15)
}

async fn assert_holds_the_map(place: &Place, periods: [Period; 2]) {
    let manifest = place.newest("sst").await;
    assert_eq!(manifest.quantity, Quantity::SeaSurfaceTemperature);
    let grid = manifest.grid;
    assert_eq!(
        (grid.rows, grid.cols, grid.north_deg, grid.west_deg),
        (6, 12, 90.0, -180.0)
    );
    for (month, period) in periods.into_iter().enumerate() {
        assert_eq!(manifest.steps[month].period, period);
        let values = place.values(&manifest, month).await;
        for row in 0..6 {
            for col in 0..12 {
                let found = f64::from(values[row * 12 + col]);
                match expected(month, row, col) {
                    Some(expected) => assert!(
                        (found - expected).abs() < 3e-5,
                        "{month} {row} {col}: {found} {expected}"
                    ),
                    None => assert!(found.is_nan(), "{month} {row} {col}"),
                }
            }
        }
    }
}

#[tokio::test]
async fn a_netcdf4_file_of_the_netcdf_library_lands_with_its_time_bounds() {
    let place = Place::new();
    let outcomes = place.land(&[data("packed-netcdf4.nc")]).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    assert_holds_the_map(
        &place,
        [
            Period::month(2003, 5).unwrap(),
            Period::month(2003, 6).unwrap(),
        ],
    )
    .await;
}

/// The library has a name for szip, and is built without it.
#[tokio::test]
async fn szip_is_refused_by_its_name_and_not_as_damage() {
    let place = Place::new();
    let (reason, line) = refusal(&place.land(&[data("szip.nc")]).await);
    assert_eq!(reason, RejectReason::Unreadable, "{line}");
    assert!(line.contains("szip, which is not built in"), "{line}");
    assert!(!line.contains("damaged"), "{line}");
}

#[tokio::test]
async fn a_cdf5_file_with_one_record_variable_lands_by_a_users_profile() {
    let profile = r#"
        name = "mine"
        product = "sst"
        title = "Mine"
        source = "tests/data/make.py"
        quantity = "sea_surface_temperature"
        [variable]
        name = "sst"
        [time]
        from = "month_number"
        covers = "month"
        year = 2003
    "#;
    let profile = Profile::parse("mine", profile).unwrap();
    let place = Place::new();
    let outcomes = place
        .land_with(&[data("packed-cdf5.nc")], Some(&profile))
        .await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    assert_holds_the_map(
        &place,
        [
            Period::month(2003, 1).unwrap(),
            Period::month(2003, 2).unwrap(),
        ],
    )
    .await;
}

/// The same bytes by a corrected profile are a revision, not the same file again.
#[tokio::test]
async fn a_corrected_profile_revises_what_the_same_file_landed() {
    let text = |unit: &str| {
        format!(
            "name = 'mine'\nproduct = 'sst'\ntitle = 'Mine'\nsource = 's'\nquantity = 'sea_surface_temperature'\n\
             [variable]\nname = 'sst'\nunit = '{unit}'\nadd_offset = 290.0\n[time]\nfrom = 'month_number'\ncovers = 'month'\nyear = 2003\n"
        )
    };
    let place = Place::new();
    let wrong = Profile::parse("mine", &text("K")).unwrap();
    let right = Profile::parse("mine", &text("K").replace("290.0", "280.0")).unwrap();
    let files = [data("packed-cdf5.nc")];
    for (profile, revised) in [(&wrong, false), (&right, true)] {
        let outcomes = place.land_with(&files, Some(profile)).await;
        assert!(
            matches!(&outcomes[0], ingest::Outcome::Landed { revised: r, .. } if *r == revised),
            "{}",
            outcomes[0]
        );
    }
    let again = place.land_with(&files, Some(&right)).await;
    assert!(
        matches!(again[0], ingest::Outcome::AlreadyLanded { .. }),
        "{}",
        again[0]
    );
    assert_eq!(place.newest("sst").await.number, 2);
}
