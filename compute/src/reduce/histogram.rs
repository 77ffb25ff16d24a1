//! Weights of values by ranges: percentiles are found by narrowing a range until one value is left.

use serde::{Deserialize, Serialize};

use super::bytes::{Reader, put_short};
use super::order::number_of;

/// Numbers of values ([`super::order`]) from `low` to `high`, cut into buckets of 2^`shift` of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Buckets {
    pub(super) low: u32,
    pub(super) high: u32,
    shift: u32,
}

impl Buckets {
    /// At most 2^`bits` of them.
    pub(super) fn new(low: u32, high: u32, bits: u32) -> Self {
        let width = u32::BITS - (high - low).leading_zeros();
        Self {
            low,
            high,
            shift: width.saturating_sub(bits),
        }
    }

    fn count(self) -> usize {
        ((self.high - self.low) >> self.shift) as usize + 1
    }

    fn of(self, number: u32) -> Option<usize> {
        let inside = (self.low..=self.high).contains(&number);
        inside.then(|| ((number - self.low) >> self.shift) as usize)
    }

    /// First and last number of a bucket.
    pub(super) fn bounds(self, bucket: usize) -> (u32, u32) {
        let low = self.low + ((bucket as u32) << self.shift);
        let width = (1u32 << self.shift) - 1;
        (low, low.saturating_add(width).min(self.high))
    }
}

/// Weights in the buckets of some ranges; of a range nothing was added to there are none.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Histograms {
    /// By the number of the range.
    weights: Vec<Vec<i128>>,
}

impl Histograms {
    /// Weights of a range by bucket.
    pub(super) fn of(&self, range: usize) -> &[i128] {
        self.weights.get(range).map_or(&[], Vec::as_slice)
    }

    /// Adds a weight where a value lies. None if a sum leaves 128 bits.
    #[inline]
    pub(super) fn add(
        &mut self,
        range: usize,
        buckets: Buckets,
        value: f32,
        weight: i128,
    ) -> Option<()> {
        let Some(bucket) = buckets.of(number_of(value)) else {
            return Some(());
        };
        let own = &mut self.own(range)[..];
        let own = if own.is_empty() {
            self.weights[range] = vec![0; buckets.count()];
            &mut self.weights[range][bucket]
        } else {
            &mut self.weights[range][bucket]
        };
        *own = own.checked_add(weight)?;
        Some(())
    }

    fn own(&mut self, range: usize) -> &mut Vec<i128> {
        if self.weights.len() <= range {
            self.weights.resize(range + 1, vec![]);
        }
        &mut self.weights[range]
    }

    /// Adds others of the same ranges. None if a sum leaves 128 bits, or if they have other buckets.
    pub(super) fn merge(&mut self, other: Self) -> Option<()> {
        for (range, weights) in other.weights.into_iter().enumerate() {
            let own = self.own(range);
            if own.is_empty() {
                *own = weights;
            } else if !weights.is_empty() {
                if own.len() != weights.len() {
                    return None;
                }
                for (own, more) in own.iter_mut().zip(weights) {
                    *own = own.checked_add(more)?;
                }
            }
        }
        Some(())
    }

    /// As it passes from process to process: of a range its number of buckets and those that hold weight, each by how many empty ones lie
    /// before it. Weights have some 50 of their 128 bits.
    pub(super) fn write(&self, out: &mut Vec<u8>) {
        put_short(out, self.weights.len() as u128);
        for weights in &self.weights {
            put_short(out, weights.len() as u128);
            let weighty = (0..).zip(weights).filter(|(_, weight)| **weight != 0);
            put_short(out, weighty.clone().count() as u128);
            let mut next: u128 = 0;
            for (bucket, weight) in weighty {
                put_short(out, bucket - next);
                put_short(out, zigzag(*weight));
                next = bucket + 1;
            }
        }
    }

    /// Adds others of the same ranges, as they were written: of a range no more is touched than holds weight. None if they are cut off, have
    /// other buckets, or if a sum leaves 128 bits.
    pub(super) fn merge_written(&mut self, from: &mut Reader<'_>) -> Option<()> {
        /// Most buckets of a range: see `percentiles`.
        const MAX_BUCKETS: u128 = 1 << 16;
        for range in 0..from.short()? {
            let count = from.short().filter(|count| *count <= MAX_BUCKETS)? as usize;
            let weighty = from.short()?;
            let own = self.own(usize::try_from(range).ok()?);
            if own.is_empty() {
                *own = vec![0; count];
            } else if count > 0 && own.len() != count {
                return None;
            }
            let mut next: usize = 0;
            for _ in 0..weighty {
                let before = from.short().filter(|before| *before < MAX_BUCKETS)?;
                let bucket = next + before as usize;
                let weight = own.get_mut(bucket)?;
                *weight = weight.checked_add(unzigzag(from.short()?))?;
                next = bucket + 1;
            }
        }
        Some(())
    }
}

/// Numbers near 0 of either sign as small ones.
fn zigzag(number: i128) -> u128 {
    ((number << 1) ^ (number >> (i128::BITS - 1))).cast_unsigned()
}

fn unzigzag(number: u128) -> i128 {
    (number >> 1).cast_signed() ^ -((number & 1).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_tile_their_range() {
        for (low, high, bits) in [
            (0, u32::MAX, 12),
            (7, 7, 4),
            (100, 4195, 12),
            (100, 4196, 12),
        ] {
            let buckets = Buckets::new(low, high, bits);
            assert!(buckets.count() <= 1 << bits, "{buckets:?}");
            let mut next = u64::from(low);
            for bucket in 0..buckets.count() {
                let (first, last) = buckets.bounds(bucket);
                assert_eq!(u64::from(first), next);
                assert_eq!(buckets.of(first), Some(bucket));
                assert_eq!(buckets.of(last), Some(bucket));
                next = u64::from(last) + 1;
            }
            assert_eq!(next, u64::from(high) + 1);
        }
    }

    #[test]
    fn weights_are_merged_and_written() {
        let buckets = Buckets::new(0, u32::MAX, 12);
        let of = |values: &[f32]| {
            let mut own = Histograms::default();
            for (at, value) in values.iter().enumerate() {
                own.add(1, buckets, *value, 1 << (60 + at)).unwrap();
            }
            own
        };
        let (a, b) = (of(&[1.0, -2.0]), of(&[1.0]));
        let mut all = a.clone();
        all.merge(b.clone()).unwrap();
        let mut other = b;
        other.merge(a).unwrap();
        assert_eq!(all, other);
        assert_eq!(all.of(1).iter().sum::<i128>(), (1 << 60) * 4);
        assert!(all.of(0).is_empty() && all.of(9).is_empty());
        for number in [0, -1, 1, i128::MIN, i128::MAX, -(1 << 70)] {
            assert_eq!(unzigzag(zigzag(number)), number);
        }
        let mut out = vec![];
        all.write(&mut out);
        let mut back = Histograms::default();
        back.merge_written(&mut Reader::new(&out)).unwrap();
        assert_eq!(back, all);
        // Onto those that are there, of which it has fewer or more ranges.
        let mut twice = all.clone();
        twice.merge(all.clone()).unwrap();
        back.merge_written(&mut Reader::new(&out)).unwrap();
        assert_eq!(back, twice);
        let mut few = vec![];
        Histograms::default().write(&mut few);
        back.merge_written(&mut Reader::new(&few)).unwrap();
        assert_eq!(back, twice);
        let cut_off = Histograms::default().merge_written(&mut Reader::new(&out[..9]));
        assert_eq!(cut_off, None);
        let mut others = Histograms::default();
        others
            .add(1, Buckets::new(0, u32::MAX, 11), 1.0, 1)
            .unwrap();
        assert_eq!(others.merge_written(&mut Reader::new(&out)), None);
    }
}
