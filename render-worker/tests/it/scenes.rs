//! Made-up scenes: a smooth flux field with land, and what it has accumulated.

pub(crate) use render_worker::proof::ocean::{GRAM_A_YEAR, ONE_DEGREE, scene as ocean};

use std::sync::Arc;

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::tile::Tile;
use render_worker::stages::fill::{self, Form};
use render_worker::{Frame, Scene};

/// A coarser one for quick tests.
pub(crate) const FIVE_DEGREES: Grid = Grid {
    rows: 36,
    cols: 72,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 5.0,
    dlon_deg: 5.0,
};

/// The same ocean under clouds of six rows and eight columns, which are filled.
pub(crate) fn clouded(grid: Grid) -> Scene {
    let mut scene = ocean(grid);
    let domain = Arc::clone(&scene.domain);
    let value = &mut scene.value;
    for (frame, shift) in [(&mut value.before, 0), (&mut value.after, 5)] {
        let under_cloud = |cell: usize| {
            let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
            (row / 6 + (col + shift) / 8).is_multiple_of(3)
        };
        let cells = frame.cells.content().iter().enumerate();
        let seen = |(cell, value): (usize, &f32)| if under_cloud(cell) { f32::NAN } else { *value };
        let seen: Vec<f32> = cells.map(seen).collect();
        let filled = fill::on_cpu(Form::Window, &grid, &seen, domain.content()).unwrap();
        *frame = Arc::new(Frame::filled(filled));
    }
    scene
}

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
