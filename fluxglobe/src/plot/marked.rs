//! A linear axis with the marks that it is given, and their texts.

use std::ops::Range;

use legend::ticks;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;

/// Places of an axis and what each is called.
#[derive(Debug, Clone)]
pub(super) struct Marks(Vec<(f64, String)>);

impl Marks {
    pub(super) fn new(marks: Vec<(f64, String)>) -> Self {
        Self(marks)
    }

    /// Round values of a range.
    pub(super) fn round(range: &Range<f64>) -> Self {
        let places = ticks::of(range.start, range.end);
        let texts = ticks::texts(&places);
        Self(places.into_iter().zip(texts).collect())
    }

    /// An axis over a range that is marked at these places.
    pub(super) fn over(&self, range: Range<f64>) -> Marked {
        Marked {
            axis: range.into(),
            places: self.0.iter().map(|(place, _)| *place).collect(),
        }
    }

    /// What a marked place is called.
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "plotters asks so")]
    pub(super) fn text(&self, place: &f64) -> String {
        let mark = self.0.iter().find(|(at, _)| at.total_cmp(place).is_eq());
        mark.map(|(_, text)| text.clone()).unwrap_or_default()
    }

    #[cfg(test)]
    pub(super) fn texts(&self) -> Vec<&str> {
        self.0.iter().map(|(_, text)| text.as_str()).collect()
    }
}

/// An axis and where it is marked.
pub(super) struct Marked {
    axis: RangedCoordf64,
    places: Vec<f64>,
}

impl Ranged for Marked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.axis.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.places.clone()
    }

    fn range(&self) -> Range<f64> {
        self.axis.range()
    }
}
