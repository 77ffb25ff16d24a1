//! Which cells of a grid a statistic is wanted of: all, or those that lie in a region, wholly or in part.

use contract::ContractError;
use contract::chunk::{Window, field_chunks};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::region::AskedRegion;
use storage::domain::Cells;

use crate::ComputeError;
use crate::awaited::Awaited;
use crate::region::weights::{Surface, shared_of};

/// Cells that are wanted.
pub(super) enum Wanted {
    /// Every cell.
    All,
    /// By their place, row-major.
    Some(Cells),
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
        let mut cells = Cells::none(grid.cell_count());
        let (region, awaited) = (&asked.region, &Awaited::always());
        let weights = shared_of(grid, region, Earth::Wgs84, &Surface::All, None, awaited)?;
        for (chunk, areas) in weights {
            let places = chunks[chunk as usize].cell_indices(grid);
            let own = places.zip(areas.iter()).filter(|(_, area)| *area > 0.0);
            own.for_each(|(place, _)| cells.insert(place));
        }
        if !cells.is_any() {
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
            Self::Some(cells) => cells.has(place),
        }
    }

    /// Is any of a window?
    pub(super) fn is_any_of(&self, grid: &Grid, window: Window) -> bool {
        match self {
            Self::All => true,
            Self::Some(_) => window.cell_indices(grid).any(|place| self.is(place)),
        }
    }

    /// How many are wanted of all cells of the grid.
    pub(super) fn all_count(&self, grid: &Grid) -> usize {
        match self {
            Self::All => grid.cell_count(),
            Self::Some(cells) => cells.count_in(0..grid.cell_count()),
        }
    }

    /// How many are wanted of these places.
    pub(super) fn count(&self, places: impl Iterator<Item = usize>) -> usize {
        places.filter(|place| self.is(*place)).count()
    }
}
