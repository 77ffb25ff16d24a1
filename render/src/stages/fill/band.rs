//! The rows of a grid that hold the domain: rows of ice and land round the poles are no part of the work.

use contract::grid::Grid;

use super::Filled;
use super::scaled::holds;
use crate::error::RenderError;
use crate::stages::layout::MISSING;

/// Rows from the first to the last with a cell of the domain.
pub(super) struct Band {
    grid: Grid,
    first: usize,
    end: usize,
}

impl Band {
    /// The band of a domain and of data; empty if both are.
    pub(super) fn of(grid: &Grid, values: &[f32], domain: &[u32]) -> Self {
        let cols = grid.cols as usize;
        let is_part = |(value, domain): (&f32, &u32)| *domain != 0 || holds(*value);
        let mut cells = values.iter().zip(domain);
        let last = cells.clone().rposition(is_part);
        let first = cells.position(is_part).unwrap_or_default();
        let (first, end) = (first / cols, last.map_or(0, |last| last / cols + 1));
        let north_deg = if first == 0 {
            grid.north_deg
        } else {
            grid.row_north_deg(first as u32)
        };
        let grid = Grid {
            rows: end.saturating_sub(first) as u32,
            north_deg,
            ..*grid
        };
        Self {
            grid,
            first: first * cols,
            end: end * cols,
        }
    }

    /// What `fill` makes of the band, with nothing in the rows round it.
    pub(super) fn filled(
        &self,
        values: &[f32],
        domain: &[u32],
        fill: impl FnOnce(&Grid, &[f32], &[u32]) -> Result<Filled, RenderError>,
    ) -> Result<Filled, RenderError> {
        let band = self.first.min(self.end)..self.end;
        if band.is_empty() {
            return Ok(super::unfilled(values));
        }
        let filled = fill(&self.grid, &values[band.clone()], &domain[band])?;
        let widened = |band: &[f32]| {
            let mut whole = vec![MISSING; self.first];
            whole.extend_from_slice(band);
            whole.resize(values.len(), MISSING);
            whole
        };
        Ok(Filled {
            values: widened(&filled.values),
            errors: widened(&filled.errors),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 5,
        cols: 2,
        north_deg: 90.0,
        west_deg: 0.0,
        dlat_deg: 30.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn rows_without_a_domain_are_left_out_and_come_back_empty() {
        let domain = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0];
        let value = |cell: u8| {
            if (2..8).contains(&cell) {
                f32::from(cell)
            } else {
                f32::NAN
            }
        };
        let values: Vec<f32> = (0..10).map(value).collect();
        let band = Band::of(&GRID, &values, &domain);
        let filled = band.filled(&values, &domain, |grid, values, domain| {
            assert_eq!((grid.rows, grid.north_deg), (3, 60.0));
            assert_eq!(domain, [0, 1, 0, 0, 1, 1]);
            Ok(Filled {
                values: values.to_vec(),
                errors: vec![0.0; values.len()],
            })
        });
        let filled = filled.unwrap();
        assert_eq!(filled.values[2..8], values[2..8]);
        let outside = [0, 1, 8, 9];
        assert!(
            outside
                .iter()
                .all(|cell| filled.values[*cell] == MISSING && filled.errors[*cell] == MISSING)
        );
    }

    #[test]
    fn without_a_domain_nothing_is_filled() {
        let band = Band::of(&GRID, &[f32::NAN; 10], &[0; 10]);
        let filled = band.filled(&[f32::NAN; 10], &[0; 10], |_, _, _| {
            unreachable!("there is no row")
        });
        assert!(filled.unwrap().values.iter().all(|value| *value == MISSING));
    }
}
