//! Cross-validation: a field in, part of its data hidden, and how far what it was filled with lies from the truth, out.

use render::stages::fill::scaled::holds;
use render::stages::layout::MISSING;
use render::stages::particles::cpu::hash;

/// What is hidden.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldOut {
    /// Share of the cells with data, 0 to 1.
    pub share: f64,
    /// Side of the square blocks that are hidden whole, cells: 1 hides single cells, a cloud hides many together.
    pub side_cells: u32,
    /// Another one hides other blocks.
    pub seed: u32,
}

impl HoldOut {
    /// The field with blocks of data hidden (`cols` a row), and the cells hidden. The same for every run: blocks are
    /// chosen by a hash of their place.
    pub fn hide(&self, values: &[f32], cols: u32) -> (Vec<f32>, Vec<usize>) {
        let threshold = (self.share.clamp(0.0, 1.0) * f64::from(u32::MAX)) as u32;
        let side = self.side_cells.max(1);
        let mut kept = values.to_vec();
        let mut hidden = vec![];
        for (cell, value) in kept
            .iter_mut()
            .enumerate()
            .filter(|(_, value)| holds(**value))
        {
            let (row, col) = (cell as u32 / cols, cell as u32 % cols);
            let block = hash(hash(hash(self.seed) ^ (row / side)) ^ (col / side));
            if block < threshold {
                *value = MISSING;
                hidden.push(cell);
            }
        }
        (kept, hidden)
    }
}

/// How far filled values lie from hidden ones, in the unit of the values.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Score {
    /// Cells hidden and filled.
    pub cells: u64,
    sum: f64,
    sum_sq: f64,
    estimate_sq: f64,
    within: u64,
    truth: f64,
    truth_sq: f64,
}

impl Score {
    /// The score of one field: `filled` and `errors` against the values that were hidden in `cells`.
    pub fn of(truth: &[f32], filled: &[f32], errors: &[f32], cells: &[usize]) -> Self {
        let mut score = Self::default();
        for &cell in cells.iter().filter(|cell| holds(filled[**cell])) {
            let (truth, error) = (f64::from(truth[cell]), f64::from(errors[cell]));
            let apart = f64::from(filled[cell]) - truth;
            score.cells += 1;
            score.sum += apart;
            score.sum_sq += apart * apart;
            score.estimate_sq += error * error;
            score.within += u64::from(apart.abs() <= 2.0 * error);
            score.truth += truth;
            score.truth_sq += truth * truth;
        }
        score
    }

    /// Both scores as one.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            cells: self.cells + other.cells,
            sum: self.sum + other.sum,
            sum_sq: self.sum_sq + other.sum_sq,
            estimate_sq: self.estimate_sq + other.estimate_sq,
            within: self.within + other.within,
            truth: self.truth + other.truth,
            truth_sq: self.truth_sq + other.truth_sq,
        }
    }

    fn mean(&self, sum: f64) -> Option<f64> {
        (self.cells > 0).then(|| sum / self.cells as f64)
    }

    /// Root of the mean squared difference; none if nothing was hidden.
    pub fn rmse(&self) -> Option<f64> {
        self.mean(self.sum_sq).map(f64::sqrt)
    }

    /// Mean of filled minus true.
    pub fn bias(&self) -> Option<f64> {
        self.mean(self.sum)
    }

    /// Root mean square of the estimated errors (1σ): equal to [`Score::rmse`] where the estimates are right.
    pub fn estimated(&self) -> Option<f64> {
        self.mean(self.estimate_sq).map(f64::sqrt)
    }

    /// Share of cells within twice their estimated error; 0.95 for a normal distribution.
    pub fn within_two_sigma(&self) -> Option<f64> {
        self.mean(self.within as f64)
    }

    /// Standard deviation of the hidden values: what filling with their mean would be wrong by.
    pub fn spread(&self) -> Option<f64> {
        let (mean, mean_sq) = (self.mean(self.truth)?, self.mean(self.truth_sq)?);
        Some((mean_sq - mean * mean).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_data_is_hidden_the_same_every_time_and_never_land() {
        let values: Vec<f32> = (0..10_000)
            .map(|i| if i % 4 == 0 { f32::NAN } else { i as f32 })
            .collect();
        let single = HoldOut {
            share: 0.2,
            side_cells: 1,
            seed: 1,
        };
        let (kept, hidden) = single.hide(&values, 100);
        assert!((1300..1700).contains(&hidden.len()), "{}", hidden.len());
        assert!(
            hidden
                .iter()
                .all(|cell| cell % 4 != 0 && kept[*cell] == MISSING)
        );
        assert_eq!(single.hide(&values, 100).1, hidden);
        assert_ne!(HoldOut { seed: 2, ..single }.hide(&values, 100).1, hidden);
        // Blocks are hidden whole.
        let (_, blocks) = HoldOut {
            side_cells: 10,
            ..single
        }
        .hide(&vec![1.0; 10_000], 100);
        assert!(!blocks.is_empty() && blocks.len() % 100 == 0);
    }

    #[test]
    fn a_score_tells_bias_from_scatter() {
        let truth = [1.0, 2.0, 3.0, 4.0];
        let score = Score::of(
            &truth,
            &[1.5, 2.5, 3.5, MISSING],
            &[0.2, 0.5, 0.5, MISSING],
            &[0, 1, 2, 3],
        );
        assert_eq!(score.cells, 3, "what could not be filled is not counted");
        assert!((score.rmse().unwrap() - 0.5).abs() < 1e-12);
        assert!((score.bias().unwrap() - 0.5).abs() < 1e-12);
        assert!((score.within_two_sigma().unwrap() - 2.0 / 3.0).abs() < 1e-12);
        assert!((score.spread().unwrap() - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
        let opposite = Score::of(&truth, &[0.5, 1.5, 2.5, 0.0], &[1.0; 4], &[0, 1, 2]);
        assert_eq!(score.with(opposite).bias(), Some(0.0));
        assert_eq!(Score::default().rmse(), None);
    }
}
