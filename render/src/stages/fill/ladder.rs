//! The levels of one form of filling for a grid, the finest first.

use contract::grid::Grid;

use super::level::{FillLevel, Table};

/// One level with its weights.
#[derive(Debug, Clone)]
pub struct Rung {
    pub level: FillLevel,
    pub table: Table,
}

/// Levels, the finest first; each knows the size of the next.
#[derive(Debug, Clone)]
pub struct Ladder {
    pub rungs: Vec<Rung>,
}

impl Ladder {
    /// Links levels of these tables to their coarser neighbours; `coarser_pad_cols` and `lean` as in [`FillLevel`].
    pub(super) fn new(
        grid: &Grid,
        levels: Vec<([u32; 2], Table)>,
        coarser_pad_cols: u32,
        lean: f32,
    ) -> Self {
        let sizes: Vec<[u32; 2]> = levels.iter().map(|(size, _)| *size).collect();
        let rung = |(index, ([rows, cols], table)): (usize, ([u32; 2], Table))| {
            let coarser = sizes.get(index + 1);
            let [coarser_rows, coarser_cols] = coarser.copied().unwrap_or_default();
            let level = FillLevel {
                rows,
                cols,
                periodic: u32::from(grid.is_periodic()),
                reach_rows: table.reach_rows,
                reach_cols: table.reach_cols,
                coarser_rows,
                coarser_cols,
                coarser_pad_cols,
                is_masked: 0,
                has_coarser: u32::from(coarser.is_some()),
                lean,
                zero: 0,
            };
            Rung { level, table }
        };
        Self {
            rungs: levels.into_iter().enumerate().map(rung).collect(),
        }
    }

    /// Marks the levels of which only wanted cells are computed.
    pub(super) fn masked(mut self, is_masked: impl Fn(usize) -> bool) -> Self {
        for (index, rung) in self.rungs.iter_mut().enumerate() {
            rung.level.is_masked = u32::from(is_masked(index));
        }
        self
    }
}
