//! A job over a very large grid in, the level and the window of it that its picture is drawn from out. Pure: the same for the same job,
//! whatever was drawn before.

use contract::chunk::Window;
use contract::grid::{Grid, wrap_lon_deg};
use contract::job::{Mode, RenderJob};
use contract::level::{self, Level};
use render::plan::Plan;
use render::pyramid;
use render::scene::Whole;

/// Cells beyond those that a picture shows: what is drawn of a cell goes by its neighbours.
const MARGIN_CELLS: u32 = 4;
/// The same where particles drift: so many cells they come from at most.
const FLOW_MARGIN_CELLS: u32 = 64;

/// What is read of a product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Choice {
    /// Number of the level, 0 of the grid itself.
    pub(super) level: u32,
    /// Cells of the grid in one of the level, down and across.
    pub(super) cells: [u32; 2],
    /// All of the level.
    pub(super) whole: Grid,
    /// First row and column of the window.
    pub(super) corner: [u32; 2],
    /// The window as a grid.
    pub(super) window: Grid,
}

/// Levels of a grid that are grids themselves: blocks that reach beyond a pole, or once round, are not drawn.
pub(super) fn drawn_levels(grid: &Grid) -> Vec<Level> {
    let all = level::levels(grid).into_iter();
    all.take_while(|level| level.grid.validate().is_ok())
        .collect()
}

/// The coarsest level from which all halvings that the picture asks for come to the same blocks, and the cells of it that are seen.
/// `carbon` is the range of what is accumulated, if anything lifts the particles.
pub(super) fn choose(job: &RenderJob, carbon: Option<[f32; 2]>) -> Choice {
    let (halvings, drawn) = pyramid::halvings(job, &job.grid);
    let levels = drawn_levels(&job.grid);
    let number = (halvings / 2).min(levels.len() as u32);
    let itself = Level {
        number: 0,
        grid: job.grid,
        cells: [1; 2],
    };
    let own = match number {
        0 => itself,
        number => levels[number as usize - 1],
    };
    let margin = match job.mode {
        Mode::Flow => FLOW_MARGIN_CELLS,
        Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => MARGIN_CELLS,
    };
    // What shows nothing of it is drawn from any cell.
    let seen = Plan::seen_cells(job, &drawn, carbon);
    let [rows, cols] = seen.unwrap_or([0..1, 0..1]);
    let rows = rows.start.saturating_sub(margin)..(rows.end + margin).min(drawn.rows);
    let count = cols.end - cols.start + 2 * margin;
    let cols = if drawn.is_periodic() {
        if count >= drawn.cols {
            0..drawn.cols
        } else {
            let start = (cols.start + drawn.cols - margin % drawn.cols) % drawn.cols;
            start..start + count
        }
    } else {
        cols.start.saturating_sub(margin)..(cols.end + margin).min(drawn.cols)
    };
    // Rows of one cell are not halved.
    let across = |all: u32, drawn: u32, cells: u32| {
        let unit = 1 << (halvings - 2 * number);
        (if all == drawn { 1 } else { unit }) * cells
    };
    let [down, right] = [
        across(own.grid.rows, drawn.rows, 1),
        across(own.grid.cols, drawn.cols, 1),
    ];
    let corner = [rows.start * down, cols.start * right];
    let end_row = (rows.end * down).min(own.grid.rows);
    let end_col = if drawn.is_periodic() {
        cols.end * right
    } else {
        (cols.end * right).min(own.grid.cols)
    };
    let window = Grid {
        rows: end_row - corner[0],
        cols: end_col - corner[1],
        north_deg: own.grid.row_north_deg(corner[0]),
        west_deg: wrap_lon_deg(own.grid.col_west_deg(corner[1])),
        ..own.grid
    };
    Choice {
        level: own.number,
        cells: own.cells,
        whole: own.grid,
        corner,
        window,
    }
}

impl Choice {
    /// All of a level.
    pub(super) fn all_of(level: &Level) -> Self {
        Self {
            level: level.number,
            cells: level.cells,
            whole: level.grid,
            corner: [0; 2],
            window: level.grid,
        }
    }

    /// What is to be read: one window, or two where it goes on beyond the last column.
    pub(super) fn windows(&self) -> Vec<Window> {
        let [row, col] = self.corner;
        let (rows, cols) = (self.window.rows, self.window.cols);
        let of = |col, cols| Window {
            row,
            col,
            rows,
            cols,
        };
        let first = cols.min(self.whole.cols - col);
        let mut all = vec![of(col, first)];
        if first < cols {
            all.push(of(0, cols - first));
        }
        all
    }

    /// Where the window begins in the level.
    pub(super) fn place(&self) -> Whole {
        Whole {
            grid: self.whole,
            row: self.corner[0],
            col: self.corner[1],
        }
    }
}
