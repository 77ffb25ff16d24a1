//! The real files: numbers against those of another reader.
//!
//! The FluxEngine 4.2.1 wheel's `verification_data` (`test_data::fluxengine`) and the sets that only listed tests may do
//! without (`test_data::set`). Expected numbers: Python netCDF4 1.7 (masked by its own rules), numpy in float64, rows
//! turned north first, multiplied by the unit factor that the comment names.

use std::path::{Path, PathBuf};

use contract::event::RejectReason;
use contract::grid::Grid;
use contract::time::Period;
use ingest::{Outcome, Profile};
use test_data::{fluxengine, set};

use crate::fixture::{Place, refusal};

const ONE_DEGREE: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

pub(crate) fn files(folder: &Path, part: &str) -> Vec<PathBuf> {
    let is_wanted = |path: &PathBuf| {
        path.extension().is_some_and(|e| e == "nc") && path.to_string_lossy().contains(part)
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(is_wanted)
        .collect();
    files.sort();
    files
}

pub(crate) fn near(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 1e-6,
        "{found:e} is not {expected:e}"
    );
}

#[tokio::test]
async fn takahashi_lands_with_corner_labels_and_the_reference_year() {
    let folder = fluxengine("takahashi09");
    let place = Place::new();
    let outcomes = place.land(&files(&folder, "")).await;
    assert_eq!(outcomes.len(), 12);
    assert!(
        outcomes
            .iter()
            .all(|o| matches!(o, Outcome::Landed { revised: false, .. })),
        "{outcomes:?}"
    );
    let manifest = place.newest("takahashi09-flux").await;
    assert_eq!(
        (manifest.number, manifest.steps.len(), manifest.series.len()),
        (1, 12, 0)
    );
    assert_eq!(
        manifest.grid, ONE_DEGREE,
        "the first row's northern edge is its label, 90"
    );
    for (month, step) in (1..).zip(&manifest.steps) {
        assert_eq!(step.period, Period::month(2000, month).unwrap());
        assert_eq!(step.valid_cells, 36_229);
    }
    assert_eq!(manifest.steps[1].period.seconds(), 29.0 * 86_400.0);
    // February: CO2flux[0, 45, 10], [0, 90, 180], [0, 130, 300] and the sum over all cells, g C m-2 month-1.
    let values = place.values(&manifest, 1).await;
    let factor = 1e-3 / (29.0 * 86_400.0);
    let at = |row: usize, col: usize| f64::from(values[row * 360 + col]);
    near(at(45, 10), -1.911_130_309_104_919_4 * factor);
    near(at(90, 180), 0.354_327_917_098_999 * factor);
    near(at(130, 300), -0.748_544_633_388_519_3 * factor);
    let sum: f64 = values
        .iter()
        .filter(|v| !v.is_nan())
        .map(|v| f64::from(*v))
        .sum();
    near(sum, -22_455.334_611_374_605 * factor);
    // The whole year over the WGS84 ellipsoid, Tg C: the grid's own integral, which the design states as -1404.
    let mut total_kg = 0.0;
    for (index, step) in manifest.steps.iter().enumerate() {
        let values = place.values(&manifest, index).await;
        for row in 0..180u32 {
            let area = manifest
                .grid
                .cell_area_m2(row, contract::earth::Earth::Wgs84);
            let row = &values[row as usize * 360..][..360];
            total_kg += row
                .iter()
                .filter(|v| !v.is_nan())
                .map(|v| f64::from(*v))
                .sum::<f64>()
                * area
                * step.period.seconds();
        }
    }
    assert!(
        (total_kg / 1e9 + 1404.0).abs() < 0.002 * 1404.0,
        "{}",
        total_kg / 1e9
    );
}

/// One family: folder, product, number of files, and July as valid cells, mean and one cell (row 100, column 30).
struct Family {
    folder: PathBuf,
    product: &'static str,
    files: usize,
    july_valid_cells: u64,
    july_mean: f64,
    july_cell: Option<f64>,
}

async fn assert_family(family: Family) {
    let folder = family.folder;
    let place = Place::new();
    let outcomes = place.land(&files(&folder, "")).await;
    assert_eq!(outcomes.len(), family.files);
    assert!(
        outcomes.iter().all(|o| matches!(o, Outcome::Landed { .. })),
        "{outcomes:?}"
    );
    let manifest = place.newest(family.product).await;
    assert_eq!(
        (manifest.grid, manifest.steps.len()),
        (ONE_DEGREE, family.files)
    );
    let july = manifest
        .steps
        .iter()
        .position(|s| s.period == Period::month(2010, 7).unwrap())
        .unwrap();
    assert_eq!(manifest.steps[july].valid_cells, family.july_valid_cells);
    let values = place.values(&manifest, july).await;
    let sum: f64 = values
        .iter()
        .filter(|v| !v.is_nan())
        .map(|v| f64::from(*v))
        .sum();
    near(sum / family.july_valid_cells as f64, family.july_mean);
    let cell = f64::from(values[100 * 360 + 30]);
    match family.july_cell {
        Some(expected) => near(cell, expected),
        None => assert!(cell.is_nan()),
    }
}

#[tokio::test]
async fn sst_lands_although_its_attributes_are_mixed_up() {
    let folder = fluxengine("SST/2010");
    let (july_mean, july_cell) = (2.906_927_020e2, Some(3.011_732_832e2));
    assert_family(Family {
        folder,
        product: "sst-2010",
        files: 12,
        july_valid_cells: 36_202,
        july_mean,
        july_cell,
    })
    .await;
}

#[tokio::test]
async fn wind_lands() {
    let folder = fluxengine("globwave/2010");
    let (july_mean, july_cell) = (7.521_996_035, Some(8.009_024_091));
    assert_family(Family {
        folder,
        product: "wind-2010",
        files: 12,
        july_valid_cells: 35_987,
        july_mean,
        july_cell,
    })
    .await;
}

/// mg m-3 are 1e-6 kg m-3.
#[tokio::test]
async fn chlorophyll_lands_without_axes_time_or_unit_of_its_own() {
    let folder = fluxengine("biology_ESACCI");
    let (july_mean, july_cell) = (5.600_983_939e-7, Some(1.343_827_844e-7));
    assert_family(Family {
        folder,
        product: "chlorophyll-2010",
        files: 12,
        july_valid_cells: 31_601,
        july_mean,
        july_cell,
    })
    .await;
}

/// A microatmosphere is 0.101325 Pa.
#[tokio::test]
async fn socat_lands_with_the_month_of_its_file_names() {
    let Some(folder) = set("socatv4_fco2_2010_1deg_monthly") else {
        return;
    };
    let (july_mean, july_cell) = (3.592_563_823e1, Some(4.130_017_266e1));
    assert_family(Family {
        folder,
        product: "socatv4-fco2-2010",
        files: 12,
        july_valid_cells: 43_299,
        july_mean,
        july_cell,
    })
    .await;
}

#[tokio::test]
async fn ice_lands() {
    let folder = fluxengine("ice/2010");
    let july_mean = 3.382_397_744e-1;
    assert_family(Family {
        folder,
        product: "ice-2010",
        files: 12,
        july_valid_cells: 17_649,
        july_mean,
        july_cell: None,
    })
    .await;
}

#[tokio::test]
async fn the_share_of_land_lands_as_one_map() {
    let place = Place::new();
    let outcomes = place.land(&[test_data::fluxengine_land()]).await;
    assert!(
        matches!(outcomes[0], Outcome::Landed { .. }),
        "{}",
        outcomes[0]
    );
    let manifest = place.newest("onedeg-land").await;
    assert_eq!((manifest.grid, manifest.steps.len()), (ONE_DEGREE, 1));
    let values = place.values(&manifest, 0).await;
    let mean = values.iter().copied().map(f64::from).sum::<f64>() / 64_800.0;
    near(mean, 0.330_960_635_940_334_5);
    // Greece, row 56 from the north.
    near(f64::from(values[56 * 360 + 215]), 0.639_401_197_433_471_7);
}

#[tokio::test]
async fn air_pressure_lands() {
    let folder = fluxengine("air_pressure/2010");
    let (july_mean, july_cell) = (1.007_509_890e5, Some(1.012_988_838e5));
    assert_family(Family {
        folder,
        product: "air-pressure-2010",
        files: 12,
        july_valid_cells: 64_800,
        july_mean,
        july_cell,
    })
    .await;
}

#[tokio::test]
async fn wave_height_lands() {
    let folder = fluxengine("sig_wv_ht/2010");
    let (july_mean, july_cell) = (2.564_285_875, Some(2.341_661_561));
    assert_family(Family {
        folder,
        product: "wave-height-2010",
        files: 12,
        july_valid_cells: 36_093,
        july_mean,
        july_cell,
    })
    .await;
}

/// Dimensions are longitude, latitude, time; mm a day are 1/86400 kg m-2 s-1.
#[tokio::test]
async fn rain_lands_with_longitude_first() {
    let folder = fluxengine("rain_gpcp/2010");
    let (july_mean, july_cell) = (2.688_685_413e-5, Some(2.518_125_706e-5));
    assert_family(Family {
        folder,
        product: "rain-gpcp-2010",
        files: 12,
        july_valid_cells: 64_800,
        july_mean,
        july_cell,
    })
    .await;
}

/// 1 January 2002: 2552 of 41 x 81 cells, mean and the north-eastern cell of the eastward part.
#[tokio::test]
async fn daily_currents_land_as_a_region() {
    let Some(folder) = set("currents_globcurrent_agulhas_2002_daily") else {
        return;
    };
    let place = Place::new();
    let outcomes = place.land(&files(&folder, "")).await;
    assert!(
        outcomes.len() == 31 && outcomes.iter().all(|o| !o.is_rejected()),
        "{outcomes:?}"
    );
    let manifest = place.newest("globcurrent-east").await;
    let grid = Grid {
        rows: 41,
        cols: 81,
        north_deg: -30.0,
        west_deg: 14.75,
        dlat_deg: 0.25,
        dlon_deg: 0.25,
    };
    assert_eq!(
        (
            manifest.grid,
            manifest.steps.len(),
            manifest.steps[0].valid_cells
        ),
        (grid, 31, 2552)
    );
    assert_eq!(
        manifest.steps[30].period.to_string(),
        "2002-01-31T00:00:00Z/2002-02-01T00:00:00Z"
    );
    let values = place.values(&manifest, 0).await;
    let sum: f64 = values
        .iter()
        .filter(|v| !v.is_nan())
        .map(|v| f64::from(*v))
        .sum();
    near(sum / 2552.0, -1.344_207_754e-2);
    near(f64::from(values[80]), -3.567_620_367e-2);
}

#[tokio::test]
async fn one_file_can_land_as_several_products_by_profile() {
    let folder = fluxengine("takahashi09");
    let place = Place::new();
    let profile = Profile::find("takahashi09-pco2").unwrap();
    let outcomes = place
        .land_with(&files(&folder, "01jan"), Some(&profile))
        .await;
    assert!(
        matches!(&outcomes[0], Outcome::Landed { .. }),
        "{}",
        outcomes[0]
    );
    let manifest = place.newest("takahashi09-pco2").await;
    let values = place.values(&manifest, 0).await;
    assert!(
        values
            .iter()
            .filter(|v| !v.is_nan())
            .all(|v| (5.0..90.0).contains(v)),
        "uatm as Pa"
    );
}

#[tokio::test]
async fn swaths_are_refused_as_swaths() {
    for set in ["sst_ghrsst_l2p", "wind_ascat_l2"] {
        let Some(folder) = test_data::set(set) else {
            continue;
        };
        for file in files(&folder, "") {
            let (reason, line) = refusal(&Place::new().land(&[file]).await);
            assert_eq!(reason, RejectReason::Grid, "{line}");
            assert!(line.contains("swath"), "{line}");
        }
    }
}

#[tokio::test]
async fn points_profiles_and_moorings_are_refused_with_a_line() {
    for set in [
        "buoys_gtmba_sst_dsg",
        "profiles_ecofoci_dsg",
        "ship_tracks_socat_dsg",
        "tropical_pacific_mooring_co2",
    ] {
        let Some(folder) = test_data::set(set) else {
            continue;
        };
        for file in files(&folder, "") {
            let name = file.file_name().unwrap().to_owned();
            let outcomes = Place::new().land(&[file]).await;
            // A mask of the sea is a map that holds at any time; areas of cells are not told to.
            if name == "seamask.nc" {
                assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
                continue;
            }
            let (reason, line) = refusal(&outcomes);
            let wanted = if name == "earth_m2.nc" {
                RejectReason::Time
            } else {
                RejectReason::NoVariable
            };
            assert_eq!(reason, wanted, "{line}");
        }
    }
}
