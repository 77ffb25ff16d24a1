//! Weights of cells as whole numbers: how much of each the geometry has, and how much of that coverage counts.

use contract::chunk::{Window, field_chunks};
use contract::earth::Earth;
use contract::grid::Grid;
use cube::BLOCK_CELLS;
use cube::weight_unit::{WeightUnit, largest_cell_m2};

use super::region_sums::CellArea;
use crate::budget::bands::band_of;
use crate::region::loaded::RegionWeights;

/// Shares of a cell below this are counted in steps of their own largest one: a sliver in one cell has a mean too.
const SLIVER: f64 = 1.0 / 65_536.0;
const WORD_BITS: usize = 64;

/// That of areas: of the grid's largest cell, so that whole cells have the same weight in every region.
pub(super) fn unit_of_areas(grid: &Grid, earth: Earth, weights: &RegionWeights) -> WeightUnit {
    let cell_m2 = largest_cell_m2(grid, earth);
    let largest = largest(weights);
    WeightUnit::of(if largest < cell_m2 * SLIVER {
        largest
    } else {
        cell_m2
    })
}

/// That of other weights: of the largest.
pub(super) fn unit_of_largest(weights: &RegionWeights) -> WeightUnit {
    WeightUnit::of(largest(weights))
}

fn largest(weights: &RegionWeights) -> f64 {
    weights.cells().fold(f64::MIN_POSITIVE, f64::max)
}

/// Weight of a cell, in steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct CellWeight {
    /// What its value is summed with.
    pub(super) weight: i64,
    /// What coverage counts of it.
    pub(super) covered: i64,
}

/// Rows and columns of a grid.
pub(super) type Shape = [u32; 2];

/// The window of a block of 8 x 8 cells, as values along time are cut: those of its cells that the grid has.
pub(super) fn block_window([rows, cols]: Shape, number: u32) -> Window {
    let across = cols.div_ceil(BLOCK_CELLS).max(1);
    let (row, col) = (number / across * BLOCK_CELLS, number % across * BLOCK_CELLS);
    Window {
        row,
        col,
        rows: BLOCK_CELLS.min(rows.saturating_sub(row)),
        cols: BLOCK_CELLS.min(cols.saturating_sub(col)),
    }
}

/// Windows of chunks of a grid, as fields are cut.
pub(super) fn chunks(shape: Shape) -> Vec<Window> {
    field_chunks(&shape_only(shape))
}

/// A grid of which only the shape is known.
fn shape_only([rows, cols]: Shape) -> Grid {
    Grid {
        rows,
        cols,
        north_deg: 0.0,
        west_deg: 0.0,
        dlat_deg: 0.0,
        dlon_deg: 0.0,
    }
}

/// Cells of a window as 8 x 8 of a block, wherever the grid ends: those beyond it have nothing of the geometry.
pub(super) fn block<C: Copy + Default>(own: Vec<C>, window: Window) -> Vec<C> {
    let (side, cols) = (BLOCK_CELLS as usize, window.cols as usize);
    if own.len() == side * side {
        return own;
    }
    let mut cells = vec![C::default(); side * side];
    for (all, own) in cells.chunks_exact_mut(side).zip(own.chunks_exact(cols)) {
        all[..cols].copy_from_slice(own);
    }
    cells
}

/// A geometry's weights on a grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cells<'a> {
    pub(super) shape: Shape,
    /// What is summed.
    pub(super) whole: &'a RegionWeights,
    /// What coverage counts.
    pub(super) covered: &'a RegionWeights,
    pub(super) unit: WeightUnit,
}

impl Cells<'_> {
    /// Weights of the cells of a window, row-major.
    pub(super) fn window(&self, window: Window) -> Vec<CellWeight> {
        let mut cells = vec![CellWeight::default(); window.cell_count()];
        let steps = self.unit.counting();
        for (row, own) in (window.row..).zip(cells.chunks_exact_mut(window.cols as usize)) {
            self.fill(self.whole, row, window.col, own, |cell, weight| {
                cell.weight = steps(weight);
            });
            self.fill(self.covered, row, window.col, own, |cell, weight| {
                cell.covered = steps(weight);
            });
        }
        cells
    }

    /// Areas of the cells of a window, row-major.
    pub(super) fn areas(&self, window: Window, grid: &Grid) -> Vec<CellArea> {
        let mut cells = vec![CellArea::default(); window.cell_count()];
        for (row, own) in (window.row..).zip(cells.chunks_exact_mut(window.cols as usize)) {
            let band = band_of(grid, row) as u8;
            for cell in &mut *own {
                cell.band = band;
            }
            self.fill(self.whole, row, window.col, own, |cell, area_m2| {
                cell.whole_m2 = area_m2;
            });
            self.fill(self.covered, row, window.col, own, |cell, area_m2| {
                cell.sea_m2 = area_m2;
            });
        }
        cells
    }

    /// Sets weights of a run of cells of a row.
    fn fill<C>(
        &self,
        weights: &RegionWeights,
        row: u32,
        first_col: u32,
        cells: &mut [C],
        set: impl Fn(&mut C, f64),
    ) {
        let end = first_col + cells.len() as u32;
        weights.each_in_row(self.shape[1], row, first_col..end, |col, weight| {
            set(&mut cells[(col - first_col) as usize], weight);
        });
    }

    /// Numbers of the blocks that hold weight, increasing; a bit a block is held to find them.
    pub(super) fn blocks(&self) -> Vec<u32> {
        let [down, across] = self.shape.map(|cells| cells.div_ceil(BLOCK_CELLS));
        let mut held = vec![0u64; (down as usize * across as usize).div_ceil(WORD_BITS)];
        let windows = chunks(self.shape);
        for (chunk, weights) in self.whole.chunks() {
            let window = windows[chunk as usize];
            let cols = window.cols as usize;
            for (row, row_start) in (window.row..).zip((0..window.cell_count()).step_by(cols)) {
                let first = row as usize / BLOCK_CELLS as usize * across as usize;
                let weights = weights.runs(row_start..row_start + cols);
                for (cells, _) in weights.filter(|(_, weight)| *weight > 0.0) {
                    let [west, east] = [cells.start, cells.end - 1].map(|cell| {
                        first + (window.col as usize + cell - row_start) / BLOCK_CELLS as usize
                    });
                    for block in west..=east {
                        held[block / WORD_BITS] |= 1 << (block % WORD_BITS);
                    }
                }
            }
        }
        let bits = held.iter().enumerate().flat_map(|(word, bits)| {
            let own = (0..WORD_BITS).filter(move |bit| bits >> bit & 1 == 1);
            own.map(move |bit| (word * WORD_BITS + bit) as u32)
        });
        bits.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_find_the_weights_of_their_cells_across_chunks() {
        let shape = [130, 250];
        let grid = shape_only(shape);
        let weight = |cell: usize| (cell % 101) as f64;
        let weigh = |factor: f64| {
            let chunk = |(chunk, window): (usize, &Window)| {
                let cells = window.cell_indices(&grid).map(|cell| weight(cell) * factor);
                (chunk as u32, cells.collect::<Vec<f64>>())
            };
            RegionWeights::new(chunks(shape).iter().enumerate().map(chunk).collect())
        };
        let (whole, covered) = (weigh(1.0), weigh(0.5));
        let cells = Cells {
            shape,
            whole: &whole,
            covered: &covered,
            unit: unit_of_largest(&whole),
        };
        let step = cells.unit.size();
        let blocks = contract::chunk::windows(&grid, BLOCK_CELLS, BLOCK_CELLS);
        let numbers = 0..blocks.len() as u32;
        let own: Vec<Window> = numbers.map(|number| block_window(shape, number)).collect();
        assert_eq!(own, blocks);
        for window in blocks.iter().copied().chain(chunks(shape)) {
            let found = cells.window(window);
            assert_eq!(found.len(), window.cell_count());
            for (cell, own) in window.cell_indices(&grid).zip(found) {
                assert_eq!(own.weight, (weight(cell) / step) as i64);
                assert_eq!(own.covered, (weight(cell) * 0.5 / step) as i64);
            }
        }
        let all: Vec<u32> = (0..blocks.len() as u32).collect();
        assert_eq!(cells.blocks(), all);
    }

    #[test]
    fn what_is_hardly_there_has_weight() {
        let weights = RegionWeights::new(vec![(0, vec![1e9, 1e-9, 0.0])]);
        let unit = unit_of_largest(&weights);
        assert_eq!(unit.steps(1e-9), 1);
        assert_eq!(unit.steps(0.0), 0);
        assert!(unit.steps(1e9) >= 1 << cube::weight_unit::WEIGHT_BITS);
    }
}
