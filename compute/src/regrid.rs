//! Regridding: values on one regular latitude-longitude grid in, values on another out, with how much of each cell was covered.
//!
//! | method | value of a cell | covered |
//! |---|---|---|
//! | nearest | that of the cell which holds its centre | all or nothing |
//! | bilinear | of the four cells about its centre, linear in latitude and longitude, over those with data | sum of their factors |
//! | conservative | mean by exact area of overlap on WGS84, over what has data (first order: Jones 1999, doi:10.1175/1520-0493(1999)127<2204:FASOCR>2.0.CO;2) | share of its area |
//!
//! With the conservative method, value times covered share times area, summed, is the integral of the source over what both
//! grids have. Values are `[row, col]`, NaN without data; sums are of 64 bits in the order of the source.

pub mod axis;

use contract::computed::Regridding;
use contract::grid::Grid;

use axis::Parts;

/// From one grid to another; made once for all steps.
#[derive(Debug, Clone)]
pub struct Regridder {
    rows: Vec<Parts>,
    cols: Vec<Parts>,
    source_cols: usize,
    source_cells: usize,
}

/// What came of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Regridded {
    /// `[row, col]`, NaN where no data covers the cell.
    pub values: Vec<f64>,
    /// Share of every cell that data cover, 0 to 1.
    pub coverage: Vec<f64>,
}

impl Regridder {
    /// The weights of a method from one grid to another.
    pub fn new(source: &Grid, target: &Grid, method: Regridding) -> Self {
        let (rows, cols) = match method {
            Regridding::Nearest => (
                axis::nearest_rows(source, target),
                axis::nearest_cols(source, target),
            ),
            Regridding::Bilinear => (
                axis::bilinear_rows(source, target),
                axis::bilinear_cols(source, target),
            ),
            Regridding::Conservative => (
                axis::overlapping_rows(source, target),
                axis::overlapping_cols(source, target),
            ),
        };
        Self {
            rows,
            cols,
            source_cols: source.cols as usize,
            source_cells: source.cell_count(),
        }
    }

    /// Do the two grids have any place in common?
    pub fn touches(&self) -> bool {
        let any = |parts: &[Parts]| parts.iter().any(|it| !it.parts.is_empty());
        any(&self.rows) && any(&self.cols)
    }

    /// Brings a map over; none if it does not fill the source's grid.
    pub fn apply(&self, values: &[f32]) -> Option<Regridded> {
        if values.len() != self.source_cells {
            return None;
        }
        let cells = self
            .rows
            .iter()
            .flat_map(|row| self.cols.iter().map(move |col| (row, col)));
        let (values, coverage) = cells.map(|(row, col)| self.cell(values, row, col)).unzip();
        Some(Regridded { values, coverage })
    }

    fn cell(&self, values: &[f32], row: &Parts, col: &Parts) -> (f64, f64) {
        let (mut sum, mut covered) = (0.0, 0.0);
        for &(source_row, row_weight) in &row.parts {
            let start = source_row as usize * self.source_cols;
            for &(source_col, col_weight) in &col.parts {
                let value = values[start + source_col as usize];
                if !value.is_nan() {
                    let weight = row_weight * col_weight;
                    sum += f64::from(value) * weight;
                    covered += weight;
                }
            }
        }
        if covered > 0.0 {
            (sum / covered, covered / (row.whole * col.whole))
        } else {
            (f64::NAN, 0.0)
        }
    }
}

#[cfg(test)]
mod tests;
