//! Every gap against every cell with data, nothing left out: the reference that the other forms answer to. Tiled, where
//! a workgroup shares the weights between two rows and passes the data through shared memory; and naive, where every
//! gap computes every weight from global memory, which is what there is to be faster than.

pub mod cpu;

use contract::grid::Grid;

use super::level::FillLevel;
use super::sphere::Sphere;
use crate::error::RenderError;
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::stages::layout::is_missing;

/// Gaps that a workgroup takes.
const TILE: usize = 128;
/// Columns that the tiled form has shared memory for.
pub const MOST_COLS: u32 = 4096;
/// Side of a workgroup of the naive form, cells.
const BLOCK: u32 = 16;
/// Most workgroups in one dimension of a dispatch (the least any device allows).
const MOST_GROUPS: u32 = 65_535;

/// The shader.
pub const SOURCE: &str = concat!(include_str!("../fill.wgsl"), include_str!("pairs.wgsl"));

/// What distances are made of, in cells: `4 sin²(half the angle) / cell²` between rows and between columns so many
/// apart, and the cosine of every row's latitude, one list after the other.
pub fn tables(grid: &Grid) -> Vec<f32> {
    let sphere = Sphere::of(grid);
    let unit_sq = sphere.row_rad().powi(2);
    let rows = (0..grid.rows).map(|row| 4.0 * sphere.half_sine_sq_rows(f64::from(row)) / unit_sq);
    let cols = (0..grid.cols).map(|col| 4.0 * sphere.half_sine_sq_cols(f64::from(col)) / unit_sq);
    let cosines = (0..grid.rows).map(|row| sphere.lat_rad(f64::from(row)).cos());
    rows.chain(cols)
        .chain(cosines)
        .map(|number| number as f32)
        .collect()
}

/// Gaps and data in lists, row by row.
struct Lists {
    /// Row, first target, number of targets, nothing: one entry a workgroup.
    work: Vec<[u32; 4]>,
    /// Columns of gaps.
    targets: Vec<u32>,
    /// First source of every row, and the end.
    row_starts: Vec<u32>,
    source_cols: Vec<u32>,
    source_values: Vec<f32>,
}

impl Lists {
    fn new(grid: &Grid, values: &[f32], gaps: &[u32]) -> Self {
        let cols = grid.cols as usize;
        let (mut work, mut targets) = (vec![], vec![]);
        let (mut row_starts, mut source_cols, mut source_values) = (vec![0], vec![], vec![]);
        for (row, (values, gaps)) in values
            .chunks_exact(cols)
            .zip(gaps.chunks_exact(cols))
            .enumerate()
        {
            let of_row: Vec<u32> = (0..grid.cols)
                .filter(|col| gaps[*col as usize] != 0)
                .collect();
            for chunk in of_row.chunks(TILE) {
                work.push([row as u32, targets.len() as u32, chunk.len() as u32, 0]);
                targets.extend_from_slice(chunk);
            }
            for (col, value) in values
                .iter()
                .enumerate()
                .filter(|(_, value)| !is_missing(**value))
            {
                source_cols.push(col as u32);
                source_values.push(*value);
            }
            row_starts.push(source_cols.len() as u32);
        }
        Self {
            work,
            targets,
            row_starts,
            source_cols,
            source_values,
        }
    }
}

/// The buffers of one filling.
pub struct PairRooms {
    rows: u32,
    cols: u32,
    params: wgpu::Buffer,
    tables: wgpu::Buffer,
    values: wgpu::Buffer,
    gaps: wgpu::Buffer,
    work: wgpu::Buffer,
    work_count: u32,
    targets: wgpu::Buffer,
    row_starts: wgpu::Buffer,
    source_cols: wgpu::Buffer,
    source_values: wgpu::Buffer,
    /// Mean and mean square, a plane each.
    pub answers: wgpu::Buffer,
}

impl PairRooms {
    /// Rooms for scaled values and their gaps.
    pub fn new(gpu: &Gpu, grid: &Grid, values: &[f32], gaps: &[u32]) -> Result<Self, RenderError> {
        let level = FillLevel {
            rows: grid.rows,
            cols: grid.cols,
            ..FillLevel::default()
        };
        let lists = Lists::new(grid, values, gaps);
        Ok(Self {
            rows: grid.rows,
            cols: grid.cols,
            params: gpu.uniform("fill level", &level),
            tables: gpu.storage("fill tables", &tables(grid))?,
            values: gpu.storage("fill values", values)?,
            gaps: gpu.storage("fill gaps", gaps)?,
            work_count: lists.work.len() as u32,
            work: gpu.storage("fill work", &lists.work)?,
            targets: gpu.storage("fill targets", &lists.targets)?,
            row_starts: gpu.storage("fill rows", &lists.row_starts)?,
            source_cols: gpu.storage("fill columns", &lists.source_cols)?,
            source_values: gpu.storage("fill data", &lists.source_values)?,
            answers: gpu.room("fill answers", 8 * grid.cell_count() as u64)?,
        })
    }

    /// How many pieces the work falls into: workgroups of the tiled form, rows of workgroups of the naive one.
    pub fn pieces(&self, is_naive: bool) -> u32 {
        if is_naive {
            self.rows.div_ceil(BLOCK)
        } else {
            self.work_count
        }
    }
}

/// The compiled stage.
pub struct Pairs {
    tiled: Kernel,
    naive: Kernel,
}

impl Pairs {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            tiled: gpu.kernel("fill pairs", source, "tiled"),
            naive: gpu.kernel("fill naive", source, "naive"),
        }
    }

    /// Fills the answers of the first `pieces` pieces of the work.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        rooms: &PairRooms,
        is_naive: bool,
        pieces: u32,
    ) {
        if is_naive {
            let buffers = [
                (0, &rooms.params),
                (1, &rooms.tables),
                (2, &rooms.answers),
                (3, &rooms.values),
                (4, &rooms.gaps),
            ];
            recorder.dispatch(&self.naive, &buffers, [rooms.cols.div_ceil(BLOCK), pieces]);
            return;
        }
        let buffers = [
            (0, &rooms.params),
            (1, &rooms.tables),
            (2, &rooms.answers),
            (5, &rooms.work),
            (6, &rooms.targets),
            (7, &rooms.row_starts),
            (8, &rooms.source_cols),
            (9, &rooms.source_values),
        ];
        let across = pieces.clamp(1, MOST_GROUPS);
        recorder.dispatch(&self.tiled, &buffers, [across, pieces.div_ceil(across)]);
    }
}
