//! A ladder's tables on the device, and the buffers that one filling works in.

use contract::grid::Grid;

use super::ladder::Ladder;
use super::level::FillLevel;
use crate::error::RenderError;
use crate::gpu::{Gpu, Kernel, Recorder};

/// Columns that a workgroup of the stencil takes.
const WIDTH: u32 = 128;
/// Rows that it takes.
const ROWS: u32 = 4;

/// The tables of a grid's levels; they depend on the grid alone and are kept between fields.
pub struct DeviceLadder {
    /// What the tables were made for.
    pub grid: Grid,
    rungs: Vec<DeviceRung>,
}

struct DeviceRung {
    level: FillLevel,
    params: wgpu::Buffer,
    weights: wgpu::Buffer,
    spans: wgpu::Buffer,
}

impl DeviceLadder {
    /// Uploads the tables of a ladder.
    pub fn new(gpu: &Gpu, grid: &Grid, ladder: &Ladder) -> Result<Self, RenderError> {
        let rung = |rung: &super::ladder::Rung| -> Result<DeviceRung, RenderError> {
            Ok(DeviceRung {
                level: rung.level,
                params: gpu.uniform("fill level", &rung.level),
                weights: gpu.storage("fill weights", &rung.table.weights)?,
                spans: gpu.storage("fill spans", &rung.table.spans)?,
            })
        };
        let rungs = ladder.rungs.iter().map(rung).collect::<Result<_, _>>()?;
        Ok(Self { grid: *grid, rungs })
    }
}

/// The buffers of one filling.
pub struct Rooms {
    /// Scaled values of the finest level.
    pub values: wgpu::Buffer,
    /// The finest first.
    pub levels: Vec<LevelRoom>,
}

/// The buffers of one level.
pub struct LevelRoom {
    level: FillLevel,
    pub params: wgpu::Buffer,
    weights: wgpu::Buffer,
    spans: wgpu::Buffer,
    /// Presence, value and square, a plane each.
    pub planes: wgpu::Buffer,
    /// The three planes summed up around every wanted cell.
    pub sums: wgpu::Buffer,
    /// 1 for cells whose sums are wanted.
    pub wanted: wgpu::Buffer,
    /// Mean and mean square, a plane each.
    pub answers: wgpu::Buffer,
}

impl Rooms {
    /// Rooms for scaled values and their gaps.
    pub fn new(
        gpu: &Gpu,
        ladder: &DeviceLadder,
        values: &[f32],
        gaps: &[u32],
    ) -> Result<Self, RenderError> {
        let room = |(index, rung): (usize, &DeviceRung)| -> Result<LevelRoom, RenderError> {
            let cells = u64::from(rung.level.rows) * u64::from(rung.level.cols);
            // Levels that are summed over whole have no marks and no answers of their own.
            let kept = if rung.level.is_masked == 1 { cells } else { 1 };
            let wanted = if index == 0 {
                gpu.storage("fill gaps", gaps)?
            } else {
                gpu.room("fill wanted", 4 * kept)?
            };
            Ok(LevelRoom {
                level: rung.level,
                params: rung.params.clone(),
                weights: rung.weights.clone(),
                spans: rung.spans.clone(),
                planes: gpu.room("fill planes", 12 * cells)?,
                sums: gpu.room("fill sums", 12 * cells)?,
                wanted,
                answers: gpu.room("fill answers", 8 * kept)?,
            })
        };
        Ok(Self {
            values: gpu.storage("fill values", values)?,
            levels: ladder
                .rungs
                .iter()
                .enumerate()
                .map(room)
                .collect::<Result<_, _>>()?,
        })
    }
}

impl LevelRoom {
    /// Rows and columns.
    pub fn size(&self) -> [u32; 2] {
        [self.level.rows, self.level.cols]
    }

    /// Fills `sums` from `planes`.
    pub(super) fn record_stencil(&self, recorder: &mut Recorder<'_>, stencil: &Kernel) {
        let buffers = [
            (0, &self.params),
            (1, &self.planes),
            (2, &self.weights),
            (3, &self.spans),
            (4, &self.wanted),
            (5, &self.sums),
        ];
        recorder.dispatch(
            stencil,
            &buffers,
            [
                self.level.cols.div_ceil(WIDTH),
                self.level.rows.div_ceil(ROWS),
            ],
        );
    }
}
