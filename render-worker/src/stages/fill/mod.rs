//! Gap filling: one frame in, the same frame with the missing cells of the product's domain filled in, out. Done once
//! when a frame is loaded, because it depends on the product only.

pub mod cpu;

use contract::grid::Grid;

use crate::error::RenderError;
use crate::gpu::{Gpu, Kernel};

/// How far the window reaches, cells.
pub const REACH: i32 = 8;
/// Side of a workgroup's block, cells.
const BLOCK: u32 = 16;
/// The shader.
pub const SOURCE: &str = include_str!("fill.wgsl");

shared_struct! {
    /// The grid as the fill sees it.
    pub struct FillParams {
        pub rows: u32,
        pub cols: u32,
        pub periodic: u32,
        /// At most [`REACH`], less on a periodic grid so narrow that a cell would be met twice.
        pub reach_x: i32,
        /// Width of a cell over its height, degrees over degrees.
        pub lon_per_lat: f32,
        pub pad_a: u32,
        pub pad_b: u32,
        pub pad_c: u32,
    }
}

impl FillParams {
    /// Parameters and the cosine of every row's middle latitude.
    pub fn for_grid(grid: &Grid) -> (Self, Vec<f32>) {
        let widest = if grid.is_periodic() {
            (grid.cols as i32 - 1) / 2
        } else {
            REACH
        };
        let params = Self {
            rows: grid.rows,
            cols: grid.cols,
            periodic: u32::from(grid.is_periodic()),
            reach_x: REACH.min(widest),
            lon_per_lat: (grid.dlon_deg / grid.dlat_deg) as f32,
            ..Self::default()
        };
        let cosines = (0..grid.rows)
            .map(|row| grid.cell_center(row, 0).lat.to_radians().cos().max(1e-3) as f32);
        (params, cosines.collect())
    }
}

/// The compiled stage.
pub struct Fill {
    kernel: Kernel,
}

impl Fill {
    /// Compiles `source`, [`SOURCE`] but for tests.
    pub fn new(gpu: &Gpu, source: &str) -> Self {
        Self {
            kernel: gpu.kernel("fill", source, "fill"),
        }
    }

    /// Fills one frame on the GPU; see [`cpu::fill`].
    pub fn run(
        &self,
        gpu: &Gpu,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Result<Vec<f32>, RenderError> {
        let (params, cosines) = FillParams::for_grid(grid);
        let params = gpu.uniform("fill params", &params);
        let values_in = gpu.storage("fill values", values)?;
        let domain = gpu.storage("fill domain", domain)?;
        let cosines = gpu.storage("fill cosines", &cosines)?;
        let filled = gpu.storage("fill filled", values)?;
        let mut recorder = gpu.recorder();
        let groups = [grid.cols.div_ceil(BLOCK), grid.rows.div_ceil(BLOCK)];
        recorder.dispatch(
            &self.kernel,
            &[
                (0, &params),
                (1, &values_in),
                (2, &domain),
                (3, &cosines),
                (4, &filled),
            ],
            groups,
        );
        recorder.download(&filled, values.len())
    }
}
