//! Files that follow CF land without a profile, whichever way round they are written.

use contract::quantity::Quantity;
use contract::time::Period;
use ingest::Outcome;

use crate::fixture::{FILL, GRID, Place, SmallFile, cube_maps};
use crate::made::{Made, MadeFile, Values};

const G_PER_KG: f32 = 1e-3;

fn january_s() -> f32 {
    31.0 * 86_400.0
}

/// What the small file must be in the store, kg m-2 s-1: month 1 has 31 days, month 2 has 28.
fn expected(month: usize) -> Vec<f32> {
    let month_s = [31.0, 28.0][month - 1] * 86_400.0f64;
    let value = |row: usize, col: usize| {
        if row + col == 0 {
            f32::NAN
        } else {
            ((100 * month + 10 * row + col) as f64 * 1e-3 / month_s) as f32
        }
    };
    (0..4)
        .flat_map(|r| (0..8).map(move |c| value(r, c)))
        .collect()
}

/// Equal bits, up to one unit in the last place: the file is float32, the factor float64.
fn assert_same(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        let same = a.is_nan() && b.is_nan() || (a - b).abs() <= b.abs() * f32::EPSILON;
        assert!(same, "cell {i}: {a:e} is not {b:e}");
    }
}

/// The comparison above sees a wrong value and a missing one.
#[test]
fn the_comparison_sees_a_planted_fault() {
    let right = expected(1);
    for change in [
        |v: &mut Vec<f32>| v[5] *= 1.001,
        |v: &mut Vec<f32>| v[5] = f32::NAN,
        |v: &mut Vec<f32>| v[0] = 0.0,
    ] {
        let mut wrong = right.clone();
        change(&mut wrong);
        assert!(std::panic::catch_unwind(|| assert_same(&wrong, &right)).is_err());
    }
}

async fn assert_lands(place: &Place, file: std::path::PathBuf) {
    let outcomes = place.land(&[file]).await;
    let Outcome::Landed {
        periods,
        revised: false,
        ..
    } = &outcomes[0]
    else {
        panic!("{}", outcomes[0])
    };
    assert_eq!(
        periods,
        &[
            Period::month(2001, 1).unwrap(),
            Period::month(2001, 2).unwrap()
        ]
    );
    let manifest = place.newest("fgco2").await;
    assert_eq!(
        (manifest.quantity, manifest.grid, manifest.synthetic),
        (Quantity::CarbonFlux, GRID, false)
    );
    for month in [1, 2] {
        assert_same(&place.values(&manifest, month - 1).await, &expected(month));
        assert_eq!(manifest.steps[month - 1].valid_cells, 31);
    }
    let domain = storage::domain::read(&place.store, &manifest.domain)
        .await
        .unwrap();
    assert!(!domain[0] && domain[1..].iter().all(|cell| *cell));
}

#[tokio::test]
async fn a_classic_file_lands_in_stored_units_and_true_months() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    assert_lands(&place, place.path("a.nc")).await;
    assert!((expected(1)[1] - 101.0 * G_PER_KG / january_s()).abs() < 1e-12);
}

#[tokio::test]
async fn an_hdf5_file_lands_the_same() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    assert_lands(&place, place.path("a.h5")).await;
}

/// The same map from the south, and from 0 to 360 degrees.
#[tokio::test]
async fn direction_and_longitude_range_of_the_file_do_not_matter() {
    for hdf5 in [false, true] {
        let place = Place::new();
        let mut file = SmallFile::new();
        let plane = |values: &[f32]| -> Vec<f32> {
            (0..4)
                .flat_map(|r| (0..8).map(move |c| (3 - r, (c + 4) % 8)))
                .map(|(r, c)| values[r * 8 + c])
                .collect()
        };
        file.lat.reverse();
        file.lon = (0..8).map(|i| 22.5 + 45.0 * f64::from(i)).collect();
        file.values = [plane(&file.values[..32]), plane(&file.values[32..])].concat();
        let path = place.path("turned");
        if hdf5 {
            file.write_hdf5(&path);
        } else {
            file.write_classic(&path);
        }
        assert_lands(&place, path).await;
    }
}

#[tokio::test]
async fn the_sign_of_a_downward_flux_is_turned() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.standard_name = "surface_downward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
    file.values
        .iter_mut()
        .filter(|v| **v != FILL)
        .for_each(|v| *v = -*v);
    file.write_classic(&place.path("down.nc"));
    assert_lands(&place, place.path("down.nc")).await;
}

#[tokio::test]
async fn the_same_file_again_adds_nothing() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    place.land(&[place.path("a.nc")]).await;
    let before = place.newest("fgco2").await;
    let outcomes = place.land(&[place.path("a.nc"), place.path("a.nc")]).await;
    assert!(
        outcomes.iter().all(
            |o| matches!(o, Outcome::AlreadyLanded { manifest, .. } if *manifest == before.id())
        ),
        "{outcomes:?}"
    );
    assert_eq!(place.newest("fgco2").await, before);
}

#[tokio::test]
async fn the_same_file_twice_in_one_batch_lands_once() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let outcomes = place.land(&[place.path("a.nc"), place.path("a.nc")]).await;
    assert!(
        matches!(outcomes[0], Outcome::Landed { .. })
            && matches!(outcomes[1], Outcome::AlreadyLanded { .. }),
        "{outcomes:?}"
    );
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (1, 2));
}

#[tokio::test]
async fn a_revised_file_makes_a_new_manifest_and_the_old_one_stays() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("old.nc"));
    place.land(&[place.path("old.nc")]).await;
    let old = place.newest("fgco2").await;
    let mut file = SmallFile::new().first_month();
    file.values[1] = 7.0;
    file.values[9] = FILL;
    file.write_classic(&place.path("new.nc"));
    let outcomes = place.land(&[place.path("new.nc")]).await;
    assert!(
        matches!(outcomes[0], Outcome::Landed { revised: true, .. }),
        "{}",
        outcomes[0]
    );
    let new = place.newest("fgco2").await;
    assert_eq!((new.number, new.steps.len()), (2, 2));
    assert_eq!(
        (new.steps[0].origin.as_str(), new.steps[1].origin.as_str()),
        ("new.nc", "old.nc")
    );
    assert_eq!(
        storage::manifests::load(&place.store, &old.id())
            .await
            .unwrap(),
        old
    );
    assert_same(&place.values(&old, 0).await, &expected(1));
    let revised = place.values(&new, 0).await;
    assert!((revised[1] - 7.0 * G_PER_KG / january_s()).abs() < 1e-12 && revised[9].is_nan());
    let maps = cube_maps(&place.store, &new).await;
    assert_eq!(maps.len(), 2, "one map for each step");
    assert_same(&maps[0], &revised);
    assert_same(&maps[1], &expected(2));
}

#[tokio::test]
async fn shares_of_land_and_sea_land_as_shares_of_one_whatever_their_unit() {
    for (name, unit, stored_by, quantity) in [
        ("land_area_fraction", "%", 0.01, Quantity::LandAreaFraction),
        ("land_area_fraction", "1", 1.0, Quantity::LandAreaFraction),
        (
            "sea_area_fraction",
            "percent",
            0.01,
            Quantity::SeaAreaFraction,
        ),
        ("sea_area_fraction", "1", 1.0, Quantity::SeaAreaFraction),
    ] {
        let place = Place::new();
        let path = place.path("mask.nc");
        let share = |cell: usize| (cell % 5) as f64 / 4.0;
        // Two days alike: how far one stamp reaches, nothing would say.
        let values = (0..64).map(|cell| (share(cell % 32) / stored_by) as f32);
        let mask = Made::new(
            "mask",
            &["time", "lat", "lon"],
            Values::Floats(values.collect()),
        );
        let mask = mask.text("standard_name", name).text("units", unit);
        MadeFile::days(2).with(mask).write(&path);
        let outcomes = place.land(&[path]).await;
        let Outcome::Landed { manifest, .. } = &outcomes[0] else {
            panic!("{name} in {unit}: {}", outcomes[0])
        };
        let manifest = place.newest(manifest.product.as_str()).await;
        assert_eq!(manifest.quantity, quantity);
        for (cell, value) in place.values(&manifest, 0).await.into_iter().enumerate() {
            assert!(
                (f64::from(value) - share(cell)).abs() < 1e-7,
                "{cell}: {value}"
            );
        }
    }
}

/// As the conventions' table has its unit, and as people write it.
#[tokio::test]
async fn salinity_in_thousandths_is_the_number_that_it_is() {
    for unit in ["1e-3", "0.001", "psu"] {
        let salt = Made::new(
            "so",
            &["time", "lat", "lon"],
            Values::Floats(vec![35.25; 64]),
        );
        let salt = salt.text("standard_name", "sea_water_salinity");
        let place = Place::new();
        let file = MadeFile::days(2).with(salt.text("units", unit));
        file.write(&place.path("a.nc"));
        let outcome = place.land(&[place.path("a.nc")]).await.remove(0);
        assert!(!outcome.is_rejected(), "{unit}: {outcome}");
        let manifest = place.newest("so").await;
        assert_eq!(manifest.quantity, Quantity::Salinity);
        assert_eq!(place.values(&manifest, 0).await[7], 35.25, "{unit}");
    }
}
