//! Values of given ranks out of a great many that nobody keeps: exact, in bounded memory.

use std::collections::BTreeMap;

/// Values that are held rather than counted: 8 MiB of them.
pub const HELD_AT_MOST: usize = 1 << 20;
/// Bits of a digit.
const DIGIT_BITS: u32 = 16;

/// The values of the given ranks (from 0, the lowest) among `count` values, exact.
///
/// `values` gives the same values in the same order each time it is called, none of them NaN. Few are held and selected from. Of many the
/// digits are counted from the highest on, 16 bits a pass, for each rank among those that share its digits so far: four
/// passes and half a MiB a rank, whatever their number.
pub fn at_ranks<I: Iterator<Item = f64>>(
    values: impl Fn() -> I,
    count: usize,
    ranks: &[usize],
    held_at_most: usize,
) -> Vec<f64> {
    assert!(
        ranks.iter().all(|rank| *rank < count),
        "ranks are below the number of values"
    );
    if count <= held_at_most {
        let mut keys = Vec::with_capacity(count);
        keys.extend(values().map(key_of));
        return of_keys(&mut keys, ranks);
    }
    // Of each rank: the digits found so far, and its rank among the values that have them.
    let mut found: Vec<(u64, usize)> = ranks.iter().map(|rank| (0, *rank)).collect();
    for pass in 1..=u64::BITS / DIGIT_BITS {
        let shift = u64::BITS - pass * DIGIT_BITS;
        let mut counts: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (digits, _) in &found {
            counts
                .entry(*digits)
                .or_insert_with(|| vec![0; 1 << DIGIT_BITS]);
        }
        for value in values() {
            let key = ordered(value) >> shift;
            if let Some(counts) = counts.get_mut(&(key >> DIGIT_BITS)) {
                counts[(key & ((1 << DIGIT_BITS) - 1)) as usize] += 1;
            }
        }
        for (digits, rank) in &mut found {
            let counts = &counts[digits];
            let mut digit = 0;
            while *rank >= counts[digit] {
                *rank -= counts[digit];
                digit += 1;
            }
            *digits = (*digits << DIGIT_BITS) | digit as u64;
        }
    }
    found
        .iter()
        .map(|(digits, _)| of_ordered(*digits))
        .collect()
}

/// A value as a whole number, whose order is that of [`f64::total_cmp`]; of its own value again.
pub fn key_of(value: f64) -> i64 {
    turned(value.to_bits().cast_signed())
}

/// The bits but the sign turned where the sign is set.
fn turned(bits: i64) -> i64 {
    bits ^ ((bits >> 63).cast_unsigned() >> 1).cast_signed()
}

/// Keys of which so many and more are sampled first.
const SAMPLED_FROM: usize = 4096;
/// Keys that are sampled.
const SAMPLE: usize = 256;
/// Ranks in the sample on both sides of where a rank is expected: three times what chance moves it by.
const REACH: usize = 24;

/// The values of the given ranks (from 0, the lowest) among those of some keys, which are used up: nothing is sorted but what lies
/// between.
///
/// Of many, ranks side by side are sought in a few of the keys first, and then among those alone that lie about what was found there
/// (Floyd and Rivest 1975, doi:10.1145/360680.360691).
pub fn of_keys(keys: &mut [i64], ranks: &[usize]) -> Vec<f64> {
    let mut wanted = ranks.to_vec();
    wanted.sort_unstable();
    let (below, count) = about_sample(keys, &wanted).unwrap_or((0, keys.len()));
    let keys = &mut keys[..count];
    // What is before the next rank asked for is in its place.
    let mut done = 0;
    for rank in wanted.iter().map(|rank| rank - below) {
        if rank >= done {
            keys[done..].select_nth_unstable(rank - done);
            done = rank + 1;
        }
    }
    let value = |rank: &usize| f64::from_bits(turned(keys[rank - below]).cast_unsigned());
    ranks.iter().map(value).collect()
}

/// Brings keys that some ranks, rising, are among to the front: how many there are below them, and how many these are. None, and
/// nothing is changed, of few keys, of ranks that lie far from one another, and where the sample says something else than the keys.
fn about_sample(keys: &mut [i64], wanted: &[usize]) -> Option<(usize, usize)> {
    let (first, last) = (*wanted.first()?, *wanted.last()?);
    if keys.len() < SAMPLED_FROM || last - first > keys.len() / SAMPLE {
        return None;
    }
    let mut sample: Vec<i64> = (0..SAMPLE).map(|i| keys[i * keys.len() / SAMPLE]).collect();
    sample.sort_unstable();
    let expected = |rank: usize| rank * SAMPLE / keys.len();
    let low = expected(first).checked_sub(REACH).map(|at| sample[at]);
    let high = sample.get(expected(last) + REACH).copied();
    let (low, high) = (low.unwrap_or(i64::MIN), high.unwrap_or(i64::MAX));
    let is_near = |key: i64| usize::from(low <= key) & usize::from(key <= high);
    let below: usize = keys.iter().map(|key| usize::from(*key < low)).sum();
    let count: usize = keys.iter().map(|key| is_near(*key)).sum();
    if first < below || last - below >= count {
        return None;
    }
    // Without a branch that nobody can foretell.
    let mut at = 0;
    for number in 0..keys.len() {
        let key = keys[number];
        keys[at] = key;
        at += is_near(key);
        if at == count {
            break;
        }
    }
    Some((below, count))
}

/// Bits whose order as whole numbers is that of the values.
fn ordered(value: f64) -> u64 {
    // Both zeros are one.
    let bits = (value + 0.0).to_bits();
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | (1 << 63)
    }
}

fn of_ordered(bits: u64) -> f64 {
    f64::from_bits(if bits >> 63 == 1 {
        bits & !(1 << 63)
    } else {
        !bits
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counted_digits_find_what_sorting_finds(
            values in prop::collection::vec(prop_oneof![-1e3..1e3f64, Just(0.0), Just(-0.0), Just(7.5), any::<f64>().prop_filter("a number", |v| !v.is_nan())], 1..60),
            seed in any::<u64>(),
        ) {
            let count = values.len();
            let ranks = [0, count - 1, seed as usize % count, count / 2];
            let sorted = at_ranks(|| values.iter().copied(), count, &ranks, usize::MAX);
            let counted = at_ranks(|| values.iter().copied(), count, &ranks, 0);
            prop_assert_eq!(&sorted, &counted);
            let mut all = values.clone();
            all.sort_unstable_by(f64::total_cmp);
            let bits: Vec<u64> = ranks.iter().map(|rank| all[*rank].to_bits()).collect();
            let found: Vec<u64> = sorted.iter().map(|value| value.to_bits()).collect();
            prop_assert_eq!(found, bits);
        }

        /// Rising ones, which a sample stands for, and others, which it does not.
        #[test]
        fn many_keys_are_selected_as_sorting_would(
            count in SAMPLED_FROM - 2..3 * SAMPLED_FROM,
            kinds in 1..5u64,
            seed in any::<u64>(),
        ) {
            let noise = |i: usize| (i as u64 ^ seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
            let key = |i: usize| match noise(i) % kinds {
                0 => i as i64,
                1 => (noise(i) % 7) as i64,
                2 => -(noise(i) as i64),
                _ => i64::MIN + i as i64,
            };
            let keys: Vec<i64> = (0..count).map(key).collect();
            let mut sorted = keys.clone();
            sorted.sort_unstable();
            let at = seed as usize % count;
            for ranks in [vec![at], vec![count / 2, (count - 1) / 2], vec![0, 0], vec![count - 1], vec![at, 0, count - 1]] {
                let found = of_keys(&mut keys.clone(), &ranks);
                let own: Vec<u64> = found.iter().map(|value| value.to_bits()).collect();
                let right = ranks.iter().map(|rank| turned(sorted[*rank]).cast_unsigned());
                prop_assert_eq!(own, right.collect::<Vec<u64>>());
            }
        }

        /// All that the sample took are the lowest keys: the ranks lie elsewhere.
        #[test]
        fn a_sample_that_misleads_is_not_followed(count in SAMPLED_FROM..3 * SAMPLED_FROM) {
            let mut keys: Vec<i64> = (0..count as i64).collect();
            for i in 0..SAMPLE {
                keys[i * count / SAMPLE] = -(i as i64) - 1;
            }
            let mut sorted = keys.clone();
            sorted.sort_unstable();
            let found = of_keys(&mut keys, &[count / 2]);
            prop_assert_eq!(found[0].to_bits(), turned(sorted[count / 2]).cast_unsigned());
        }
    }
}
