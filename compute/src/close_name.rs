//! A name that is none of those there are in, the one that was meant out.

/// Letters that a name is wrong in at most.
const MOST_LETTERS: usize = 3;
/// Letters of a name that are enough to know which one begins with them.
const LEAST_LETTERS: usize = 3;

/// The name that was meant, if one is close: that with the fewest letters to add, to leave out or to change, one in three of those given
/// and at most three, or the first that goes on from those given.
pub fn close_name<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters = given.chars().count();
    let most = (letters / 3).min(MOST_LETTERS);
    let close = known.into_iter().filter_map(|name| {
        let apart = letters_apart(given, name);
        let goes_on = letters >= LEAST_LETTERS && name.starts_with(given);
        (apart <= most || goes_on).then_some((apart, name))
    });
    close.min().map(|(_apart, name)| name)
}

/// Letters to add, to leave out or to change until one name is the other.
fn letters_apart(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    // Of what was read of the one to each beginning of the other.
    let mut apart: Vec<usize> = (0..=other.len()).collect();
    for (read, letter) in one.chars().enumerate() {
        let mut before = std::mem::replace(&mut apart[0], read + 1);
        for (at, own) in other.iter().enumerate() {
            let changed = before + usize::from(letter != *own);
            before = apart[at + 1];
            apart[at + 1] = changed.min(before + 1).min(apart[at] + 1);
        }
    }
    apart[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_are_missing_more_or_others_are_counted() {
        for (one, other, apart) in [
            ("", "", 0),
            ("", "abc", 3),
            ("sst", "sst", 0),
            ("kitten", "sitting", 3),
            ("flux", "flx", 1),
            ("flx", "flux", 1),
            ("wind", "widn", 2),
        ] {
            assert_eq!(letters_apart(one, other), apart, "{one} {other}");
        }
    }

    #[test]
    fn a_name_is_close_by_a_few_letters_or_by_its_beginning() {
        let known = [
            "sst",
            "takahashi09-flux",
            "takahashi09-flux-accumulated",
            "wind",
        ];
        let of = |given: &str| close_name(given, known);
        assert_eq!(of("takahashi09-flx"), Some("takahashi09-flux"));
        assert_eq!(of("takahasi9-flux"), Some("takahashi09-flux"));
        assert_eq!(of("takahashi"), Some("takahashi09-flux"));
        assert_eq!(of("ssd"), Some("sst"));
        for other in ["nothing", "s", "wi", "chlorophyll", ""] {
            assert_eq!(of(other), None, "{other}");
        }
        assert_eq!(close_name("c", ["a", "b"]), None);
    }
}
