//! Steps of the states that this process has committed last: who lands the next version builds on one of them, and reads as much else
//! as there are steps.
//!
//! A state never changes, so that what was committed is what would be read. Left out on purpose: whoever opens a cube to answer from
//! it, or to verify it, reads its steps and has their checksums compared.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::Step;

/// Most states that are held.
const MOST_STATES: usize = 256;
/// Most steps that are held, of all states together: 48 bytes each.
const MOST_STEPS: usize = 500_000;

static HELD: Mutex<Held> = Mutex::new(Held {
    states: VecDeque::new(),
});

/// Of one state.
struct HeldState {
    /// Where its cube is.
    place: String,
    snapshot: String,
    steps: Arc<[Step]>,
}

/// The last one last.
struct Held {
    states: VecDeque<HeldState>,
}

impl Held {
    fn steps(&self, (place, snapshot): (&str, &str)) -> Option<Arc<[Step]>> {
        let mut states = self.states.iter();
        let own = states.find(|own| own.snapshot == snapshot && own.place == place);
        own.map(|own| Arc::clone(&own.steps))
    }

    /// Holds a state in the place of the one that it was built on, and of the oldest ones where they are too many.
    fn replace(&mut self, place: &str, (before, after): (&str, &str), steps: &[Step]) {
        self.states
            .retain(|own| own.snapshot != before || own.place != place);
        if steps.len() > MOST_STEPS {
            return;
        }
        let held = self.states.iter().map(|own| own.steps.len());
        let mut count = held.sum::<usize>() + steps.len();
        while count > MOST_STEPS || self.states.len() >= MOST_STATES {
            let Some(oldest) = self.states.pop_front() else {
                break;
            };
            count -= oldest.steps.len();
        }
        self.states.push_back(HeldState {
            place: place.to_owned(),
            snapshot: after.to_owned(),
            steps: steps.into(),
        });
    }
}

/// Steps of a snapshot of the cube in a place, if this process has committed it a short while ago.
pub(crate) fn of(place: &str, snapshot: &str) -> Option<Vec<Step>> {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    let own = held.steps((place, snapshot));
    drop(held);
    own.map(|steps| steps.to_vec())
}

/// Holds the steps of a snapshot that was committed over another one.
pub(crate) fn committed(place: &str, snapshots: (&str, &str), steps: &[Step]) {
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    held.replace(place, snapshots, steps);
}

#[cfg(test)]
mod tests {
    use contract::digest::Digest;
    use contract::time::Period;

    use super::*;

    fn steps(count: usize) -> Vec<Step> {
        let step = Step {
            period: Period::month(2000, 1).unwrap(),
            values_sha256: Digest::of(b"a"),
        };
        vec![step; count]
    }

    #[test]
    fn a_state_takes_the_place_of_the_one_before_and_the_oldest_ones_go() {
        let mut held = Held {
            states: VecDeque::new(),
        };
        held.replace("p", ("0", "1"), &steps(3));
        held.replace("q", ("0", "1"), &steps(4));
        held.replace("p", ("1", "2"), &steps(5));
        let count = |held: &Held, place: &str, snapshot: &str| {
            held.steps((place, snapshot)).map(|steps| steps.len())
        };
        assert_eq!(count(&held, "p", "1"), None);
        assert_eq!(count(&held, "p", "2"), Some(5));
        assert_eq!(count(&held, "q", "1"), Some(4), "it is of another cube");
        // One that is too large goes, and nothing else for it.
        held.replace("p", ("2", "3"), &steps(MOST_STEPS + 1));
        assert_eq!(
            (count(&held, "p", "2"), count(&held, "p", "3")),
            (None, None)
        );
        assert_eq!(count(&held, "q", "1"), Some(4));
        held.replace("p", ("3", "4"), &steps(MOST_STEPS - 3));
        assert_eq!(count(&held, "q", "1"), None, "they are too many together");
        assert_eq!(count(&held, "p", "4"), Some(MOST_STEPS - 3));
        for cube in 0..=MOST_STATES {
            held.replace(&cube.to_string(), ("0", "1"), &[]);
        }
        assert_eq!(held.states.len(), MOST_STATES);
        assert_eq!(count(&held, "0", "1"), None);
        assert_eq!(count(&held, &MOST_STATES.to_string(), "1"), Some(0));
    }
}
