//! Made-up scenes: a smooth flux field with land, and what it has accumulated.

pub(crate) use render_proof::ocean::{FIVE_DEGREES, GRAM_A_YEAR, ONE_DEGREE, scene as ocean};
pub(crate) use render_proof::views::{globe, looking_at, tile};

use std::sync::Arc;

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use render::stages::fill::{self, Form};
use render::{Field, Scene};

/// The same ocean under clouds of six rows and eight columns, which are filled.
pub(crate) fn clouded(grid: Grid) -> Scene {
    let mut scene = ocean(grid);
    let domain = Arc::clone(&scene.domain);
    let value = &mut scene.value;
    for (field, shift) in [(&mut value.before, 0), (&mut value.after, 5)] {
        let under_cloud = |cell: usize| {
            let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
            (row / 6 + (col + shift) / 8).is_multiple_of(3)
        };
        let cells = field.cells.content().iter().enumerate();
        let seen = |(cell, value): (usize, &f32)| if under_cloud(cell) { f32::NAN } else { *value };
        let seen: Vec<f32> = cells.map(seen).collect();
        let filled = fill::on_cpu(Form::Window, &grid, &seen, domain.content()).unwrap();
        *field = Arc::new(Field::filled(filled));
    }
    scene
}

/// A job in the default style of fluxes.
pub(crate) fn job(mode: Mode, view: View) -> RenderJob {
    RenderJob {
        mode,
        ..render_proof::ocean::job(view)
    }
}
