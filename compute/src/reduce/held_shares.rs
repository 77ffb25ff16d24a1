//! Shares of the cells of blocks, held for the geometries that were asked for last: tasks of a question to a cluster come one after the
//! other, and so do the passes of percentiles.

use std::sync::{Arc, Mutex, PoisonError};

use contract::digest::Digest;

use super::question::{Question, Wanted};
use super::remembered_shares::RememberedShares;

/// Geometries whose shares are held, some 16 MB each at most: a process works on one for some time, and seldom on many.
const HELD: usize = 2;

/// The last ones, newest first, by what they depend on, none of which ever changes.
#[derive(Debug, Default)]
pub(crate) struct HeldShares(Mutex<Vec<(Digest, Arc<RememberedShares>)>>);

impl HeldShares {
    /// Those of a question's geometry.
    pub(super) fn of(&self, question: &Question) -> Arc<RememberedShares> {
        let Question {
            whole,
            covered,
            shape,
            unit,
            wanted,
            ..
        } = question;
        // Areas count for sums over regions, and weights for all else.
        let grid = match wanted {
            Wanted::RegionSums { grid, .. } => Some(grid),
            Wanted::Sums { .. } | Wanted::Histograms { .. } => None,
        };
        let name = Digest::of_json(&(whole, covered, shape, unit, grid));
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let there = held.iter().position(|(own, _)| *own == name);
        let shares = there.map(|at| held.remove(at).1).unwrap_or_default();
        held.insert(0, (name, Arc::clone(&shares)));
        held.truncate(HELD);
        shares
    }
}

#[cfg(test)]
mod tests {
    use contract::grid::Grid;

    use super::*;
    use crate::budget::Measure;
    use crate::reduce::run::tests::question;

    #[test]
    fn the_same_geometry_has_the_same_shares_whatever_is_asked_of_it_and_no_other_has() {
        let held = HeldShares::default();
        let first = held.of(&question());
        let of_squares = Question {
            wanted: Wanted::Sums {
                with_squares: false,
                with_extremes: false,
            },
            ..question()
        };
        assert!(Arc::ptr_eq(&first, &held.of(&of_squares)));
        let grid = Grid {
            rows: 16,
            cols: 16,
            north_deg: 8.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        let others = [
            Question {
                whole: "other".into(),
                ..question()
            },
            Question {
                covered: "other".into(),
                ..question()
            },
            Question {
                shape: [16, 24],
                ..question()
            },
            Question {
                wanted: Wanted::RegionSums {
                    grid,
                    measure: Measure::Mean,
                },
                ..question()
            },
        ];
        for other in others {
            assert!(!Arc::ptr_eq(&first, &held.of(&other)), "{other:?}");
            assert!(
                Arc::ptr_eq(&first, &held.of(&question())),
                "it was asked for just now"
            );
        }
        assert_eq!(held.0.lock().unwrap().len(), HELD);
    }
}
