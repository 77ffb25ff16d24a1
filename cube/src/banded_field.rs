//! For tests of what is read in bands: a field of three rows of chunks, and what says what it is.

use contract::grid::Grid;
use contract::quantity::Quantity;

use crate::Description;

/// Three rows of two chunks of a cube, and eighteen rows of chunks of a field: none of their edges is one of the other's.
pub(crate) const GRID: Grid = Grid {
    rows: 1030,
    cols: 600,
    north_deg: 80.0,
    west_deg: 0.0,
    dlat_deg: 0.125,
    dlon_deg: 0.125,
};

/// Each cell's number, and in every eleventh no data.
pub(crate) fn values() -> Vec<f32> {
    let value = |cell: usize| match cell % 11 {
        0 => f32::NAN,
        _ => cell as f32,
    };
    (0..GRID.cell_count()).map(value).collect()
}

/// A product of such fields.
pub(crate) fn description(quantity: Quantity) -> Description {
    Description {
        product: "p".parse().expect("it is a name"),
        title: "P".to_owned(),
        quantity,
        synthetic: true,
        source: "a test".to_owned(),
        grid: GRID,
        version: None,
        statistic: None,
    }
}
