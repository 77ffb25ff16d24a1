//! Products for the tests: synthetic fluxes whose budgets are known, and the real Takahashi (2009) grids.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use compute::{Engine, budget};
use contract::budget::{BudgetAnswer, BudgetQuery};
use contract::digest::Digest;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::time::{Period, TimeStep};
use storage::{Store, domain, fields, manifests};

pub(crate) const ONE_DEGREE: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

pub(crate) fn product(name: &str) -> ProductId {
    name.parse().unwrap()
}

pub(crate) fn parts(partitions: usize) -> NonZeroUsize {
    NonZeroUsize::new(partitions).unwrap()
}

/// A folder as store; the folder is gone with the returned guard.
pub(crate) fn folder_store() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

/// Months of a year.
pub(crate) fn months(year: i32) -> Vec<Period> {
    (1..=12)
        .map(|month| Period::month(year, month).unwrap())
        .collect()
}

/// Stores a product of some steps; no cube follows it.
pub(crate) async fn land(
    store: &Store,
    id: &ProductId,
    quantity: Quantity,
    grid: Grid,
    steps: &[(Period, Vec<f32>)],
) -> Manifest {
    land_each(store, id, quantity, grid, steps.iter().cloned()).await
}

/// The same of steps that are made one after the other.
pub(crate) async fn land_each(
    store: &Store,
    id: &ProductId,
    quantity: Quantity,
    grid: Grid,
    steps: impl Iterator<Item = (Period, Vec<f32>)>,
) -> Manifest {
    let mut cells = vec![false; grid.cell_count()];
    let mut listed = vec![];
    for (index, (period, values)) in steps.enumerate() {
        cells
            .iter_mut()
            .zip(&values)
            .for_each(|(cell, value)| *cell |= !value.is_nan());
        listed.push(Step {
            masked: None,
            period,
            field: fields::write(store, id, &grid, &values, period)
                .await
                .unwrap(),
            raw_sha256: Digest::of(&index.to_le_bytes()),
            origin: format!("step-{index}.nc"),
            valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
            contributed: None,
        });
    }
    let latest = manifests::latest(store, id).await.unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product: id.clone(),
        number: latest.map_or(1, |latest| latest.number + 1),
        title: format!("Test {id}"),
        quantity,
        synthetic: true,
        source: "made by a test".to_owned(),
        grid,
        steps: listed,
        domain: domain::write(store, id, &cells).await.unwrap(),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    };
    manifests::commit(store, &manifest).await.unwrap();
    manifest
}

/// A year of fluxes with land, gaps and seasons, kg m⁻² s⁻¹; sums of floats over it depend on their order.
pub(crate) fn wavy_year(grid: &Grid) -> Vec<(Period, Vec<f32>)> {
    let value = |month: usize, index: usize| {
        let place = grid.cell_center(
            (index / grid.cols as usize) as u32,
            (index % grid.cols as usize) as u32,
        );
        let land = (place.lon / 40.0).sin() * (place.lat / 25.0).cos() > 0.55;
        let gap = (index * 7919 + month * 104_729).is_multiple_of(17);
        let season =
            (month as f64 / 12.0 * std::f64::consts::TAU).cos() * place.lat.to_radians().sin();
        let flux = 1.3e-9 * (season + 0.4 * (place.lon / 17.0).sin() - 0.21);
        if land || gap { f32::NAN } else { flux as f32 }
    };
    let month = |(month, period)| {
        (
            period,
            (0..grid.cell_count())
                .map(|index| value(month, index))
                .collect(),
        )
    };
    months(2000).into_iter().enumerate().map(month).collect()
}

/// The query for a region's whole period.
pub(crate) fn total(id: &ProductId, region: &str) -> BudgetQuery {
    BudgetQuery {
        product: id.clone(),
        region: region.parse().unwrap(),
        region_name: region.to_owned(),
        from: None,
        to: None,
        step: TimeStep::Total,
        earth: Earth::Wgs84,
        cells: Cells::Whole,
        ocean: None,
        errors: None,
        river: None,
        parts: None,
    }
}

pub(crate) async fn ask(engine: &Engine, query: &BudgetQuery) -> BudgetAnswer {
    budget(engine, query).await.unwrap()
}

/// The twelve real grids, kg m⁻² s⁻¹.
///
/// Read as the demonstration's profile reads them: labels are north-west corners, the reference year is 2000, the unit
/// is g C m⁻² a month.
pub(crate) fn takahashi_year() -> Vec<(Period, Vec<f32>)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(test_data::fluxengine("takahashi09"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "nc"));
    files.sort();
    assert_eq!(files.len(), 12, "the folder holds one file a month");
    files
        .iter()
        .zip(months(2000))
        .map(|(file, period)| (period, read_flux(file, period)))
        .collect()
}

fn read_flux(file: &Path, period: Period) -> Vec<f32> {
    const FILL: f32 = -999.0;
    let mut reader = netcdf3::FileReader::open(file).unwrap();
    let latitudes = reader.read_var_f32("latitude").unwrap();
    assert_eq!(
        (latitudes[0], latitudes[179]),
        (90.0, -89.0),
        "labels are north-west corners, row 0 north"
    );
    let grams_a_month = reader.read_var_f32("CO2flux").unwrap();
    let kg_a_second = |value: f32| (f64::from(value) * 1e-3 / period.seconds()) as f32;
    grams_a_month
        .into_iter()
        .map(|value| {
            if value == FILL {
                f32::NAN
            } else {
                kg_a_second(value)
            }
        })
        .collect()
}
