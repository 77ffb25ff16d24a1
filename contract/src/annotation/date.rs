//! When a picture is: the instant in plain words, and what its values are means over.

use serde::{Deserialize, Serialize};

use super::Label;
use crate::manifest::Manifest;
use crate::quantity::Quantity;
use crate::time::TimeMs;

/// The date of a picture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DateLabel {
    /// The instant, or the one step that a product has.
    pub shown: Label,
    /// What the values are means over, or from when on they were added up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<Label>,
}

impl DateLabel {
    /// That of an instant of a product. Where steps are a day or longer it has no time of day: values between them are
    /// interpolated, and a minute would promise more than there is. None of a product without steps.
    pub fn of(product: &Manifest, time: TimeMs) -> Option<Self> {
        let bracket = product.bracket(time)?;
        let period = product.steps.get(bracket.after)?.period;
        let accumulated = product.quantity == Quantity::AccumulatedCarbon;
        let adjective = period.adjective();
        let (shown, note) = match product.steps.as_slice() {
            // There is one picture, whatever the instant.
            [_only] if !accumulated => {
                let note = adjective.map(|length| format!("{length} mean"));
                (period.in_words(), note)
            }
            steps => {
                let day = if period.has_days() {
                    time.day_in_words()
                } else {
                    time.in_words()
                };
                let note = if accumulated {
                    let first = steps.first()?.period.start.day_in_words();
                    Some(format!("added up since {first}"))
                } else {
                    adjective.map(|length| format!("{length} means"))
                };
                (day, note)
            }
        };
        Some(Self {
            shown: Label::cut(&shown)?,
            note: note.and_then(|note| Label::cut(&note)),
        })
    }
}
