//! Where pages of a manifest end: steps in, how many there are up to each end out. Pure.
//!
//! The start of a step alone says whether a page ends after it, and not its place: a step that comes, goes or is revised before
//! all others changes the page that it lies in, and no page after that.

use super::Step;

/// One step in so many ends a page: what a landing writes again of steps is as many on average, 20 kB, and 10,000 steps are some 160 pages.
const ONE_IN: u64 = 64;
/// A page ends here at the latest, and 80 kB are what a landing writes again at most. One page in 55 does, and steps that
/// come or go before that end move it, up to the next one that a step says.
pub(super) const MOST_STEPS: usize = 256;

/// How many steps there are up to the end of each page; those after the last end are in none.
pub(super) fn page_ends(steps: &[Step]) -> Vec<usize> {
    let mut ends = vec![];
    let mut first = 0;
    for (step, count) in steps.iter().zip(1..) {
        let is_end = mixed(step.period.start.ms()).is_multiple_of(ONE_IN);
        if is_end || count - first == MOST_STEPS {
            ends.push(count);
            first = count;
        }
    }
    ends
}

/// Bits of a number such that those of numbers in even steps look drawn by lot: the last step of `SplitMix64` (Steele, Lea and Flood 2014,
/// DOI 10.1145/2660193.2660195, with the constants of its published program).
fn mixed(ms: i64) -> u64 {
    let bits = ms.cast_unsigned();
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digest::Digest;
    use crate::key::ObjectKey;
    use crate::time::{Period, TimeMs};

    const HOUR_MS: i64 = 3_600_000;

    fn step(start_ms: i64, end_ms: i64) -> Step {
        let at = |ms: i64| TimeMs::new(ms).unwrap();
        Step {
            period: Period::new(at(start_ms), at(end_ms)).unwrap(),
            field: ObjectKey::field(&"p".parse().unwrap(), &Digest::of(b"")),
            raw_sha256: Digest::of(b""),
            origin: "f.nc".to_owned(),
            valid_cells: 1,
            masked: None,
            contributed: None,
        }
    }

    fn each(hours: i64, count: i64) -> Vec<Step> {
        let at = |step: i64| step * hours * HOUR_MS;
        (0..count)
            .map(|own| step(at(own - 4000), at(own - 3999)))
            .collect()
    }

    #[test]
    fn numbers_are_mixed_as_the_published_program_does() {
        // The first number that it draws from the seed 0.
        assert_eq!(
            mixed(0x9e37_79b9_7f4a_7c15_u64.cast_signed()),
            0xe220_a839_7b1d_cdaf
        );
    }

    #[test]
    fn pages_are_of_middling_length_whatever_the_step_of_time() {
        for hours in [1, 3, 6, 24, 8 * 24, 30 * 24] {
            let steps = each(hours, 10_000);
            let ends = page_ends(&steps);
            assert!(
                (125..200).contains(&ends.len()),
                "{hours} h: {}",
                ends.len()
            );
            let starts = std::iter::once(0).chain(ends.iter().copied());
            let longest = starts.zip(&ends).map(|(start, end)| end - start).max();
            assert!(longest.is_some_and(|longest| longest <= MOST_STEPS));
        }
    }

    #[test]
    fn a_page_that_no_step_ends_ends_at_its_greatest_length() {
        // Steps that end no page, one after the other.
        let is_plain = |own: &Step| !mixed(own.period.start.ms()).is_multiple_of(ONE_IN);
        let plain: Vec<Step> = each(24, 1000).into_iter().filter(is_plain).collect();
        let ends = page_ends(&plain[..2 * MOST_STEPS + 7]);
        assert_eq!(ends, [MOST_STEPS, 2 * MOST_STEPS]);
        assert!(page_ends(&plain[..MOST_STEPS - 1]).is_empty());
    }

    #[test]
    fn another_step_before_all_moves_every_end_by_one() {
        let steps = each(24, 2000);
        let is_by_step =
            |end: usize| mixed(steps[end - 1].period.start.ms()).is_multiple_of(ONE_IN);
        // The first step ends no page, and so all ends from the first on that a step says are where they were.
        assert!(!is_by_step(1));
        let first = (1..=steps.len()).find(|end| is_by_step(*end)).unwrap();
        let from_first = |ends: Vec<usize>| {
            let ends = ends.into_iter().filter(|end| *end >= first);
            ends.collect::<Vec<_>>()
        };
        let ends = from_first(page_ends(&steps));
        let moved = page_ends(&steps[1..]).into_iter().map(|end| end + 1);
        assert!(ends.len() > 20 && ends == from_first(moved.collect()));
        // One is at the greatest length of a page: that moves neither.
        assert!(!ends.iter().all(|end| is_by_step(*end)));
    }
}
