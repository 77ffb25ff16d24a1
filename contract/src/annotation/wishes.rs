//! Which annotations somebody asks for, in the words that the command line and addresses share.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::Graticule;
use crate::ContractError;

/// One of the things that are drawn over a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Annotation {
    /// What the colours mean.
    Legend,
    /// When.
    Date,
    /// Meridians and parallels.
    Graticule,
    /// Names of oceans and seas.
    Names,
    /// How long a kilometre is.
    Scale,
    /// How much carbon a height is.
    Height,
    /// Whose data these are.
    Source,
}

impl Annotation {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 7] = [
        Self::Legend,
        Self::Date,
        Self::Graticule,
        Self::Names,
        Self::Scale,
        Self::Height,
        Self::Source,
    ];

    /// Name in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Legend => "legend",
            Self::Date => "date",
            Self::Graticule => "graticule",
            Self::Names => "names",
            Self::Scale => "scale",
            Self::Height => "height",
            Self::Source => "source",
        }
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// How much somebody wants an annotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Not at all.
    No,
    /// Where the picture has what it tells of.
    WhereItFits,
    /// By name: it is an error if the picture has nothing of it.
    ByName,
}

/// Which annotations are asked for; none by default. As text `all`, or names with commas between.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnnotationWishes {
    /// All that fit.
    all: bool,
    /// Those asked for by name, one bit each.
    named: u8,
    /// Distance of the graticule's lines.
    graticule: Option<Graticule>,
}

impl AnnotationWishes {
    /// All that fit.
    pub fn all() -> Self {
        Self {
            all: true,
            ..Self::default()
        }
    }

    /// These, and one more by name.
    #[must_use]
    pub fn with(self, one: Annotation) -> Self {
        Self {
            named: self.named | one.bit(),
            ..self
        }
    }

    /// These, and a graticule with lines at a distance.
    #[must_use]
    pub fn with_graticule(self, graticule: Graticule) -> Self {
        Self {
            graticule: Some(graticule),
            ..self.with(Annotation::Graticule)
        }
    }

    /// How much one of them is wanted.
    pub fn wanted(self, one: Annotation) -> Wanted {
        match (self.named & one.bit() != 0, self.all) {
            (true, _) => Wanted::ByName,
            (false, true) => Wanted::WhereItFits,
            (false, false) => Wanted::No,
        }
    }

    /// Is one of them asked for at all?
    pub fn has(self, one: Annotation) -> bool {
        self.wanted(one) != Wanted::No
    }

    /// The distance of lines that is asked for, if one is.
    pub fn graticule(self) -> Option<Graticule> {
        self.graticule
    }

    /// Is nothing asked for?
    pub fn is_empty(&self) -> bool {
        !self.all && self.named == 0
    }
}

impl FromStr for AnnotationWishes {
    type Err = ContractError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut wishes = Self::default();
        for word in text.split(',').map(str::trim) {
            if word == "all" {
                wishes.all = true;
                continue;
            }
            let found = Annotation::ALL.into_iter().find(|one| one.as_str() == word);
            let one = found.ok_or_else(|| {
                let names = Annotation::ALL.map(Annotation::as_str).join(", ");
                let reason = format!("all, or any of {names} with commas between");
                let word: String = word.chars().take(40).collect();
                ContractError::invalid("annotate", &word, reason)
            })?;
            wishes = wishes.with(one);
        }
        Ok(wishes)
    }
}

#[cfg(test)]
mod tests {
    use super::Wanted::{ByName, No, WhereItFits};
    use super::*;

    #[test]
    fn wishes_are_words_with_commas_between() {
        let wishes: AnnotationWishes = "legend, scale".parse().unwrap();
        let wanted = Annotation::ALL.map(|one| wishes.wanted(one));
        assert_eq!(wanted, [ByName, No, No, No, ByName, No, No]);
        let all: AnnotationWishes = "all".parse().unwrap();
        assert_eq!(all, AnnotationWishes::all());
        assert!(
            Annotation::ALL
                .into_iter()
                .all(|one| all.wanted(one) == WhereItFits)
        );
        let both: AnnotationWishes = "height,all".parse().unwrap();
        assert_eq!(both.wanted(Annotation::Height), ByName);
        assert_eq!(both.wanted(Annotation::Date), WhereItFits);
        assert!(AnnotationWishes::default().is_empty() && !all.is_empty() && !wishes.is_empty());
    }

    #[test]
    fn unknown_words_are_refused_with_all_that_are_known() {
        for text in [
            "",
            "legend,",
            "legends",
            "all,north-arrow",
            &"x".repeat(10_000),
        ] {
            let refused = text.parse::<AnnotationWishes>().unwrap_err().to_string();
            for one in Annotation::ALL {
                assert!(refused.contains(one.as_str()), "{refused}");
            }
            assert!(refused.len() < 300, "{refused}");
        }
    }

    #[test]
    fn every_annotation_has_a_wish_of_its_own() {
        for one in Annotation::ALL {
            let alone = AnnotationWishes::default().with(one);
            let others = Annotation::ALL
                .into_iter()
                .filter(|other| alone.has(*other));
            assert_eq!(others.collect::<Vec<_>>(), [one]);
            assert_eq!(one.as_str().parse::<AnnotationWishes>().unwrap(), alone);
        }
        let graticule = Graticule::every(20.0).unwrap();
        let wishes = AnnotationWishes::default().with_graticule(graticule);
        assert!(wishes.has(Annotation::Graticule) && wishes.graticule() == Some(graticule));
    }
}
