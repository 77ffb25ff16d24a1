//! What is written over a picture so that it explains itself: legend, date, graticule, names, bars, source.
//!
//! A job says which of them are drawn, and holds the words that cannot be known from its fields. Where they go and how
//! large they are follows from the picture alone (`render-worker/src/annotation/`).

mod date;
mod graticule;
mod label;
mod wishes;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::quantity::Quantity;
use crate::time::TimeMs;

pub use date::DateLabel;
pub use graticule::{GRATICULE_LIMITS_DEG, Graticule};
pub use label::{Label, MAX_LABEL_CHARS};
pub use wishes::{Annotation, AnnotationWishes, Wanted};

/// Raised whenever the same annotations are drawn differently, so that old pictures are not taken for new ones; pictures
/// without annotations keep their names. `BLESS=1` of the golden annotated pictures asks for it.
pub const ANNOTATION_VERSION: u32 = 5;

/// What is drawn over a picture of the globe. Nothing of it is in the name of a picture without.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Annotations {
    /// [`ANNOTATION_VERSION`].
    pub version: u32,
    /// What the colours mean: those of a quantity, or of its speed in a flow; and which values isolines are of, where it has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub legend: Option<Quantity>,
    /// When.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<DateLabel>,
    /// Meridians and parallels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub graticule: Option<Graticule>,
    /// Names of oceans and seas.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub names: bool,
    /// How long a kilometre is on the ground in the middle of the picture.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub scale: bool,
    /// How high accumulated carbon lifts particles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<HeightScale>,
    /// Whose data these are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Label>,
    /// Which vector the trails over the picture are of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trails: Option<Label>,
}

/// What a height bar cannot know from the style of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightScale {
    /// From when on the carbon that lifts the particles was added up.
    pub since: TimeMs,
}

impl Annotations {
    /// None of them.
    pub fn none() -> Self {
        Self {
            version: ANNOTATION_VERSION,
            legend: None,
            date: None,
            graticule: None,
            names: false,
            scale: false,
            height: None,
            source: None,
            trails: None,
        }
    }

    /// Is nothing drawn?
    pub fn is_empty(&self) -> bool {
        let nothing = Self {
            version: self.version,
            ..Self::none()
        };
        *self == nothing
    }

    /// Why a map tile has none.
    pub fn refused_on_tiles() -> ContractError {
        let reason = "map tiles carry none, because neighbours would cut and repeat them; ask for a picture of the globe, \
                      or for the legend by itself";
        ContractError::invalid("annotations", "tile", reason)
    }

    pub(crate) fn validate(&self) -> Result<(), ContractError> {
        let bad =
            |text: &str, reason: String| Err(ContractError::invalid("annotations", text, reason));
        if self.version != ANNOTATION_VERSION {
            let reason = format!("this version of them is {ANNOTATION_VERSION}");
            return bad(&self.version.to_string(), reason);
        }
        if self.is_empty() {
            // The same picture would have two names.
            return bad(
                "none",
                "a picture without annotations has no list of them".to_owned(),
            );
        }
        self.graticule.map_or(Ok(()), Graticule::validate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Annotations {
        Annotations {
            legend: Some(Quantity::CarbonFlux),
            graticule: Graticule::every(15.0).ok(),
            names: true,
            scale: true,
            height: Some(HeightScale {
                since: "2000".parse().unwrap(),
            }),
            source: Label::cut("Takahashi et al. (2009)"),
            date: Some(DateLabel {
                shown: Label::cut("15 July 2000").unwrap(),
                note: Label::cut("monthly means"),
            }),
            ..Annotations::none()
        }
    }

    #[test]
    fn annotations_are_read_back_as_they_were_written() {
        let text = serde_json::to_string(&all()).unwrap();
        assert!(text.contains(r#""graticule":{"step_deg":"15"}"#), "{text}");
        assert_eq!(serde_json::from_str::<Annotations>(&text).unwrap(), all());
        let text = serde_json::to_string(&Annotations::none()).unwrap();
        assert_eq!(text, format!(r#"{{"version":{ANNOTATION_VERSION}}}"#));
    }

    #[test]
    fn annotations_beyond_a_limit_are_refused() {
        all().validate().unwrap();
        let refused = |change: fn(&mut Annotations)| {
            let mut changed = all();
            change(&mut changed);
            changed.validate().unwrap_err().to_string()
        };
        assert!(refused(|a| a.version += 1).contains("version"));
        assert!(refused(|a| *a = Annotations::none()).contains("no list"));
        let text = serde_json::to_string(&all()).unwrap();
        let wild = text.replace(r#""step_deg":"15""#, r#""step_deg":"NaN""#);
        assert_ne!(wild, text);
        let wild: Annotations = serde_json::from_str(&wild).unwrap();
        wild.validate().unwrap_err();
        let long = text.replace("Takahashi", &"Takahashi".repeat(100));
        serde_json::from_str::<Annotations>(&long).unwrap_err();
    }
}
