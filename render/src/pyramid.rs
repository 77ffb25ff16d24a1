//! Coarser versions of scenes: where many cells share a pixel, cells are drawn in blocks of four, of sixteen and so on.
//!
//! Values become means over cells with data; accumulated carbon becomes what keeps its mass. A block belongs to the
//! domain if any of its cells does. Every coarser version is made once and kept with what it was made from. The terrain
//! has a grid and coarser versions of its own.

use std::sync::Arc;

use contract::earth::Earth;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob};

use crate::plan::cell_px;
use crate::scene::{Cells, Frame, Interval, Scene, Terrain};
use crate::stages::layout::is_missing;

/// Cells smaller than this are joined, pixels: blocks then measure half a pixel to one.
const LEAST_CELL_PX: f64 = 0.5;
/// The same where particles drift: a cell sends out one at least, whose trail is many times as long.
const LEAST_FLOW_CELL_PX: f64 = 4.0;
/// Cells of the terrain smaller than this are joined, pixels: one pixel shows one cell, so what lies between is lost.
const LEAST_TERRAIN_CELL_PX: f64 = 1.0;

/// The version of a scene that a job is drawn from; none if it is the scene itself.
pub fn suited(job: &RenderJob, scene: &Scene) -> Option<Scene> {
    let product = suited_product(job, scene);
    let terrain = scene.terrain.as_ref();
    let Some(terrain) = terrain.and_then(|terrain| suited_terrain(job, terrain)) else {
        return product;
    };
    let mut suited = product.unwrap_or_else(|| scene.clone());
    suited.terrain = Some(terrain);
    Some(suited)
}

/// The coarser terrain that a job is drawn from; none if it is the terrain itself.
fn suited_terrain(job: &RenderJob, terrain: &Terrain) -> Option<Terrain> {
    let mut suited: Option<Terrain> = None;
    loop {
        let finest = suited.as_ref().unwrap_or(terrain);
        if cell_px(&job.view, &finest.grid) >= LEAST_TERRAIN_CELL_PX {
            return suited;
        }
        let Some(grid) = halved(&finest.grid) else {
            return suited;
        };
        let blocks = Blocks {
            fine: &finest.grid,
            grid: &grid,
        };
        let elevation = finest.elevation.coarser_mean(|cells| blocks.mean(cells));
        suited = Some(Terrain { grid, elevation });
    }
}

fn suited_product(job: &RenderJob, scene: &Scene) -> Option<Scene> {
    let least_px = match job.mode {
        Mode::Flow => LEAST_FLOW_CELL_PX,
        Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => LEAST_CELL_PX,
    };
    let mut suited: Option<Scene> = None;
    loop {
        let finest = suited.as_ref().unwrap_or(scene);
        if cell_px(&job.view, &finest.grid) >= least_px {
            return suited;
        }
        let Some(coarser) = coarser(finest) else {
            return suited;
        };
        suited = Some(coarser);
    }
}

/// A grid of blocks of two by two cells, if such blocks fit the earth.
fn halved(fine: &Grid) -> Option<Grid> {
    let grid = Grid {
        rows: fine.rows.div_ceil(2),
        cols: fine.cols.div_ceil(2),
        dlat_deg: 2.0 * fine.dlat_deg,
        dlon_deg: 2.0 * fine.dlon_deg,
        ..*fine
    };
    // An odd number of columns all round, or of rows down to a pole, cannot be halved.
    let fits = grid.validate().is_ok() && (fine.rows >= 2 || fine.cols >= 2);
    fits.then_some(grid)
}

/// The same scene in blocks of two by two cells, if such blocks fit the earth; its terrain stays as it is.
pub fn coarser(scene: &Scene) -> Option<Scene> {
    let fine = &scene.grid;
    let grid = halved(fine)?;
    let blocks = Blocks { fine, grid: &grid };
    let mean = |frame: &Arc<Frame>| frame.coarser_mean(|cells| blocks.mean(cells));
    let mass = |frame: &Arc<Frame>| frame.coarser_mass(|cells| blocks.mass(cells));
    let both = |interval: &Interval, coarser: &dyn Fn(&Arc<Frame>) -> Arc<Frame>| Interval {
        before: coarser(&interval.before),
        after: coarser(&interval.after),
        weight: interval.weight,
    };
    Some(Scene {
        grid,
        domain: Cells::coarser(&scene.domain, |cells| blocks.any(cells)),
        value: both(&scene.value, &mean),
        accumulated: scene
            .accumulated
            .as_ref()
            .map(|interval| both(interval, &mass)),
        terrain: scene.terrain.clone(),
        northward: scene
            .northward
            .as_ref()
            .map(|interval| both(interval, &mean)),
    })
}

struct Blocks<'a> {
    fine: &'a Grid,
    grid: &'a Grid,
}

impl Blocks<'_> {
    /// One number for every block from the fine rows and cells in it.
    fn each<T>(&self, block: impl Fn(&mut dyn Iterator<Item = (u32, usize)>, u32) -> T) -> Vec<T> {
        let (rows, cols) = (self.fine.rows, self.fine.cols);
        let blocks =
            (0..self.grid.rows).flat_map(|row| (0..self.grid.cols).map(move |col| (row, col)));
        let cells = |row: u32, col: u32| {
            let down = 2 * row..(2 * row + 2).min(rows);
            down.flat_map(move |row| {
                let across = 2 * col..(2 * col + 2).min(cols);
                across.map(move |col| (row, row as usize * cols as usize + col as usize))
            })
        };
        blocks
            .map(|(row, col)| block(&mut cells(row, col), row))
            .collect()
    }

    fn any(&self, domain: &[u32]) -> Vec<u32> {
        self.each(|mut cells, _| {
            u32::from(Iterator::any(&mut cells, |(_, cell)| domain[cell] != 0))
        })
    }

    fn mean(&self, values: &[f32]) -> Vec<f32> {
        self.each(|cells, _| {
            let (mut sum, mut count) = (0.0, 0.0);
            for (_, cell) in cells {
                if !is_missing(values[cell]) {
                    sum += values[cell];
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { f32::NAN }
        })
    }

    fn mass(&self, kg_m2: &[f32]) -> Vec<f32> {
        let fine_m2: Vec<f64> = (0..self.fine.rows)
            .map(|row| self.fine.cell_area_m2(row, Earth::Wgs84))
            .collect();
        let block_m2: Vec<f64> = (0..self.grid.rows)
            .map(|row| self.grid.cell_area_m2(row, Earth::Wgs84))
            .collect();
        self.each(|cells, row| {
            let mut mass_kg = None;
            for (fine_row, cell) in cells {
                if !is_missing(kg_m2[cell]) {
                    let own_kg = f64::from(kg_m2[cell]) * fine_m2[fine_row as usize];
                    mass_kg = Some(mass_kg.unwrap_or(0.0) + own_kg);
                }
            }
            mass_kg.map_or(f32::NAN, |mass_kg: f64| {
                (mass_kg / block_m2[row as usize]) as f32
            })
        })
    }
}
