//! Shares of sea that a landed product says: how much of every cell is land, or sea, on the grid of what is summed.

use std::ops::Range;

use contract::chunk::{Window, field_chunks};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use serde::{Deserialize, Serialize};
use storage::weights::SharedAreas;

use super::found::Found;
use crate::ComputeError;

/// How far two grids of the same cells may be apart, in cells: axes of files are rounded.
const SLACK_CELLS: f64 = 1e-3;

/// Where sea comes from that no product says.
pub const NATURAL_EARTH: &str = "Natural Earth, land 1:50 million: exact, whatever the grid";

/// A stored field of shares.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shares {
    /// Its values, `[row, col]`, 0 to 1.
    #[serde(rename = "frame")]
    pub(crate) field: ObjectKey,
    /// What they are shares of.
    pub(crate) of: Of,
}

/// What shares are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Of {
    Land,
    Sea,
}

impl Shares {
    /// Those of one product for sums of another.
    ///
    /// # Errors
    /// `OceanShares` if it does not say shares, says them for several times, or for other cells.
    pub fn of(ocean: &Manifest, summed: &Manifest) -> Result<Self, ComputeError> {
        let refused = |reason: String| {
            Err(ComputeError::OceanShares {
                product: ocean.product.to_string(),
                reason,
            })
        };
        let of = match ocean.quantity {
            Quantity::LandAreaFraction => Of::Land,
            Quantity::SeaAreaFraction => Of::Sea,
            other => {
                return refused(format!(
                    "it holds {}; land a mask whose standard_name is land_area_fraction or sea_area_fraction",
                    other.word()
                ));
            }
        };
        let [step] = &ocean.steps[..] else {
            return refused(format!(
                "it has {} steps; shares of sea are one map",
                ocean.steps.len()
            ));
        };
        if !are_same_cells(&ocean.grid, &summed.grid) {
            return refused(format!(
                "its grid is {}, that of {} is {}; give shares on the grid of what is summed",
                grid_text(&ocean.grid),
                summed.product,
                grid_text(&summed.grid)
            ));
        }
        Ok(Self {
            field: step.field.clone(),
            of,
        })
    }

    /// Areas of the sea, m² by chunk, where `chunks` are a region's; only chunks with any. `values` is `[row, col]`.
    ///
    /// # Errors
    /// `OceanShares` if a cell of the region has no share: nothing says whether that is sea.
    pub(super) fn weigh(
        &self,
        grid: &Grid,
        chunks: &[(u32, SharedAreas)],
        values: &[f32],
    ) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
        let mut weighing = Weighing::new(self, grid, chunks);
        weighing.band(0..grid.rows, values)?;
        weighing.finish()
    }
}

/// The same of a map that comes in bands of rows, north to south.
pub(crate) struct Weighing<'a> {
    shares: &'a Shares,
    grid: Grid,
    windows: Vec<Window>,
    /// Those of the region that are still to come.
    chunks: &'a [(u32, SharedAreas)],
    unknown: u64,
    found: Found,
}

impl<'a> Weighing<'a> {
    pub(crate) fn new(shares: &'a Shares, grid: &Grid, chunks: &'a [(u32, SharedAreas)]) -> Self {
        Self {
            shares,
            grid: *grid,
            windows: field_chunks(grid),
            chunks,
            unknown: 0,
            found: Found::default(),
        }
    }

    /// Has the region anything in some rows?
    pub(crate) fn needs(&self, rows: &Range<u32>) -> bool {
        let next = self.chunks.first();
        next.is_some_and(|(chunk, _)| rows.contains(&self.windows[*chunk as usize].row))
    }

    /// Weighs the region's chunks in some rows: whole rows of chunks, `values` is `[row, col]` of them.
    ///
    /// # Errors
    /// The weights take more memory than there is for them.
    pub(crate) fn band(&mut self, rows: Range<u32>, values: &[f32]) -> Result<(), ComputeError> {
        let cols = self.grid.cols as usize;
        let first = rows.start as usize * cols;
        while let Some(((chunk, areas_m2), rest)) = self.chunks.split_first() {
            let window = self.windows[*chunk as usize];
            if window.row >= rows.end {
                break;
            }
            let mut areas_m2 = areas_m2.to_vec();
            let areas = window.cell_indices(&self.grid).zip(&mut areas_m2);
            for (cell, area_m2) in areas.filter(|(_, area_m2)| **area_m2 > 0.0) {
                let share = f64::from(values[cell - first]);
                self.unknown += u64::from(share.is_nan());
                *area_m2 *= match self.shares.of {
                    Of::Sea => share,
                    Of::Land => 1.0 - share,
                };
            }
            self.found.add(*chunk, &areas_m2)?;
            self.chunks = rest;
        }
        Ok(())
    }

    /// The chunks with any sea.
    ///
    /// # Errors
    /// `OceanShares` if a cell of the region has no share.
    pub(crate) fn finish(self) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
        let unknown = self.unknown;
        if unknown > 0 {
            return Err(ComputeError::OceanShares {
                product: self.shares.field.to_string(),
                reason: format!(
                    "{unknown} cells of the region have no value there; fill them with 0 or 1, or ask without it"
                ),
            });
        }
        Ok(self.found.chunks)
    }
}

/// Where sea comes from, for an answer.
pub(crate) fn source(ocean: Option<&Manifest>) -> String {
    let Some(manifest) = ocean else {
        return NATURAL_EARTH.to_owned();
    };
    let what = if manifest.quantity == Quantity::LandAreaFraction {
        "1 less land_area_fraction"
    } else {
        "sea_area_fraction"
    };
    format!("{}, {what}: {}", manifest.id(), manifest.title)
}

/// Are two grids the same but for the rounding of their axes?
pub(crate) fn are_same_cells(a: &Grid, b: &Grid) -> bool {
    let apart = |a: f64, b: f64, cell: f64| (a - b).abs() < SLACK_CELLS * cell;
    let turned = |west: f64| (west - b.west_deg + 180.0).rem_euclid(360.0) - 180.0;
    (a.rows, a.cols) == (b.rows, b.cols)
        && apart(a.north_deg, b.north_deg, b.dlat_deg)
        && apart(a.south_deg(), b.south_deg(), b.dlat_deg)
        && turned(a.west_deg).abs() < SLACK_CELLS * b.dlon_deg
        && apart(
            a.dlon_deg * f64::from(a.cols),
            b.dlon_deg * f64::from(b.cols),
            b.dlon_deg,
        )
}

/// A grid in words.
pub(crate) fn grid_text(grid: &Grid) -> String {
    let [west, south, east, north] = grid.bounds_deg();
    format!(
        "{} x {} cells from {west} to {east} degrees east and {south} to {north} degrees north",
        grid.rows, grid.cols
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 4,
        cols: 8,
        north_deg: 20.0,
        west_deg: -180.0,
        dlat_deg: 2.0,
        dlon_deg: 1.5,
    };

    #[test]
    fn axes_of_two_files_may_be_rounded_and_no_more() {
        let moved = |change: fn(&mut Grid)| {
            let mut grid = GRID;
            change(&mut grid);
            are_same_cells(&grid, &GRID)
        };
        assert!(moved(|_| ()));
        assert!(moved(|grid| grid.west_deg = 179.999_99));
        assert!(moved(|grid| grid.north_deg += 1e-4));
        assert!(!moved(|grid| grid.north_deg += 1.0));
        assert!(!moved(|grid| grid.west_deg += 0.75));
        assert!(!moved(|grid| grid.dlon_deg *= 1.001));
        assert!(!moved(|grid| grid.dlat_deg *= 1.001));
        assert!(!moved(|grid| (grid.rows, grid.cols) = (8, 4)));
    }

    #[test]
    fn land_and_sea_are_the_two_parts_of_a_cell() {
        let field: ObjectKey = "frames/mask/a".parse().unwrap();
        let mut values = vec![0.25; 32];
        let areas: SharedAreas = [vec![100.0; 31], vec![0.0]].concat().into();
        let areas = [(0, areas)];
        values[31] = f32::NAN; // outside of the region
        let shares = |of| Shares {
            field: field.clone(),
            of,
        };
        let weigh = |of, values: &[f32]| shares(of).weigh(&GRID, &areas, values);
        assert_eq!(
            weigh(Of::Sea, &values).unwrap()[0].1.to_vec()[3].to_bits(),
            25.0f64.to_bits()
        );
        assert_eq!(
            weigh(Of::Land, &values).unwrap()[0].1.to_vec()[3].to_bits(),
            75.0f64.to_bits()
        );
        values[7] = f32::NAN;
        let refused = weigh(Of::Land, &values).unwrap_err().to_string();
        assert!(
            refused.contains("1 cells") && refused.contains("frames/mask/a"),
            "{refused}"
        );
    }
}
