//! A version of accumulated carbon, weights of a geometry and the last step of a question in; in words how much of the sums there holds
//! less than all of its time, out.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::bands;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};
use storage::contributed::{Contributed, Reader};

use crate::derive::accumulated_from;
use crate::region::loaded::RegionWeights;
use crate::{ComputeError, Engine};

/// Cells whose counts are held at a time.
const BAND_CELLS: u64 = 1 << 22;

/// What is to be said of the sums after a step over the cells that a geometry has `weights` of; nothing where all are complete, where there are none, and of
/// other products than accumulated carbon.
///
/// A sum that is complete after a step was so after those before it: the last step of a question says the least that holds of all of them.
///
/// # Errors
/// Counts that are damaged, or cannot be read.
pub(crate) async fn told_of_sums(
    engine: &Engine,
    manifest: &Manifest,
    weights: &Arc<RegionWeights>,
    last: &Step,
) -> Result<Option<String>, ComputeError> {
    if accumulated_from(manifest).is_none() {
        return Ok(None);
    }
    let (Some(counted), Some(newest)) = (&last.contributed, manifest.steps.last()) else {
        let unknown = "how much of their time these sums hold was not counted when they were made: fluxglobe derive accumulated counts it";
        return Ok(Some(unknown.to_owned()));
    };
    // The whole grid has no other sums than complete ones.
    if counted.complete_cells == last.valid_cells {
        return Ok(None);
    }
    let (store, grid) = (engine.store(), manifest.grid);
    let own = Reader::open(store, &counted.counts, &grid).await?;
    // A cell whose first data come later has a sum, of nothing: who holds none at last has none.
    let at_last = newest.contributed.as_ref();
    let at_last = match at_last.filter(|at_last| at_last.counts != counted.counts) {
        Some(at_last) => Some(Reader::open(store, &at_last.counts, &grid).await?),
        None => None,
    };
    let (weights, period) = (Arc::clone(weights), own.period());
    let held = tokio::task::spawn_blocking(move || Held::of(&grid, &weights, own, at_last));
    let held = held
        .await
        .map_err(|e| ComputeError::inconsistent("completeness of sums", e))??;
    Ok(held.told().map(|told| {
        format!(
            "sums since {} until {}: {told}",
            period.start, last.period.end
        )
    }))
}

/// What the sums of some cells hold, each by its weight.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Held {
    /// Of cells that have a sum.
    all: f64,
    /// Of those whose sum holds all of its time.
    complete: f64,
    /// Of the time that sums hold, as a share of all of it.
    time: f64,
}

impl Held {
    /// After a step, of the cells that `at_last`, if that is another one, has any data of.
    fn of(
        grid: &Grid,
        weights: &RegionWeights,
        mut own: Reader,
        mut at_last: Option<Reader>,
    ) -> Result<Self, ComputeError> {
        let mut held = Self::default();
        for rows in bands(grid, BAND_CELLS) {
            let row_count = rows.len() as u32;
            let counts = own.rows(row_count)?;
            let later = at_last.as_mut().map(|reader| reader.rows(row_count));
            let later = later.transpose()?;
            held.add(grid.cols, weights, &rows, (&counts, later.as_ref()));
        }
        Ok(held)
    }

    /// Adds the cells of a band of `rows`, of which the counts are.
    fn add(
        &mut self,
        cols: u32,
        weights: &RegionWeights,
        rows: &Range<u32>,
        (counts, later): (&Contributed, Option<&Contributed>),
    ) {
        let period_ms = (counts.period.end.ms() - counts.period.start.ms()) as f64;
        let with_a_sum = &later.unwrap_or(counts).milliseconds;
        for row in rows.clone() {
            let first = (row - rows.start) as usize * cols as usize;
            weights.each_in_row(cols, row, 0..cols, |col, weight| {
                let cell = first + col as usize;
                if with_a_sum[cell] == 0 {
                    return;
                }
                self.all += weight;
                self.time += weight * counts.milliseconds[cell] as f64 / period_ms;
                if counts.is_complete(cell) {
                    self.complete += weight;
                }
            });
        }
    }

    /// In words; nothing where all sums are complete.
    fn told(self) -> Option<String> {
        let incomplete = (self.all - self.complete) / self.all;
        // A sum of all weights and one of those of complete cells are the same where these are all.
        (self.all > 0.0 && self.complete < self.all).then(|| {
            format!(
                "those of {} of what has any lack some of that time, which adds nothing to them; all together hold {:.2} % of it",
                percent(incomplete),
                100.0 * self.time / self.all
            )
        })
    }
}

/// A share that is not nothing, as people read it.
fn percent(share: f64) -> String {
    if share < 1e-4 {
        "less than 0.01 %".to_owned()
    } else {
        format!("{:.2} %", 100.0 * share)
    }
}

#[cfg(test)]
mod tests {
    use contract::time::{Period, TimeMs};

    use super::*;

    fn counts(milliseconds: [i64; 4]) -> Contributed {
        let at = |ms| TimeMs::new(ms).unwrap();
        Contributed {
            period: Period::new(at(0), at(100)).unwrap(),
            of_steps: 4,
            steps: vec![0; 4],
            milliseconds: milliseconds.to_vec(),
        }
    }

    #[test]
    fn cells_count_by_their_weight_and_those_without_a_sum_not_at_all() {
        let weights = RegionWeights::new(vec![(0, vec![3.0, 1.0, 0.0, 4.0])]);
        let told = |own: [i64; 4], later: Option<[i64; 4]>| {
            let (own, later) = (counts(own), later.map(counts));
            let mut held = Held::default();
            held.add(2, &weights, &(0..2), (&own, later.as_ref()));
            held.told()
        };
        let half = told([100, 50, 0, 0], None).unwrap();
        assert!(half.starts_with("those of 25.00 % of"), "{half}");
        assert!(half.ends_with("hold 87.50 % of it"), "{half}");
        // The last cell has its first data later: its sum is one of nothing.
        let more = told([100, 50, 0, 0], Some([100, 50, 0, 1])).unwrap();
        assert!(more.starts_with("those of 62.50 % of"), "{more}");
        // What lacks data lies beside the geometry.
        assert_eq!(told([100, 100, 1, 0], None), None);
        assert_eq!(told([0; 4], None), None);
    }

    #[test]
    fn hardly_any_is_not_none() {
        assert_eq!(percent(1e-7), "less than 0.01 %");
        assert_eq!(percent(0.123_456), "12.35 %");
    }
}
