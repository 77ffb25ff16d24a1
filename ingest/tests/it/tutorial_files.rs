//! One file of each family of the FluxEngine tutorials: numbers against those of Python netCDF4, rows turned north first;
//! temperatures in degrees Celsius have 273.15 added.

use contract::time::Period;
use ingest::Outcome;
use test_data::fluxengine;

use crate::fixture::Place;
use crate::real_files::{files, near};

/// A file and its only step.
struct OneFile {
    folder: &'static str,
    /// A part of its name.
    part: &'static str,
    product: &'static str,
    month: (i32, u32),
    valid_cells: u64,
    mean: f64,
    /// The cell of the middle row, a quarter of the columns from the west.
    cell: f64,
}

async fn assert_lands(expected: OneFile) {
    let folder = fluxengine(expected.folder);
    let place = Place::new();
    let outcomes = place.land(&files(&folder, expected.part)).await;
    assert!(
        matches!(outcomes.as_slice(), [Outcome::Landed { .. }]),
        "{outcomes:?}"
    );
    let manifest = place.newest(expected.product).await;
    let step = &manifest.steps[0];
    let (year, month) = expected.month;
    assert_eq!(step.period, Period::month(year, month).unwrap());
    assert_eq!(step.valid_cells, expected.valid_cells);
    let values = place.values(&manifest, 0).await;
    let valid = values.iter().filter(|v| !v.is_nan());
    let sum: f64 = valid.map(|v| f64::from(*v)).sum();
    near(sum / expected.valid_cells as f64, expected.mean);
    let (rows, cols) = (manifest.grid.rows as usize, manifest.grid.cols as usize);
    near(f64::from(values[rows / 2 * cols + cols / 4]), expected.cell);
}

#[tokio::test]
async fn salinity_lands_with_the_month_of_its_name_and_a_middle_year() {
    assert_lands(OneFile {
        folder: "../../tutorials/01_introduction/data/WOA_salinity",
        part: "_s07_",
        product: "woa18-salinity",
        month: (2011, 7),
        valid_cells: 41_088,
        mean: 3.386_726_829e1,
        cell: 34.468_795_9,
    })
    .await;
}

#[tokio::test]
async fn reynolds_temperature_lands_in_kelvin() {
    assert_lands(OneFile {
        folder: "../../tutorials/02_using_insitu_data/reynolds_avhrr_only_monthly_calculated_tmh/2013",
        part: "20130701",
        product: "reynolds-sst",
        month: (2013, 7),
        valid_cells: 45_152,
        mean: 2.870_349_965e2,
        cell: 294.431_572_3,
    })
    .await;
}

#[tokio::test]
async fn ccmp_wind_lands_without_unit_or_time_of_its_own() {
    assert_lands(OneFile {
        folder: "../../tutorials/04_N2O_fluxes/data",
        part: "ccmp",
        product: "ccmp-wind",
        month: (2014, 10),
        valid_cells: 56_160,
        mean: 3.945_135_435,
        cell: 5.687_315_94,
    })
    .await;
}

#[tokio::test]
async fn air_pressure_of_another_year_does_not_land_in_that_of_2010() {
    assert_lands(OneFile {
        folder: "../../tutorials/04_N2O_fluxes/data",
        part: "OCF-PRE",
        product: "air-pressure-oceanflux",
        month: (2014, 10),
        valid_cells: 64_800,
        mean: 1.009_305_732e5,
        cell: 101_270.464_36,
    })
    .await;
}

#[tokio::test]
async fn the_temperature_climatology_lands_on_a_quarter_of_a_degree() {
    assert_lands(OneFile {
        folder: "SST_gradients",
        part: "07-UKMO",
        product: "ostia-sst-climatology",
        month: (2008, 7),
        valid_cells: 691_687,
        mean: 2.871_335_778e2,
        cell: 296.279_998_78,
    })
    .await;
}
