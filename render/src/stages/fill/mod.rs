//! Gap filling: one field in, the same field with the missing cells of the product's domain filled in and an estimate
//! of the error of each, out. Done once when a field is loaded, because it depends on the product only.
//!
//! All forms are inverse distance weighting of power 2 (Shepard 1968, doi:10.1145/800186.810616) with the distance on
//! the sphere: [`window`] is what products are drawn with, [`exact`] gives the answer of all pairs of cells. Every product of two numbers is rounded before it is added, on every device, so that a
//! form has the same bits on all of them and on the processor. Land is what holds no data in any step: it stays empty.

mod band;
pub mod cpu;
pub mod exact;
pub mod ladder;
pub mod level;
mod on_device;
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
use scaled::{Scaled, holds};
use window::Window;

/// The shader of the sums that [`window`] and [`exact`] share.
pub const STENCIL_SOURCE: &str = concat!(include_str!("fill.wgsl"), include_str!("stencil.wgsl"));

/// Most rows: workgroups in one dimension of a dispatch.
const MOST_ROWS: u32 = 65_535;

/// How gaps are filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Windows on levels of coarser and coarser blocks; in production.
    Window,
    /// All pairs by multilevel summation.
    Exact,
}

impl Form {
    /// All forms, the quickest first.
    pub const ALL: [Self; 2] = [Self::Window, Self::Exact];

    /// What tables and settings call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Window => "window",
            Self::Exact => "exact",
        }
    }
}

/// A field without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled {
    /// Values; [`MISSING`] outside the domain, and everywhere if the field had no data at all.
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

    /// The field with the answers of a device or a twin in its gaps.
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

/// The field as it is.
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

/// Fills one field with the twins; the same bits as on a device.
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
        };
        Ok(task.filled(values, &answers))
    })
}

/// The shaders of all forms; the true ones but for tests.
pub struct Sources {
    pub window: Cow<'static, str>,
    pub exact: Cow<'static, str>,
    pub stencil: Cow<'static, str>,
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            window: window::SOURCE.into(),
            exact: exact::SOURCE.into(),
            stencil: STENCIL_SOURCE.into(),
        }
    }
}

/// The compiled stage; forms that production has no use for are compiled when first asked for.
pub struct Fill {
    sources: Sources,
    window: Window,
    exact: OnceLock<Exact>,
    /// Tables of the last grid of the window's form: products have many fields of one grid.
    tables: Mutex<Option<Arc<DeviceLadder>>>,
}

impl Fill {
    /// Compiles the form in production.
    pub fn new(gpu: &Gpu, sources: Sources) -> Self {
        Self {
            window: Window::new(gpu, &sources),
            exact: OnceLock::new(),
            tables: Mutex::default(),
            sources,
        }
    }

    /// Does a grid fit the device? The twins fill any.
    pub fn fits(gpu: &Gpu, grid: &Grid) -> bool {
        grid.rows <= MOST_ROWS && 12 * grid.cell_count() as u64 <= gpu.most_buffer_bytes()
    }

    /// Fills one field on the device; see [`on_cpu`].
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
            prepared.record(&mut recorder);
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
}

impl Prepared<'_> {
    /// Records all of it.
    pub fn record(&self, recorder: &mut crate::gpu::Recorder<'_>) {
        match &self.0 {
            Ready::Window(window, rooms) => window.record(recorder, rooms),
            Ready::Exact(exact, rooms) => exact.record(recorder, rooms),
        }
    }

    /// Where the answers come: means, then mean squares, one a cell.
    pub fn answers(&self) -> &wgpu::Buffer {
        match &self.0 {
            Ready::Window(_, rooms) | Ready::Exact(_, rooms) => &rooms.levels[0].answers,
        }
    }
}
