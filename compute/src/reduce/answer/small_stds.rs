//! Bins and what they were summed in, in; standard deviations of those whose values differ by so little that squares do not tell it, out.

use std::collections::{BTreeMap, BTreeSet};

use contract::statistics::{Statistic, StatisticsQuery};
use contract::time::Period;
use cube::scale::Scale;

use super::Reduction;
use crate::ComputeError;
use crate::reduce::accumulator::StepSums;
use crate::reduce::bins::{BinSums, times};
use crate::reduce::question::Wanted;
use crate::reduce::scales::between;

/// A bin whose values differ: its number, its smallest and its largest value.
type Held = (usize, (f32, f32));

impl Reduction<'_> {
    /// Standard deviations, stored unit, by the numbers of their bins: of those alone that sums in the `scales` of the bins do not tell. That of equal values
    /// is 0, others are summed again between the extremes of all of them, and at last each between its own, which takes further passes over their steps.
    pub(super) async fn small_stds(
        &self,
        query: &StatisticsQuery,
        (bins, scales): (&[BinSums], &[Scale]),
        periods: &[Period],
    ) -> Result<BTreeMap<usize, f64>, ComputeError> {
        let mut found = BTreeMap::new();
        if !query.statistics.iter().any(|one| one == Statistic::Std) {
            return Ok(found);
        }
        let is_small = |at: &usize| {
            let (sums, scale) = (&bins[*at].sums, scales[*at]);
            sums.count > 0 && !scale.tells_std(std_of(scale, sums))
        };
        let (one, several): (Vec<usize>, Vec<usize>) = (0..bins.len())
            .filter(is_small)
            .partition(|at| bins[*at].sums.count == 1);
        found.extend(one.into_iter().map(|at| (at, 0.0)));
        if several.is_empty() {
            return Ok(found);
        }
        let extremes = if self.extremes.is_empty() {
            self.found_extremes().await?
        } else {
            self.extremes.clone()
        };
        let steps_of = |at: usize| times(periods, bins[at].period).1;
        let own = |at: usize| {
            let steps = steps_of(at).into_iter();
            between(steps.filter_map(|(step, _)| extremes.get(&step).copied()))
        };
        let mut left: Vec<Held> = vec![];
        for at in several {
            match own(at).filter(|(low, high)| low < high) {
                Some(extremes) => left.push((at, extremes)),
                None => {
                    found.insert(at, 0.0);
                }
            }
        }
        let mut are_together = true;
        while !left.is_empty() {
            let size = if are_together { left.len() } else { 1 };
            let mut again: Vec<Held> = vec![];
            for group in left.chunks(size) {
                let Some(extremes) = between(group.iter().map(|(_, own)| *own)) else {
                    continue;
                };
                let scale = Scale::over((extremes.0.into(), extremes.1.into()));
                let steps: BTreeSet<u32> = group
                    .iter()
                    .flat_map(|(at, _)| steps_of(*at))
                    .map(|(step, _)| step)
                    .collect();
                let of_group: Vec<Period> = group.iter().map(|(at, _)| bins[*at].period).collect();
                let wanted = Wanted::Sums {
                    with_squares: true,
                    with_extremes: false,
                };
                let sums = self.summed_again((scale, wanted), &steps, (periods, &of_group));
                let sums = sums.await?;
                for (held, own) in group.iter().zip(sums) {
                    let std = std_of(scale, &own.sums);
                    if !are_together || scale.tells_std(std) {
                        found.insert(held.0, std);
                    } else {
                        again.push(*held);
                    }
                }
            }
            are_together = 2 * again.len() <= left.len();
            left = again;
        }
        Ok(found)
    }
}

/// As the sums have it, stored unit.
fn std_of(scale: Scale, sums: &StepSums) -> f64 {
    scale.std(sums.squares, sums.sum, sums.weight)
}
