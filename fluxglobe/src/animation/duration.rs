//! How long a film takes: what draws and when its pictures were done in, what is said of it out.

use std::time::{Duration, Instant};

/// Pictures of the process' own that are waited for before it is said how long the rest takes, beside those under way: the first ones
/// wait for fields and for kernels that are compiled.
const FIRST_PICTURES: u32 = 4;
/// A shorter rest is not worth a line.
const SHORT: Duration = Duration::from_mins(1);

/// What is said before anything is drawn, where no graphics card draws: of what draws the name, and whether it is software.
pub(super) fn note<'a>(mut adapters: impl Iterator<Item = (&'a str, bool)>) -> Option<String> {
    let (name, is_software) = adapters.next()?;
    (is_software && adapters.all(|(_, is_software)| is_software)).then(|| {
        format!(
            "drawn by the processor ({name}) and by no graphics card: a long film takes minutes to hours; --size, --fps and --seconds make it less"
        )
    })
}

/// How fast pictures come.
pub(super) struct Pace {
    /// Pictures to be drawn.
    all: u32,
    /// Pictures after which the rest is told.
    told_after: u32,
    done: u32,
    /// When the first one was done: before it fields are read and kernels compiled.
    first: Option<Instant>,
}

impl Pace {
    /// That of a film of which so many pictures are to be drawn, some of them under way at once.
    pub(super) fn new(all: usize, at_once: u16) -> Self {
        Self {
            all: u32::try_from(all).unwrap_or(u32::MAX),
            told_after: FIRST_PICTURES + 2 * u32::from(at_once),
            done: 0,
            first: None,
        }
    }

    /// Counts a picture that was done at an instant: how long the others take, from when that can be told on.
    pub(super) fn picture(&mut self, now: Instant) -> Option<Duration> {
        let first = *self.first.get_or_insert(now);
        self.done += 1;
        if self.done < self.told_after {
            return None;
        }
        let each = now.duration_since(first) / (self.done - 1);
        Some(each.saturating_mul(self.all.saturating_sub(self.done)))
    }

    /// Is it the picture after which the rest is told in a line, if that is long?
    pub(super) fn is_told(&self, left: Duration) -> bool {
        self.done == self.told_after && left >= SHORT
    }
}

/// A rest as people say it: `about 28 min left`.
pub(super) fn left(rest: Duration) -> String {
    const MINUTE_S: f64 = 60.0;
    const HOUR_S: f64 = 3600.0;
    let seconds = rest.as_secs_f64();
    if seconds < 2.0 * MINUTE_S {
        format!("about {seconds:.0} s left")
    } else if seconds < 2.0 * HOUR_S {
        format!("about {:.0} min left", seconds / MINUTE_S)
    } else {
        format!("about {:.1} h left", seconds / HOUR_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_long_the_rest_takes_is_told_once_after_the_first_pictures() {
        let start = Instant::now();
        let mut pace = Pace::new(300, 4);
        let mut told = vec![];
        for number in 0..300u32 {
            // The first one waits for all that is read and compiled, and is not taken for the pace.
            let at = start + Duration::from_secs(90) + Duration::from_secs(6) * number;
            let Some(rest) = pace.picture(at) else {
                assert!(number < 11, "{number}");
                continue;
            };
            if pace.is_told(rest) {
                told.push((number, left(rest)));
            }
        }
        assert_eq!(told, [(11, "about 29 min left".to_owned())]);
        // Nothing is left after the last one, and what takes a few seconds has no line.
        let last = start + Duration::from_secs(2000);
        assert_eq!(pace.picture(last), Some(Duration::ZERO));
        let mut quick = Pace::new(300, 4);
        for number in 0..300u32 {
            let rest = quick.picture(start + Duration::from_millis(50) * number);
            assert!(rest.is_none_or(|rest| !quick.is_told(rest)), "{number}");
        }
    }

    #[test]
    fn that_no_graphics_card_draws_is_said_before_the_film() {
        let of = |adapters: &[(&'static str, bool)]| note(adapters.iter().copied());
        let said = of(&[("llvmpipe", true)]).unwrap();
        assert!(said.contains("processor (llvmpipe)"), "{said}");
        assert_eq!(of(&[("a card", false)]), None);
        assert_eq!(of(&[("llvmpipe", true), ("a card", false)]), None);
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn a_rest_is_told_as_people_say_it() {
        let of = |seconds: u64| left(Duration::from_secs(seconds));
        assert_eq!(of(61), "about 61 s left");
        assert_eq!(of(1680), "about 28 min left");
        assert_eq!(of(9000), "about 2.5 h left");
    }
}
