//! Gap filling: one frame in, the same frame with the missing cells of the product's domain filled in and an estimate
//! of the error of each, out. Done once when a frame is loaded, because it depends on the product only.
//!
//! All forms are inverse distance weighting of power 2 (Shepard 1968, doi:10.1145/800186.810616) with the distance on
//! the sphere: [`window`] is what products are drawn with, [`exact`] gives the answer of all pairs of cells quickly,
//! [`pairs`] gives it slowly. Every product of two numbers is rounded before it is added, on every device, so that a
//! form has the same bits on all of them and on the processor. Land is what holds no data in any step: it stays empty.

mod band;
pub mod cpu;
pub mod exact;
pub mod ladder;
pub mod level;
mod on_device;
pub mod pairs;
pub mod scaled;
pub mod sphere;
pub mod window;

use std::borrow::Cow;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use contract::grid::Grid;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::stages::layout::MISSING;
use band::Band;
use exact::Exact;
use ladder::Ladder;
use on_device::{DeviceLadder, Rooms};
use pairs::{PairRooms, Pairs};
use scaled::{Scaled, holds};
use window::Window;

/// The shader of the sums that [`window`] and [`exact`] share.
pub const STENCIL_SOURCE: &str = concat!(include_str!("fill.wgsl"), include_str!("stencil.wgsl"));

/// Most pairs of cells that are met one by one: minutes of a large GPU.
const MOST_PAIRS: u64 = 1 << 42;
/// The same for the twins.
const MOST_PAIRS_ON_CPU: u64 = 1 << 36;
/// Most rows: workgroups in one dimension of a dispatch.
const MOST_ROWS: u32 = 65_535;

/// How gaps are filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Windows on levels of coarser and coarser blocks; in production.
    Window,
    /// All pairs by multilevel summation.
    Exact,
    /// All pairs through shared memory.
    Pairs,
    /// All pairs from global memory.
    NaivePairs,
}

impl Form {
    /// All forms, the quickest first.
    pub const ALL: [Self; 4] = [Self::Window, Self::Exact, Self::Pairs, Self::NaivePairs];

    /// What tables and settings call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Window => "window",
            Self::Exact => "exact",
            Self::Pairs => "pairs",
            Self::NaivePairs => "naive-pairs",
        }
    }
}

/// A frame without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled {
    /// Values; [`MISSING`] outside the domain, and everywhere if the frame had no data at all.
    pub values: Vec<f32>,
    /// Estimated error (1σ) of each value in its unit: 0 where it was measured, the weighted spread of what it was
    /// filled from elsewhere, [`MISSING`] where there is no value.
    pub errors: Vec<f32>,
}

/// What a filling starts from.
pub struct Task {
    scaled: Scaled,
    /// 1 for missing cells of the domain.
    gaps: Vec<u32>,
}

impl Task {
    /// None if there is nothing to fill, or nothing to fill it from.
    pub fn of(values: &[f32], domain: &[u32]) -> Option<Self> {
        let gap = |(value, domain): (&f32, &u32)| u32::from(*domain != 0 && !holds(*value));
        let gaps: Vec<u32> = values.iter().zip(domain).map(gap).collect();
        if gaps.iter().all(|gap| *gap == 0) {
            return None;
        }
        Some(Self {
            scaled: Scaled::of(values)?,
            gaps,
        })
    }

    fn pairs(&self) -> u64 {
        let gaps = self.gaps.iter().filter(|gap| **gap != 0).count() as u64;
        gaps * self
            .scaled
            .values
            .iter()
            .filter(|value| holds(**value))
            .count() as u64
    }

    /// The frame with the answers of a device or a twin in its gaps.
    pub fn filled(&self, values: &[f32], answers: &[f32]) -> Filled {
        let mut filled = unfilled(values);
        let (means, squares) = answers.split_at(values.len());
        for (cell, _) in self.gaps.iter().enumerate().filter(|(_, gap)| **gap != 0) {
            filled.values[cell] = self.scaled.value(means[cell]);
            let variance = squares[cell] - means[cell] * means[cell];
            filled.errors[cell] = self.scaled.deviation(variance);
        }
        filled
    }
}

/// The frame as it is.
fn unfilled(values: &[f32]) -> Filled {
    let value = |value: &f32| if holds(*value) { *value } else { MISSING };
    let error = |value: &f32| if holds(*value) { 0.0 } else { MISSING };
    Filled {
        values: values.iter().map(value).collect(),
        errors: values.iter().map(error).collect(),
    }
}

fn exact_ladder(grid: &Grid) -> Result<Ladder, RenderError> {
    exact::ladder(grid).ok_or(RenderError::NoExactFill)
}

fn check_pairs(pairs: u64, limit: u64) -> Result<(), RenderError> {
    if pairs > limit {
        Err(RenderError::TooManyPairs { pairs, limit })
    } else {
        Ok(())
    }
}

/// Fills one frame with the twins; the same bits as on a device.
///
/// `values`, `domain`: `[row, col]`, one number a cell; values NaN or [`MISSING`] where there is no data.
pub fn on_cpu(
    form: Form,
    grid: &Grid,
    values: &[f32],
    domain: &[u32],
) -> Result<Filled, RenderError> {
    Band::of(grid, values, domain).filled(values, domain, |grid, values, domain| {
        let Some(task) = Task::of(values, domain) else {
            return Ok(unfilled(values));
        };
        let scaled = &task.scaled.values;
        let answers = match form {
            Form::Window => window::cpu::answers(&window::ladder(grid), scaled, &task.gaps),
            Form::Exact => exact::cpu::answers(&exact_ladder(grid)?, scaled, &task.gaps),
            Form::Pairs | Form::NaivePairs => {
                check_pairs(task.pairs(), MOST_PAIRS_ON_CPU)?;
                pairs::cpu::answers(grid, &pairs::tables(grid), scaled, &task.gaps)
            }
        };
        Ok(task.filled(values, &answers))
    })
}

/// The shaders of all forms; the true ones but for tests.
pub struct Sources {
    pub window: Cow<'static, str>,
    pub exact: Cow<'static, str>,
    pub pairs: Cow<'static, str>,
    pub stencil: Cow<'static, str>,
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            window: window::SOURCE.into(),
            exact: exact::SOURCE.into(),
            pairs: pairs::SOURCE.into(),
            stencil: STENCIL_SOURCE.into(),
        }
    }
}

/// The compiled stage; forms that production has no use for are compiled when first asked for.
pub struct Fill {
    sources: Sources,
    window: Window,
    exact: OnceLock<Exact>,
    pairs: OnceLock<Pairs>,
    /// Tables of the last grid of the window's form: products have many frames of one grid.
    tables: Mutex<Option<Arc<DeviceLadder>>>,
}

impl Fill {
    /// Compiles the form in production.
    pub fn new(gpu: &Gpu, sources: Sources) -> Self {
        Self {
            window: Window::new(gpu, &sources),
            exact: OnceLock::new(),
            pairs: OnceLock::new(),
            tables: Mutex::default(),
            sources,
        }
    }

    /// Does a grid fit the device? The twins fill any.
    pub fn fits(gpu: &Gpu, grid: &Grid) -> bool {
        grid.rows <= MOST_ROWS && 12 * grid.cell_count() as u64 <= gpu.most_buffer_bytes()
    }

    /// Fills one frame on the device; see [`on_cpu`].
    pub fn run(
        &self,
        gpu: &Gpu,
        form: Form,
        grid: &Grid,
        values: &[f32],
        domain: &[u32],
    ) -> Result<Filled, RenderError> {
        Band::of(grid, values, domain).filled(values, domain, |grid, values, domain| {
            let Some(task) = Task::of(values, domain) else {
                return Ok(unfilled(values));
            };
            let prepared = self.prepared(gpu, form, grid, &task)?;
            let mut recorder = gpu.recorder();
            prepared.record(&mut recorder, prepared.pieces());
            let answers = recorder.download(prepared.answers(), 2 * values.len())?;
            Ok(task.filled(values, &answers))
        })
    }

    /// Brings a task to the device.
    pub fn prepared(
        &self,
        gpu: &Gpu,
        form: Form,
        grid: &Grid,
        task: &Task,
    ) -> Result<Prepared<'_>, RenderError> {
        let (values, gaps) = (&task.scaled.values, &task.gaps);
        Ok(Prepared(match form {
            Form::Window => {
                let ladder = self.window_tables(gpu, grid)?;
                Ready::Window(&self.window, Rooms::new(gpu, &ladder, values, gaps)?)
            }
            Form::Exact => {
                let ladder = DeviceLadder::new(gpu, grid, &exact_ladder(grid)?)?;
                let exact = self.exact.get_or_init(|| Exact::new(gpu, &self.sources));
                Ready::Exact(exact, Rooms::new(gpu, &ladder, values, gaps)?)
            }
            Form::Pairs | Form::NaivePairs => {
                let is_naive = form == Form::NaivePairs;
                check_pairs(task.pairs(), MOST_PAIRS)?;
                if !is_naive && grid.cols > pairs::MOST_COLS {
                    let (bytes, limit) =
                        (4 * u64::from(grid.cols), 4 * u64::from(pairs::MOST_COLS));
                    return Err(RenderError::TooLarge {
                        what: "weights of a row",
                        bytes,
                        limit,
                    });
                }
                let pairs = self
                    .pairs
                    .get_or_init(|| Pairs::new(gpu, &self.sources.pairs));
                let rooms = PairRooms::new(gpu, grid, values, gaps)?;
                Ready::Pairs(pairs, Box::new(rooms), is_naive)
            }
        }))
    }

    fn window_tables(&self, gpu: &Gpu, grid: &Grid) -> Result<Arc<DeviceLadder>, RenderError> {
        let mut kept = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tables) = kept.as_ref().filter(|tables| tables.grid == *grid) {
            return Ok(Arc::clone(tables));
        }
        let tables = Arc::new(DeviceLadder::new(gpu, grid, &window::ladder(grid))?);
        *kept = Some(Arc::clone(&tables));
        Ok(tables)
    }
}

/// A filling with everything on the device, ready to be recorded any number of times.
pub struct Prepared<'a>(Ready<'a>);

enum Ready<'a> {
    Window(&'a Window, Rooms),
    Exact(&'a Exact, Rooms),
    Pairs(&'a Pairs, Box<PairRooms>, bool),
}

impl Prepared<'_> {
    /// How many pieces it is made of, which may be recorded apart.
    pub fn pieces(&self) -> u32 {
        match &self.0 {
            Ready::Window(..) | Ready::Exact(..) => 1,
            Ready::Pairs(_, rooms, is_naive) => rooms.pieces(*is_naive),
        }
    }

    /// Records its first `pieces`.
    pub fn record(&self, recorder: &mut crate::gpu::Recorder<'_>, pieces: u32) {
        match &self.0 {
            Ready::Window(window, rooms) => window.record(recorder, rooms),
            Ready::Exact(exact, rooms) => exact.record(recorder, rooms),
            Ready::Pairs(pairs, rooms, is_naive) => {
                pairs.record(recorder, rooms, *is_naive, pieces);
            }
        }
    }

    /// Where the answers come: means, then mean squares, one a cell.
    pub fn answers(&self) -> &wgpu::Buffer {
        match &self.0 {
            Ready::Window(_, rooms) | Ready::Exact(_, rooms) => &rooms.levels[0].answers,
            Ready::Pairs(_, rooms, _) => &rooms.answers,
        }
    }
}
