//! Made-up scenes: a smooth flux field with land, and what it has accumulated.

pub(crate) use render_worker::proof::ocean::{GRAM_A_YEAR, ONE_DEGREE, scene as ocean};

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::tile::Tile;

/// A coarser one for quick tests.
pub(crate) const FIVE_DEGREES: Grid = Grid {
    rows: 36,
    cols: 72,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 5.0,
    dlon_deg: 5.0,
};

/// A job in the default style of fluxes.
pub(crate) fn job(mode: Mode, view: View) -> RenderJob {
    RenderJob {
        mode,
        ..render_worker::proof::ocean::job(view)
    }
}

pub(crate) fn tile(z: u8, x: u32, y: u32, size_px: u32) -> View {
    View::Tile {
        tile: Tile::new(z, x, y).unwrap(),
        size_px,
    }
}

pub(crate) fn globe(lon_deg: f64, lat_deg: f64, height_m: f64, size_px: u32) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: size_px,
        height_px: size_px,
    }
}
