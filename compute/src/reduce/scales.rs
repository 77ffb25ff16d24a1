//! Extremes of steps and the steps of every bin in; which bins are summed together out, and in which scale, so that none is lost beside far
//! larger ones.

use std::collections::{BTreeMap, BTreeSet};

use cube::scale::Scale;

/// How far the values of a bin may lie below the largest ones of its scale, as a power of two: of the 44 bits that these have, values have
/// 34 then, ten more than are stored, and squares 28.
const LEAST_SHARE_BITS: i32 = 10;

/// Smallest and largest value of steps with data, by their index, stored unit.
pub(super) type Extremes = BTreeMap<u32, (f32, f32)>;

/// Bins that are summed in a scale of their own.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SmallBins {
    /// Their numbers, ascending.
    pub(super) bins: Vec<usize>,
    /// The steps that reach into them.
    pub(super) steps: BTreeSet<u32>,
    /// That of the values of these steps.
    pub(super) scale: Scale,
}

/// A bin that holds data: its number, its smallest and its largest value.
type Held = (usize, (f32, f32));

/// Bins that the scale of all values would say little or nothing of, those of like size together; `steps_of` are the steps of each bin.
/// Zeros are what they are in any scale.
pub(super) fn small_bins(extremes: &Extremes, steps_of: &[Vec<u32>]) -> Vec<SmallBins> {
    let all = between(extremes.values().copied());
    all.map_or_else(Vec::new, |all| bins_below(size(all), extremes, steps_of))
}

/// The same of bins in a scale of values up to `told`.
pub(super) fn bins_below(told: f64, extremes: &Extremes, steps_of: &[Vec<u32>]) -> Vec<SmallBins> {
    let own =
        |steps: &Vec<u32>| between(steps.iter().filter_map(|step| extremes.get(step).copied()));
    let held = steps_of.iter().map(own).enumerate();
    let held = held.filter_map(|(bin, own)| own.map(|own| (bin, own)));
    let mut left: Vec<Held> = held.filter(|(_, own)| size(*own) > 0.0).collect();
    let mut largest = told;
    let mut found = vec![];
    loop {
        let least = largest * f64::from(-LEAST_SHARE_BITS).exp2();
        let (together, smaller): (Vec<Held>, Vec<Held>) =
            left.into_iter().partition(|(_, own)| size(*own) >= least);
        // The first are those that the scale of all values tells.
        if largest < told {
            found.extend(of_like_size(&together, steps_of));
        }
        let next = smaller.iter().map(|(_, own)| size(*own));
        largest = next.fold(0.0, f64::max);
        left = smaller;
        if left.is_empty() {
            return found;
        }
    }
}

fn of_like_size(together: &[Held], steps_of: &[Vec<u32>]) -> Option<SmallBins> {
    let (low, high) = between(together.iter().map(|(_, own)| *own))?;
    let bins: Vec<usize> = together.iter().map(|(bin, _)| *bin).collect();
    let steps = bins.iter().flat_map(|bin| steps_of[*bin].iter().copied());
    Some(SmallBins {
        steps: steps.collect(),
        scale: Scale::over((low.into(), high.into())),
        bins,
    })
}

/// The smallest and the largest of some; none of nothing.
pub(super) fn between(extremes: impl Iterator<Item = (f32, f32)>) -> Option<(f32, f32)> {
    extremes.reduce(|(low, high), (min, max)| (low.min(min), high.max(max)))
}

/// The largest distance from 0.
fn size((low, high): (f32, f32)) -> f64 {
    f64::from(low.abs().max(high.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_far_below_the_largest_are_summed_apart_and_those_of_like_size_together() {
        let extremes: Extremes = [
            (0, (-1e5, 3e4)),
            (1, (200.0, 300.0)),
            (2, (1e-9, 4e-9)),
            (3, (0.0, 0.0)),
            (4, (-2e-9, 1e-9)),
            (6, (1e-20, 1e-20)),
        ]
        .into();
        let steps_of = [0, 1, 2, 3, 4, 5, 6].map(|step| vec![step]);
        let found = small_bins(&extremes, &steps_of);
        let bins: Vec<Vec<usize>> = found.iter().map(|own| own.bins.clone()).collect();
        assert_eq!(bins, [vec![2, 4], vec![6]]);
        assert_eq!(found[0].steps, BTreeSet::from([2, 4]));
        assert_eq!(
            found[0].scale,
            Scale::over((f64::from(-2e-9f32), f64::from(4e-9f32)))
        );
        for own in &found {
            for step in &own.steps {
                let (low, high) = extremes[step];
                assert!(own.scale.holds(low) && own.scale.holds(high));
            }
        }
        // A small step beside a large one in one bin is as small in its mean.
        assert!(small_bins(&extremes, &[vec![0, 2], vec![1, 6]]).is_empty());
        assert!(small_bins(&Extremes::new(), &steps_of).is_empty());
        // Beside what a scale may hold all of them are small, and no bin without steps is.
        let found = bins_below(1e9, &extremes, &[vec![], vec![2, 4], vec![0]]);
        let bins: Vec<Vec<usize>> = found.iter().map(|own| own.bins.clone()).collect();
        assert_eq!(bins, [vec![2], vec![1]]);
    }
}
