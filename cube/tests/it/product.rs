//! Products made up for tests.

use std::sync::Arc;

use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::Description;
use storage::Store;

/// Cells on a grid that begins at the north pole and the date line.
pub(crate) fn grid(rows: u32, cols: u32) -> Grid {
    Grid {
        rows,
        cols,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 180.0 / f64::from(rows),
        dlon_deg: 360.0 / f64::from(cols),
    }
}

pub(crate) fn description(quantity: Quantity, grid: Grid) -> Description {
    Description {
        product: "p".parse().unwrap(),
        title: "P".to_owned(),
        quantity,
        synthetic: true,
        source: "a test".to_owned(),
        grid,
        version: None,
        statistic: None,
    }
}

/// Values that differ from cell to cell and from seed to seed, some of them none, zeros of both signs among them.
pub(crate) fn values(grid: &Grid, seed: u32) -> Arc<[f32]> {
    let value = |cell: u32| match cell % 11 {
        0 => f32::NAN,
        1 => -0.0,
        2 => 0.0,
        3 => f32::from_bits(1),
        _ => (cell.wrapping_mul(0x9E37_79B9) ^ seed.wrapping_mul(0x85EB_CA6B)) as f32,
    };
    (0..grid.cell_count() as u32).map(value).collect()
}

pub(crate) fn month(month: u32) -> Period {
    Period::month(2000 + (month as i32 - 1) / 12, (month - 1) % 12 + 1).unwrap()
}

/// A store in memory and one in a folder, which lives as long as the answer.
pub(crate) fn stores() -> (tempfile::TempDir, [Store; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let stores = [
        Store::memory(),
        Store::open(folder.path().to_str().unwrap()).unwrap(),
    ];
    (folder, stores)
}

/// Values bit by bit, no-data as one pattern.
pub(crate) fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}
