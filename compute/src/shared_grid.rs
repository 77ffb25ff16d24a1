//! Whether two products lie on one grid, and what brings one to that of the other.

use contract::grid::Grid;
use contract::manifest::Manifest;

use crate::ComputeError;
use crate::summed::usual_regridding;

/// Do both lie on one grid, so that a cell of one is that cell of the other?
///
/// # Errors
/// They do not: on which, and how to bring the second to the grid of the first.
pub(crate) fn check(first: &Manifest, second: &Manifest) -> Result<(), ComputeError> {
    if is_same(&first.grid, &second.grid) {
        return Ok(());
    }
    let (own, others) = (&first.product, &second.product);
    let reason = format!(
        "{own} is on {}, {others} on {}: bring one to the grid of the other first, such as \
         fluxglobe derive regrid --product {others} --like {own} --method {}",
        in_words(&first.grid),
        in_words(&second.grid),
        usual_regridding(second),
    );
    Err(ComputeError::Expression { reason })
}

/// Are two grids the same but for the noise of their axes?
pub(crate) fn is_same(a: &Grid, b: &Grid) -> bool {
    /// Share of a cell: axes of files are written with five digits and more.
    const SLACK_CELLS: f64 = 1e-3;
    let near = |a: f64, b: f64, step: f64| (a - b).abs() < SLACK_CELLS * step;
    let far = (
        f64::from(a.rows) * a.dlat_deg,
        f64::from(a.cols) * a.dlon_deg,
    );
    (a.rows, a.cols) == (b.rows, b.cols)
        && near(a.north_deg, b.north_deg, a.dlat_deg)
        && near(a.west_deg, b.west_deg, a.dlon_deg)
        && near(far.0, f64::from(b.rows) * b.dlat_deg, a.dlat_deg)
        && near(far.1, f64::from(b.cols) * b.dlon_deg, a.dlon_deg)
}

fn in_words(grid: &Grid) -> String {
    let [west, south, east, north] = grid.shown_bounds_deg();
    format!(
        "{} x {} cells over {west},{south},{east},{north}",
        grid.rows, grid.cols
    )
}
