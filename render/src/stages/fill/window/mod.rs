//! The form in production: every gap from the cells within a window round it, and where that holds little, from the
//! same of coarser blocks, so that no gap stays empty and none costs more than another.
//!
//! Each level joins cells of the finer one two by two. An answer is the mean weighted by one over the squared distance
//! (Shepard 1968) within [`REACH`] cells, with the next coarser level's answer taking part with the weight of one cell
//! at the window's rim: unseen beside data, all there is in the middle of a wide gap, and no edge between the two.

pub mod cpu;

use contract::grid::Grid;

use super::Sources;
use super::ladder::Ladder;
use super::level::{Extent, Places, Table};
use super::on_device::Rooms;
use super::sphere::Sphere;
use crate::gpu::{Gpu, Kernel, Recorder};

/// How far the window of a level reaches, cells of that level.
pub const REACH: f64 = 8.0;
/// A level of at most so many rows and columns is the coarsest: its window is all of it.
const COARSEST: u32 = 8;
/// Weight of data in a block on the block's own centre: as if half a cell away.
const OWN_WEIGHT: f64 = 4.0;
/// Side of a workgroup, cells.
const BLOCK: u32 = 16;

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../fill.wgsl"), include_str!("window.wgsl"));

/// The levels of a grid.
pub fn ladder(grid: &Grid) -> Ladder {
    let sphere = Sphere::of(grid);
    // Cells may be wider than high.
    let cell_rad = sphere.row_rad().max(grid.dlon_deg.to_radians());
    let mut levels = vec![];
    let [mut rows, mut cols] = [grid.rows, grid.cols];
    loop {
        let stride = f64::from(1u32 << levels.len());
        let places = Places {
            sphere: &sphere,
            rows: &(0..rows)
                .map(|row| middle(row, stride, grid.rows))
                .collect::<Vec<_>>(),
            cols,
            stride,
            periodic: grid.is_periodic(),
        };
        let unit_sq = (cell_rad * stride).powi(2);
        let weight = |chord_sq: f64| {
            if chord_sq == 0.0 {
                OWN_WEIGHT
            } else {
                unit_sq / chord_sq
            }
        };
        let is_coarsest = rows.max(cols) <= COARSEST;
        let radius = REACH * cell_rad * stride * (1.0 + 1e-9);
        let extent = if is_coarsest {
            Extent::All
        } else {
            Extent::Chord {
                radius,
                may_clip: true,
            }
        };
        let table = Table::new(&places, extent, &weight);
        levels.push((
            [rows, cols],
            table.expect("the coarsest level is small, others may be clipped"),
        ));
        if is_coarsest {
            return Ladder::new(grid, levels, 0, (1.0 / (REACH * REACH)) as f32).masked(|_| true);
        }
        [rows, cols] = [rows.div_ceil(2), cols.div_ceil(2)];
    }
}

/// The middle of the finest rows that a block covers; the last block may be cut short by the grid's edge.
fn middle(row: u32, stride: f64, rows: u32) -> f64 {
    let first = f64::from(row) * stride;
    0.5 * (first + (first + stride).min(f64::from(rows)) - 1.0)
}

/// The compiled stage.
pub struct Window {
    split: Kernel,
    join: Kernel,
    stencil: Kernel,
    settle: Kernel,
}

impl Window {
    /// Compiles the shaders.
    pub fn new(gpu: &Gpu, sources: &Sources) -> Self {
        let source = &sources.window;
        Self {
            split: gpu.kernel("fill split", source, "split"),
            join: gpu.kernel("fill join", source, "join"),
            stencil: gpu.kernel("fill stencil", &sources.stencil, "stencil"),
            settle: gpu.kernel("fill settle", source, "settle"),
        }
    }

    /// Fills the finest level's room of answers from the values and gaps in `rooms`.
    pub fn record(&self, recorder: &mut Recorder<'_>, rooms: &Rooms) {
        let blocks = |[rows, cols]: [u32; 2]| [cols.div_ceil(BLOCK), rows.div_ceil(BLOCK)];
        let finest = &rooms.levels[0];
        let buffers = [(0, &finest.params), (1, &rooms.values), (2, &finest.planes)];
        recorder.dispatch(&self.split, &buffers, blocks(finest.size()));
        for pair in rooms.levels.windows(2) {
            let (fine, coarse) = (&pair[0], &pair[1]);
            let buffers = [
                (0, &fine.params),
                (3, &fine.planes),
                (4, &fine.wanted),
                (5, &coarse.planes),
                (6, &coarse.wanted),
            ];
            recorder.dispatch(&self.join, &buffers, blocks(coarse.size()));
        }
        for (index, level) in rooms.levels.iter().enumerate().rev() {
            level.record_stencil(recorder, &self.stencil);
            // The coarsest level has no other answer to lean on and reads none.
            let coarser = rooms
                .levels
                .get(index + 1)
                .map_or(&rooms.values, |level| &level.answers);
            let buffers = [
                (0, &level.params),
                (7, &level.sums),
                (8, coarser),
                (9, &level.wanted),
                (10, &level.answers),
            ];
            recorder.dispatch(&self.settle, &buffers, blocks(level.size()));
        }
    }
}
