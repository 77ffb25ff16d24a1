//! Percentiles, exact: the range that holds one is narrowed pass by pass, until one value is left.
//!
//! A percentile is the smallest value that at least so much of all weight lies at or below: of the values themselves, without
//! interpolation between them.

use std::collections::{BTreeMap, BTreeSet};

use contract::statistics::Percentile;
use contract::time::Period;

use super::bins::{BinSums, times};
use super::histogram::{Buckets, Histograms};
use super::order::{number_of, value_of};
use super::question::Wanted;

/// Most buckets of all ranges of a pass together, in bits: 32 MiB of weights.
const PASS_BITS: u32 = 21;
/// Fewest and most of a range.
const RANGE_BITS: std::ops::RangeInclusive<u32> = 4..=12;

/// A search for the percentile of a bin.
#[derive(Debug, Clone, PartialEq)]
struct Search {
    bin: usize,
    percentile: Percentile,
    /// Numbers that it lies between.
    low: u32,
    high: u32,
    /// Weight below `low`.
    below: i128,
    /// Weight that must lie at or below it.
    target: i128,
}

/// Searches for all percentiles of all bins.
#[derive(Debug)]
pub(super) struct Searches {
    all: Vec<Search>,
}

/// A pass over the values: what is asked, and which range each search looks at.
pub(super) struct Pass {
    pub(super) wanted: Wanted,
    ranges: Vec<Buckets>,
    by_search: Vec<Option<usize>>,
}

impl Searches {
    pub(super) fn new(bins: &[BinSums], percentiles: &[Percentile]) -> Self {
        let mut all = vec![];
        for (at, bin) in bins
            .iter()
            .enumerate()
            .filter(|(_, bin)| bin.sums.count > 0)
        {
            let search = |percentile: &Percentile| Search {
                bin: at,
                percentile: *percentile,
                low: number_of(bin.sums.min),
                high: number_of(bin.sums.max),
                below: 0,
                target: least_part(bin.sums.weight, *percentile),
            };
            all.extend(percentiles.iter().map(search));
        }
        Self { all }
    }

    /// The next pass; none if every search has ended. `steps` are those of the version.
    pub(super) fn next_pass(&self, bins: &[BinSums], steps: &[Period]) -> Option<Pass> {
        let open = |search: &&Search| search.low < search.high;
        let key = |search: &Search| (search.bin, search.low, search.high);
        let distinct: BTreeSet<_> = self.all.iter().filter(open).map(key).collect();
        let count = u32::try_from(distinct.len()).unwrap_or(u32::MAX);
        let for_each = PASS_BITS.saturating_sub(count.max(1).next_power_of_two().ilog2());
        let bits = for_each.clamp(*RANGE_BITS.start(), *RANGE_BITS.end());
        let numbered: BTreeMap<_, usize> = distinct.iter().copied().zip(0..).collect();
        let ranges: Vec<Buckets> = distinct
            .iter()
            .map(|&(_bin, low, high)| Buckets::new(low, high, bits))
            .collect();
        let mut by_step: BTreeMap<u32, Vec<(u32, i64)>> = BTreeMap::new();
        for (&(bin, ..), &range) in &numbered {
            let (_unit_ms, times) = times(steps, bins[bin].period);
            for (step, time) in times {
                by_step.entry(step).or_default().push((range as u32, time));
            }
        }
        let by_search = self
            .all
            .iter()
            .map(|search| numbered.get(&key(search)).copied());
        (!distinct.is_empty()).then(|| Pass {
            wanted: Wanted::Histograms {
                ranges: ranges.clone(),
                steps: by_step,
            },
            ranges,
            by_search: by_search.collect(),
        })
    }

    /// Narrows every search by what a pass found. None if that is not all the weight of a bin.
    pub(super) fn narrow(&mut self, pass: &Pass, found: &Histograms) -> Option<()> {
        for (search, range) in self.all.iter_mut().zip(&pass.by_search) {
            let Some(range) = *range else { continue };
            let weights = found.of(range).iter().enumerate();
            let mut below = search.below;
            let mut bucket = None;
            for (at, weight) in weights {
                if below + weight >= search.target {
                    bucket = Some(at);
                    break;
                }
                below += weight;
            }
            (search.low, search.high) = pass.ranges[range].bounds(bucket?);
            search.below = below;
        }
        Some(())
    }

    /// The percentiles that were found, stored unit, by bin.
    pub(super) fn values(self) -> BTreeMap<(usize, Percentile), f32> {
        let value = |search: Search| ((search.bin, search.percentile), value_of(search.low));
        self.all.into_iter().map(value).collect()
    }
}

/// The least weight that is so large a share of all; a step of it at least.
pub(crate) fn least_part(weight: i128, percentile: Percentile) -> i128 {
    let (part, whole) = percentile.share();
    let (part, whole) = (i128::from(part), i128::from(whole));
    // In two parts, neither of which leaves 128 bits.
    let rest = (weight % whole) * part;
    (weight / whole * part + rest / whole + i128::from(rest % whole > 0)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduce::accumulator::{Accumulated, StepSums};
    use crate::reduce::bins::bin_sums;

    fn day(day: u32) -> Period {
        let (from, to) = (
            format!("2000-01-{day:02}"),
            format!("2000-01-{:02}", day + 1),
        );
        Period::new(from.parse().unwrap(), to.parse().unwrap()).unwrap()
    }

    /// Percentiles of values with weights, all of one bin of as many days.
    fn found(values: &[(f32, i128)], percentiles: &[&str]) -> (Vec<f32>, usize) {
        let percentiles: Vec<Percentile> = percentiles.iter().map(|p| p.parse().unwrap()).collect();
        let steps: Vec<Period> = (1..).map(day).take(values.len()).collect();
        let sums = |(value, weight): (f32, i128)| StepSums {
            count: 1,
            weight,
            min: value,
            max: value,
            ..StepSums::default()
        };
        let accumulated = Accumulated {
            steps: (0..).zip(values.iter().copied().map(sums)).collect(),
            ..Accumulated::default()
        };
        let whole = Period::new(steps[0].start, steps[steps.len() - 1].end).unwrap();
        let bins = bin_sums(&steps, &[whole], &accumulated).unwrap();
        let mut searches = Searches::new(&bins, &percentiles);
        let mut passes = 0;
        while let Some(pass) = searches.next_pass(&bins, &steps) {
            passes += 1;
            assert!(passes < 10, "no end");
            let Wanted::Histograms { ranges, steps } = &pass.wanted else {
                panic!("a pass asks for histograms")
            };
            let mut histograms = Histograms::default();
            for (step, own) in steps {
                let (value, weight) = values[*step as usize];
                for (range, time) in own {
                    let range = *range as usize;
                    let weight = weight * i128::from(*time);
                    histograms.add(range, ranges[range], value, weight).unwrap();
                }
            }
            searches.narrow(&pass, &histograms).unwrap();
        }
        let by = searches.values();
        let values = percentiles.iter().map(|percentile| by[&(0, *percentile)]);
        (values.collect(), passes)
    }

    #[test]
    fn percentiles_are_values_with_so_much_weight_at_or_below() {
        let even = [(3.0, 1), (1.0, 1), (4.0, 1), (2.0, 1)];
        let (values, _) = found(&even, &["0", "25", "25.001", "50", "75", "100"]);
        assert_eq!(values, [1.0, 1.0, 2.0, 2.0, 3.0, 4.0]);
        // The heaviest decides.
        let uneven = [(-1e-9, 1), (5e-9, 7), (1e-12, 2)];
        let (values, passes) = found(&uneven, &["10", "30", "31", "99"]);
        assert_eq!(values, [-1e-9, 1e-12, 5e-9, 5e-9]);
        assert!((2..=3).contains(&passes), "{passes}");
        let (values, passes) = found(&[(7.25, 3), (7.25, 4)], &["50"]);
        assert_eq!((values, passes), (vec![7.25], 0));
    }

    #[test]
    fn targets_are_rounded_up_and_do_not_overflow() {
        let of = |weight, percentile: &str| least_part(weight, percentile.parse().unwrap());
        assert_eq!((of(10, "50"), of(11, "50"), of(10, "0")), (5, 6, 1));
        assert_eq!(of(1 << 120, "100"), 1 << 120);
        assert_eq!(of(1 << 120, "50"), 1 << 119);
    }
}
