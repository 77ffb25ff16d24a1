//! Masks of views that were drawn lately: a view that is played through time has the same one in every picture.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use contract::job::View;

use super::Later;
use super::ground::Wanted;

/// Bytes of masks that are kept: eight of full HD.
const MOST_BYTES: usize = 64 << 20;

/// Masks whose memory is kept for the next ones.
const MOST_SPARE: usize = 4;
/// Words of the largest of them: of 4K.
const MOST_SPARE_WORDS: usize = 3840 * 2160;

static KEPT: Mutex<Masks> = Mutex::new(Masks {
    kept: VecDeque::new(),
    spare: Vec::new(),
});

/// The latest first.
#[derive(Default)]
struct Masks {
    kept: VecDeque<Mask>,
    /// Memory of masks that have left: fresh memory costs a third of the time of a mask.
    spare: Vec<Vec<u32>>,
}

#[derive(Clone)]
struct Mask {
    view: View,
    wanted: Wanted,
    words: Arc<Vec<u32>>,
}

/// The mask of a view; begun if it is not there, and waited for by those alone who look at it.
pub(super) fn of(
    view: &View,
    wanted: Wanted,
    make: impl FnOnce(Vec<u32>) -> Vec<u32> + Send + 'static,
) -> Later<Arc<Vec<u32>>> {
    // What is kept is whole between any two changes of it.
    let kept = || KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let keep = move |mask: Mask| {
        let words = Arc::clone(&mask.words);
        kept().put(mask);
        words
    };
    let found = kept().taken(view, wanted);
    if let Some(mask) = found {
        return Later::ready(keep(mask));
    }
    let view = *view;
    let memory = kept().memory();
    Later::begun(move || {
        keep(Mask {
            view,
            wanted,
            words: Arc::new(make(memory)),
        })
    })
}

impl Masks {
    fn taken(&mut self, view: &View, wanted: Wanted) -> Option<Mask> {
        let is_same = |mask: &Mask| mask.view == *view && mask.wanted == wanted;
        // Left there, for those who ask at the same time.
        self.kept.iter().find(|mask| is_same(mask)).cloned()
    }

    /// Memory for one more mask.
    fn memory(&mut self) -> Vec<u32> {
        self.spare.pop().unwrap_or_default()
    }

    fn put(&mut self, mask: Mask) {
        self.kept
            .retain(|other| other.view != mask.view || other.wanted != mask.wanted);
        self.kept.push_front(mask);
        let mut bytes = 0;
        let fit = |mask: &&Mask| {
            bytes += mask.words.len() * size_of::<u32>();
            bytes <= MOST_BYTES
        };
        let fitting = self.kept.iter().take_while(fit).count();
        for mask in self.kept.drain(fitting..) {
            // Some picture may be drawn with it still.
            let memory = Arc::try_unwrap(mask.words);
            let is_worth_it = |words: &Vec<u32>| words.len() <= MOST_SPARE_WORDS;
            self.spare.extend(memory.ok().filter(is_worth_it));
        }
        self.spare.truncate(MOST_SPARE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::camera::CameraAngles;

    const LAND: Wanted = Wanted {
        land: true,
        coasts: false,
        borders: false,
    };

    fn view(lon_deg: f64) -> View {
        View::Globe {
            lon_deg,
            lat_deg: 0.0,
            height_m: 1e6,
            width_px: 2,
            height_px: 1,
            angles: CameraAngles::NADIR,
        }
    }

    fn mask(lon_deg: f64, wanted: Wanted, words: usize) -> Mask {
        let (view, words) = (view(lon_deg), Arc::new(vec![0; words]));
        Mask {
            view,
            wanted,
            words,
        }
    }

    #[test]
    fn a_mask_is_made_once_for_a_view_and_what_is_wanted() {
        // Not the place of any other test.
        let of = |lon: f64, wanted: Wanted, word: u32| {
            of(&view(lon), wanted, move |_memory| vec![word])[0]
        };
        let lines = Wanted {
            coasts: true,
            ..LAND
        };
        assert_eq!(of(12.345, LAND, 1), 1);
        assert_eq!(of(12.345, LAND, 2), 1);
        assert_eq!(of(12.345, lines, 3), 3);
        assert_eq!(of(12.346, LAND, 4), 4);
        assert_eq!(of(12.345, LAND, 5), 1);
    }

    #[test]
    fn masks_leave_that_were_not_asked_for_lately_and_none_is_larger_than_all_room() {
        let mut masks = Masks::default();
        let third = MOST_BYTES / 12;
        for lon in 0..4 {
            masks.put(mask(f64::from(lon), LAND, third));
        }
        let mut is_there = |lon: i32| masks.taken(&view(f64::from(lon)), LAND).is_some();
        assert_eq!([0, 1, 2, 3].map(&mut is_there), [false, true, true, true]);
        let oldest = masks.taken(&view(1.0), LAND).unwrap();
        masks.put(oldest);
        masks.put(mask(4.0, LAND, third));
        let mut is_there = |lon: i32| masks.taken(&view(f64::from(lon)), LAND).is_some();
        assert_eq!([1, 2, 3, 4].map(&mut is_there), [true, false, true, true]);
        masks.put(mask(9.0, LAND, MOST_BYTES));
        assert!(
            masks.kept.is_empty(),
            "it takes the room of all and has none itself"
        );
    }

    #[test]
    fn memory_of_masks_that_left_is_used_again_unless_somebody_draws_with_it() {
        let mut masks = Masks::default();
        let third = MOST_BYTES / 12;
        assert_eq!(masks.memory().capacity(), 0);
        let first = mask(1.0, LAND, third);
        let drawn_with = Arc::clone(&first.words);
        masks.put(first);
        for lon in 2..6 {
            masks.put(mask(f64::from(lon), LAND, third));
        }
        assert_eq!(masks.kept.len(), 3);
        assert_eq!(masks.memory().len(), third, "of the second");
        assert_eq!(masks.memory().capacity(), 0, "the first is drawn with");
        drop(drawn_with);
    }
}
