//! Who draws what: every worker has a weight for every place, the heaviest draws. When a worker comes or goes, only its
//! own share moves.

use std::cmp::Reverse;

use contract::digest::Digest;

/// Indices of `workers`, the one to ask first in front.
pub fn ranked(place: &str, workers: &[&str]) -> Vec<usize> {
    let mut ranked: Vec<usize> = (0..workers.len()).collect();
    // A name decides between equal weights, so that all callers agree.
    ranked.sort_by_cached_key(|index| {
        let worker = workers[*index];
        (Reverse(weight(place, worker)), worker.to_owned())
    });
    ranked
}

/// The first 16 hexadecimal digits of a digest: even, and the same in every process.
fn weight(place: &str, worker: &str) -> String {
    let mut text = Digest::of(format!("{worker}\n{place}").as_bytes()).to_string();
    text.truncate(16);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: usize = 4000;

    fn first_of(workers: &[&str]) -> Vec<String> {
        let place = |i: usize| format!("product-{} frames/{i}", i % 7);
        (0..PLACES)
            .map(|i| workers[ranked(&place(i), workers)[0]].to_owned())
            .collect()
    }

    #[test]
    fn only_the_share_of_a_worker_that_leaves_moves() {
        let eight = ["a:1", "b:1", "c:1", "d:1", "e:1", "f:1", "g:1", "h:1"];
        let seven: Vec<&str> = eight.into_iter().filter(|name| *name != "c:1").collect();
        let (before, after) = (first_of(&eight), first_of(&seven));
        let moved = before.iter().zip(&after).filter(|(b, a)| b != a).count();
        let owned = before.iter().filter(|name| *name == "c:1").count();
        assert_eq!(moved, owned, "nothing moves but what the lost worker had");
        // An eighth each; 4000 places are even to within a fifth of that.
        for name in eight {
            let share = before.iter().filter(|first| *first == name).count();
            assert!((400..=600).contains(&share), "{name} has {share} of 4000");
        }
        // What it had is spread over all the others.
        for name in seven {
            let more = after.iter().filter(|first| *first == name).count()
                - before.iter().filter(|first| *first == name).count();
            assert!(more > owned / 14, "{name} took over {more} of {owned}");
        }
    }

    #[test]
    fn the_order_of_the_list_does_not_matter() {
        let there = ["a:1", "b:1", "c:1"];
        let back = ["c:1", "b:1", "a:1"];
        assert_eq!(first_of(&there), first_of(&back));
    }
}
