//! Bounds of an axis as they lie in a file → two numbers for each of its labels.

/// How the bounds of an axis lie, whatever dimensions of one they have besides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// Two numbers for each label, as CF has them: `[label, 2]`.
    Pairs,
    /// One number for each label, twice: `[2, label]`.
    Rows,
    /// The edges between cells side by side, and the outer ones: one more than labels.
    Edges,
}

impl Layout {
    /// How bounds of this shape lie for so many labels; none if it has no meaning. Of two labels `[2, 2]` is what CF says.
    pub(super) fn of(lens: &[u64], count: u64) -> Option<Self> {
        let wide = |lens: &[u64]| -> Vec<u64> {
            let wide = lens.iter().copied().filter(|len| *len != 1);
            wide.collect()
        };
        let own = wide(lens);
        match count {
            0 => None,
            _ if own == wide(&[count, 2]) => Some(Self::Pairs),
            _ if own == [2, count] => Some(Self::Rows),
            _ if own == [count + 1] => Some(Self::Edges),
            _ => None,
        }
    }

    /// How many numbers they are.
    pub(super) fn number_count(self, count: u64) -> u64 {
        match self {
            Self::Pairs | Self::Rows => count * 2,
            Self::Edges => count + 1,
        }
    }

    /// Two numbers for each label, of all numbers in their order.
    pub(super) fn pairs(self, numbers: &[f64]) -> Vec<[f64; 2]> {
        match self {
            Self::Pairs => numbers.as_chunks::<2>().0.to_vec(),
            Self::Rows => {
                let (one, other) = numbers.split_at(numbers.len() / 2);
                let both = one.iter().zip(other);
                both.map(|(one, other)| [*one, *other]).collect()
            }
            Self::Edges => {
                let cells = numbers.windows(2);
                cells.map(|edges| [edges[0], edges[1]]).collect()
            }
        }
    }

    /// What they are taken for, where they lie otherwise than CF says.
    pub(super) fn told(self) -> Option<&'static str> {
        match self {
            Self::Pairs => None,
            Self::Rows => Some("two rows of one number a label; they are read so"),
            Self::Edges => Some(
                "one number more than there are labels; they are taken for the edges between cells side by side",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_two_numbers_a_label_however_they_lie() {
        let wanted = vec![[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]];
        let lying: [(&[u64], &[f64]); 7] = [
            (&[3, 2], &[0.0, 1.0, 1.0, 2.0, 2.0, 3.0]),
            (&[1, 3, 2], &[0.0, 1.0, 1.0, 2.0, 2.0, 3.0]),
            (&[3, 1, 2], &[0.0, 1.0, 1.0, 2.0, 2.0, 3.0]),
            (&[2, 3], &[0.0, 1.0, 2.0, 1.0, 2.0, 3.0]),
            (&[2, 3, 1], &[0.0, 1.0, 2.0, 1.0, 2.0, 3.0]),
            (&[4], &[0.0, 1.0, 2.0, 3.0]),
            (&[1, 4], &[0.0, 1.0, 2.0, 3.0]),
        ];
        for (lens, numbers) in lying {
            let layout = Layout::of(lens, 3).unwrap();
            assert_eq!(layout.number_count(3), numbers.len() as u64, "{lens:?}");
            assert_eq!(layout.pairs(numbers), wanted, "{lens:?}");
            assert_eq!(layout.told().is_none(), layout == Layout::Pairs);
        }
    }

    #[test]
    fn a_shape_of_two_meanings_is_what_the_conventions_say_and_one_of_none_is_none() {
        assert_eq!(Layout::of(&[2, 2], 2), Some(Layout::Pairs));
        assert_eq!(Layout::of(&[3], 2), Some(Layout::Edges));
        // Of one label all are the same two numbers.
        for lens in [&[2][..], &[1, 2], &[2, 1], &[1, 1, 2]] {
            assert_eq!(Layout::of(lens, 1), Some(Layout::Pairs), "{lens:?}");
        }
        let none: [(&[u64], u64); 7] = [
            (&[], 1),
            (&[3], 3),
            (&[3, 3], 3),
            (&[2, 3, 2], 3),
            (&[5], 3),
            (&[0, 2], 0),
            (&[1], 0),
        ];
        for (lens, count) in none {
            assert_eq!(Layout::of(lens, count), None, "{lens:?}");
        }
    }
}
