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

use std::ops::Range;

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
        let mut out = Regridded {
            values: vec![],
            coverage: vec![],
        };
        let source_rows = u32::try_from(self.source_cells / self.source_cols.max(1)).ok()?;
        for row in 0..self.rows.len() {
            let mut row = self.row(row);
            row.take(0..source_rows, values);
            for (value, coverage) in row.finish() {
                out.values.push(value);
                out.coverage.push(coverage);
            }
        }
        Some(out)
    }

    /// One row of the target, still without values.
    ///
    /// # Panics
    /// The target has no such row.
    pub fn row(&self, row: usize) -> TargetRow<'_> {
        TargetRow {
            regridder: self,
            row: &self.rows[row],
            taken: 0,
            sums: vec![(0.0, 0.0); self.cols.len()],
        }
    }

    /// Of every row of the target the first row of the source that it or one further south is made of.
    pub fn first_rows(&self) -> Vec<u32> {
        let mut first = u32::MAX;
        let mut of_row = |row: &Parts| {
            let own = row.parts.first().map_or(u32::MAX, |(row, _)| *row);
            first = first.min(own);
            first
        };
        let mut rows: Vec<u32> = self.rows.iter().rev().map(&mut of_row).collect();
        rows.reverse();
        rows
    }
}

/// A row of the target that is being made: rows of the source in, from the north to the south, values out.
#[derive(Debug)]
pub struct TargetRow<'a> {
    regridder: &'a Regridder,
    row: &'a Parts,
    /// Rows of the source that are in it already.
    taken: usize,
    /// By column, of values times weight and of weights.
    sums: Vec<(f64, f64)>,
}

impl TargetRow<'_> {
    /// The next row of the source that it needs; none if it is complete.
    pub fn next_row(&self) -> Option<u32> {
        self.row.parts.get(self.taken).map(|(row, _)| *row)
    }

    /// Takes what it needs of some rows of the source, `[row, col]`, which begin no further south than the next one.
    pub fn take(&mut self, rows: Range<u32>, values: &[f32]) {
        let cols = self.regridder.source_cols;
        while let Some(&(row, row_weight)) = self.row.parts.get(self.taken) {
            if !rows.contains(&row) {
                break;
            }
            let start = (row - rows.start) as usize * cols;
            let source = &values[start..start + cols];
            for (col, (sum, covered)) in self.regridder.cols.iter().zip(&mut self.sums) {
                for &(source_col, col_weight) in &col.parts {
                    let value = source[source_col as usize];
                    if !value.is_nan() {
                        let weight = row_weight * col_weight;
                        *sum += f64::from(value) * weight;
                        *covered += weight;
                    }
                }
            }
            self.taken += 1;
        }
    }

    /// Value and coverage of its cells: NaN where no data covers one.
    pub fn finish(self) -> impl Iterator<Item = (f64, f64)> {
        let cells = self.sums.into_iter().zip(&self.regridder.cols);
        cells.map(move |((sum, covered), col)| {
            if covered > 0.0 {
                (sum / covered, covered / (self.row.whole * col.whole))
            } else {
                (f64::NAN, 0.0)
            }
        })
    }
}

#[cfg(test)]
mod tests;
