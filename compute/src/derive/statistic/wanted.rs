//! Which cells of a grid a statistic is wanted of: all, or those that lie in a region, wholly or in part.

use contract::ContractError;
use contract::chunk::{Window, field_chunks};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::region::AskedRegion;

use crate::ComputeError;
use crate::region::weights::compute;

/// Cells that are wanted.
pub(super) enum Wanted {
    /// Every cell.
    All,
    /// By their place, row-major.
    Some(Vec<bool>),
}

impl Wanted {
    /// The cells of a product that a region holds any part of.
    ///
    /// # Errors
    /// It holds none, or cannot be laid on the grid.
    pub(super) fn of(
        manifest: &Manifest,
        region: Option<&AskedRegion>,
    ) -> Result<Self, ComputeError> {
        let Some(asked) = region else {
            return Ok(Self::All);
        };
        let grid = &manifest.grid;
        let chunks = field_chunks(grid);
        let mut cells = vec![false; grid.cell_count()];
        for (chunk, areas) in compute(grid, &asked.region, Earth::Wgs84)? {
            let places = chunks[chunk as usize].cell_indices(grid);
            for (place, area) in places.zip(areas) {
                cells[place] = area > 0.0;
            }
        }
        if !cells.contains(&true) {
            let reason = format!(
                "it lies outside the grid of {}, which covers {}",
                manifest.product,
                manifest.bounds_text()
            );
            return Err(ContractError::invalid("region", &asked.name, reason).into());
        }
        Ok(Self::Some(cells))
    }

    /// Is the cell at a place wanted?
    pub(super) fn is(&self, place: usize) -> bool {
        match self {
            Self::All => true,
            Self::Some(cells) => cells[place],
        }
    }

    /// Is any of a window?
    pub(super) fn is_any_of(&self, grid: &Grid, window: Window) -> bool {
        match self {
            Self::All => true,
            Self::Some(_) => window.cell_indices(grid).any(|place| self.is(place)),
        }
    }

    /// How many are wanted of these places.
    pub(super) fn count(&self, places: impl Iterator<Item = usize>) -> usize {
        places.filter(|place| self.is(*place)).count()
    }
}
