//! The answer of all pairs of cells at a cost that grows with the cells, not with their square: multilevel summation.
//!
//! The weight 1/d² is split into a part that ends within [`REACH`] cells and one that is smooth on that scale; the
//! smooth part is summed on a grid half as fine, where it is split again, and so on (Brandt and Lubrecht 1990,
//! Journal of Computational Physics 90, 348; the smoothing by a Taylor polynomial is that of multilevel summation for Coulomb
//! sums, Hardy et al. 2015, doi:10.1021/ct5009075). Six-point Lagrange interpolation carries values between levels.
//! Against all pairs in float64 the answers are within [`TOLERANCE`] of the values' range; tests hold it to that.

pub mod cpu;

use contract::grid::Grid;

use super::Sources;
use super::ladder::Ladder;
use super::level::{Extent, Places, Table};
use super::on_device::Rooms;
use super::sphere::Sphere;
use crate::gpu::{Gpu, Kernel, Recorder};

/// Where a level's part of the weight ends, cells of the level below.
pub const REACH: f64 = 12.0;
/// Largest difference from all pairs, as a share of the values' range; most are below a twentieth of it, the largest
/// lie far from all data.
pub const TOLERANCE: f32 = 1e-4;
/// Order of the polynomial that smooths the weight near 0.
const SMOOTH_ORDER: i32 = 3;
/// A level of at most so many rows and columns is summed over whole.
const COARSEST: u32 = 32;
/// So many are allowed where a grid that goes all the way round cannot be halved.
const MOST_COARSEST: u32 = 192;
/// Rows (and columns, unless the grid goes all the way round) of a coarser level before the first one of the finer.
const PAD: u32 = 2;
/// Side of a workgroup, cells.
const BLOCK: u32 = 16;

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../fill.wgsl"), include_str!("exact.wgsl"));

/// The levels of a grid; none where the grid comes so near a pole that the weights reach too many columns.
pub fn ladder(grid: &Grid) -> Option<Ladder> {
    let sphere = Sphere::of(grid);
    let cell_rad = sphere.row_rad().max(widest_rad(grid, &sphere));
    let periodic = grid.is_periodic();
    let pad_cols = if periodic { 0 } else { PAD };
    let mut levels = vec![];
    let [mut rows, mut cols] = [grid.rows, grid.cols];
    let mut first_row = 0.0;
    loop {
        let stride = f64::from(1u32 << levels.len());
        let near = if levels.is_empty() {
            None
        } else {
            Some(0.5 * REACH * cell_rad * stride)
        };
        let far = REACH * cell_rad * stride;
        let is_coarsest = rows.max(cols) <= COARSEST || (periodic && cols % 2 == 1);
        if is_coarsest && rows.max(cols) > MOST_COARSEST {
            return None;
        }
        let unit_sq = cell_rad * cell_rad;
        let weight = |chord_sq: f64| {
            let whole = match near {
                // The finest level meets a gap itself only where nothing is.
                None if chord_sq == 0.0 => 0.0,
                None => 1.0 / chord_sq,
                Some(near) => smoothed(chord_sq, near),
            };
            let left = if is_coarsest {
                0.0
            } else {
                smoothed(chord_sq, far)
            };
            let is_self = near.is_none() && chord_sq == 0.0;
            unit_sq * if is_self { 0.0 } else { whole - left }
        };
        let places = Places {
            sphere: &sphere,
            rows: &(0..rows)
                .map(|row| (f64::from(row) - first_row) * stride)
                .collect::<Vec<_>>(),
            cols,
            stride,
            periodic,
        };
        let extent = if is_coarsest {
            Extent::All
        } else {
            Extent::Chord {
                radius: far,
                may_clip: false,
            }
        };
        levels.push(([rows, cols], Table::new(&places, extent, &weight)?));
        if is_coarsest {
            return Some(Ladder::new(grid, levels, pad_cols, 0.0).masked(|index| index == 0));
        }
        rows = coarser_count(rows);
        cols = if periodic {
            cols / 2
        } else {
            coarser_count(cols)
        };
        first_row = f64::from(PAD) + 0.5 * first_row;
    }
}

/// Nodes that six-point interpolation needs to reach `count` nodes twice as fine.
fn coarser_count(count: u32) -> u32 {
    (count - 1) / 2 + PAD + 4
}

/// Width of the grid's widest cells, radians of arc.
fn widest_rad(grid: &Grid, sphere: &Sphere) -> f64 {
    (0..grid.rows)
        .map(|row| sphere.width_rad(f64::from(row)))
        .fold(0.0, f64::max)
}

/// 1/d² beyond `radius`; within it the Taylor polynomial of 1/d² in d² about the radius, smooth down to 0.
fn smoothed(chord_sq: f64, radius: f64) -> f64 {
    let radius_sq = radius * radius;
    if chord_sq >= radius_sq {
        return 1.0 / chord_sq;
    }
    let inside = 1.0 - chord_sq / radius_sq;
    (0..=SMOOTH_ORDER)
        .map(|order| inside.powi(order))
        .sum::<f64>()
        / radius_sq
}

/// The compiled stage.
pub struct Exact {
    split: Kernel,
    gather: Kernel,
    stencil: Kernel,
    raise: Kernel,
    finish: Kernel,
}

impl Exact {
    /// Compiles the shaders.
    pub fn new(gpu: &Gpu, sources: &Sources) -> Self {
        let source = &sources.exact;
        Self {
            split: gpu.kernel("fill split", &sources.window, "split"),
            gather: gpu.kernel("fill gather", source, "gather"),
            stencil: gpu.kernel("fill stencil", &sources.stencil, "stencil"),
            raise: gpu.kernel("fill raise", source, "raise"),
            finish: gpu.kernel("fill finish", source, "finish"),
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
            let buffers = [(0, &fine.params), (1, &fine.planes), (2, &coarse.planes)];
            recorder.dispatch(&self.gather, &buffers, blocks(coarse.size()));
        }
        for level in rooms.levels.iter().rev() {
            level.record_stencil(recorder, &self.stencil);
        }
        for pair in rooms.levels.windows(2).rev() {
            let (fine, coarse) = (&pair[0], &pair[1]);
            let buffers = [
                (0, &fine.params),
                (3, &coarse.sums),
                (4, &fine.wanted),
                (5, &fine.sums),
            ];
            recorder.dispatch(&self.raise, &buffers, blocks(fine.size()));
        }
        let buffers = [
            (0, &finest.params),
            (4, &finest.wanted),
            (6, &finest.sums),
            (7, &finest.answers),
        ];
        recorder.dispatch(&self.finish, &buffers, blocks(finest.size()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_the_weight_sum_up_to_the_whole() {
        for chord_sq in [1e-6f64, 0.3, 4.0, 9e3] {
            let radii = [0.01, 0.02, 0.04, 0.08];
            let mut whole = 1.0 / chord_sq - smoothed(chord_sq, radii[0]);
            for pair in radii.windows(2) {
                whole += smoothed(chord_sq, pair[0]) - smoothed(chord_sq, pair[1]);
            }
            whole += smoothed(chord_sq, radii[3]);
            assert!((whole * chord_sq - 1.0).abs() < 1e-12, "{chord_sq}");
        }
    }

    #[test]
    fn the_smoothed_weight_meets_the_weight_without_an_edge() {
        let (inside, outside) = (smoothed(0.999999, 1.0), smoothed(1.000001, 1.0));
        assert!((inside - outside - 2e-6).abs() < 1e-9);
        assert!(
            (smoothed(0.0, 2.0) - 1.0).abs() < 1e-12,
            "four terms of 1 over the radius squared"
        );
    }

    #[test]
    fn a_grid_over_a_pole_has_no_ladder_and_one_to_eighty_degrees_has() {
        let fine = Grid {
            rows: 900,
            cols: 1440,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 0.1,
            dlon_deg: 0.25,
        };
        assert!(ladder(&fine).is_none());
        assert!(
            ladder(&Grid {
                rows: 800,
                north_deg: 80.0,
                ..fine
            })
            .is_some()
        );
    }
}
