//! Cells of a map that the file gives a value for and that hold none here: how many, and why.
//!
//! A cell that the file itself calls empty (a fill value) is none of them. Values of files of observations are counted in
//! the same way.

use serde::{Deserialize, Serialize};

/// Cells that were masked, by reason; each is counted once, under the first reason that it had.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaskedCells {
    /// Outside the valid range that the file or its profile states.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub out_of_range: u64,
    /// Not good enough, by the quality that the file states and its profile asks for.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub poor_quality: u64,
    /// Outside what the quantity can be ([`crate::quantity::Quantity::plausible`]).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub implausible: u64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl MaskedCells {
    /// Each reason by its name, as events have it, and its count.
    pub fn by_reason(self) -> [(&'static str, u64); 3] {
        [
            ("out_of_range", self.out_of_range),
            ("poor_quality", self.poor_quality),
            ("implausible", self.implausible),
        ]
    }

    /// All of them.
    pub fn total(self) -> u64 {
        let counts = self.by_reason().into_iter();
        counts.fold(0, |sum, (_, count)| sum.saturating_add(count))
    }

    /// Is there none?
    pub fn is_none(&self) -> bool {
        self.total() == 0
    }
}

impl std::ops::Add for MaskedCells {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            out_of_range: self.out_of_range.saturating_add(other.out_of_range),
            poor_quality: self.poor_quality.saturating_add(other.poor_quality),
            implausible: self.implausible.saturating_add(other.implausible),
        }
    }
}

impl std::iter::Sum for MaskedCells {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, one| sum + one)
    }
}

/// `3 values masked (1 outside the valid range, 2 implausible)`; nothing if there is none.
impl std::fmt::Display for MaskedCells {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [
            (self.out_of_range, "outside the valid range"),
            (self.poor_quality, "of poor quality"),
            (self.implausible, "implausible"),
        ];
        let told: Vec<String> = words
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, word)| format!("{count} {word}"))
            .collect();
        match self.total() {
            0 => Ok(()),
            1 => write!(f, "1 value masked ({})", told.join(", ")),
            total => write!(f, "{total} values masked ({})", told.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_add_up_and_are_named_alike_everywhere() {
        let one = MaskedCells {
            out_of_range: 1,
            implausible: 2,
            ..MaskedCells::default()
        };
        let all: MaskedCells = [one, MaskedCells::default(), one].into_iter().sum();
        assert_eq!((all.out_of_range, all.total()), (2, 6));
        assert_eq!(
            one.to_string(),
            "3 values masked (1 outside the valid range, 2 implausible)"
        );
        let json = serde_json::to_value(one).unwrap();
        for (reason, count) in one.by_reason() {
            assert_eq!(
                json.get(reason)
                    .and_then(serde_json::Value::as_u64)
                    .unwrap_or(0),
                count
            );
        }
        assert!(MaskedCells::default().is_none() && MaskedCells::default().to_string().is_empty());
    }
}
