//! Values of a step as they come, in bands of rows, given out so many cells at a time: more are not held than that and a band.

use contract::grid::Grid;

use crate::{ExportError, Values};

/// What is left of a step.
pub(crate) struct Cells<'a> {
    bands: Values<'a>,
    /// Came, and not given out yet; from `at` on.
    waiting: Vec<f32>,
    at: usize,
    /// Of the whole step.
    all: usize,
    given: usize,
}

impl<'a> Cells<'a> {
    /// Those of a step on a grid.
    pub(crate) fn new(bands: Values<'a>, grid: &Grid) -> Self {
        Self {
            bands,
            waiting: vec![],
            at: 0,
            all: grid.cell_count(),
            given: 0,
        }
    }

    /// The next ones, so many or all that are left; none after the last.
    ///
    /// # Errors
    /// `Shape` if the step has fewer or more values than its grid has cells.
    pub(crate) fn next(&mut self, count: usize) -> Result<Option<&[f32]>, ExportError> {
        let wanted = count.min(self.all - self.given);
        if self.waiting.len() - self.at < wanted || wanted == 0 {
            self.waiting.drain(..self.at);
            self.at = 0;
        }
        while self.waiting.len() < wanted.max(1) {
            match self.bands.next() {
                Some(band) if self.waiting.is_empty() => self.waiting = band,
                Some(band) => self.waiting.extend(band),
                None => break,
            }
        }
        let held = self.waiting.len() - self.at;
        if held < wanted || (wanted == 0 && held > 0) {
            let rest: usize = self.bands.map(|band| band.len()).sum();
            return Err(ExportError::Shape {
                found: self.given + held + rest,
                cells: self.all,
            });
        }
        if wanted == 0 {
            return Ok(None);
        }
        let start = self.at;
        self.at += wanted;
        self.given += wanted;
        Ok(Some(&self.waiting[start..self.at]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 5,
        cols: 4,
        north_deg: 5.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    /// What is given out of bands of so many rows, in parts of so many cells.
    fn parts(rows: &[usize], count: usize) -> Result<Vec<Vec<f32>>, ExportError> {
        let mut first = 0;
        let mut bands = rows.iter().map(|rows| {
            let cells = first..first + rows * 4;
            first = cells.end;
            cells.map(|cell| cell as f32).collect()
        });
        let mut cells = Cells::new(&mut bands, &GRID);
        let mut parts = vec![];
        while let Some(part) = cells.next(count)? {
            parts.push(part.to_vec());
        }
        Ok(parts)
    }

    #[test]
    fn cells_come_in_their_order_however_they_are_cut() {
        let all: Vec<f32> = (0..20).map(|cell| cell as f32).collect();
        for rows in [&[5][..], &[2, 2, 1], &[1, 1, 1, 1, 1], &[4, 1]] {
            for count in [1, 3, 8, 20, 100] {
                let parts = parts(rows, count).unwrap();
                assert_eq!(parts.concat(), all, "{rows:?} {count}");
                assert!(parts[..parts.len() - 1].iter().all(|it| it.len() == count));
            }
        }
    }

    #[test]
    fn too_few_and_too_many_are_refused_before_the_last_is_taken_for_the_end() {
        for (rows, found) in [
            (&[2, 2][..], 16),
            (&[5, 1], 24),
            (&[3, 3], 24),
            (&[6], 24),
            (&[], 0),
        ] {
            for count in [1, 8, 100] {
                let Err(ExportError::Shape { found: own, cells }) = parts(rows, count) else {
                    panic!("{rows:?} {count}");
                };
                assert_eq!((own, cells), (found, 20), "{rows:?} {count}");
            }
        }
    }
}
