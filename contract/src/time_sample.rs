//! A product at one instant: the stored fields that its values come from, and nothing else of the product.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::key::ObjectKey;
use crate::kind::Kind;
use crate::manifest::{Bracket, Manifest};
use crate::time::TimeMs;

/// What a product's values at an instant are made of. All of it is named by content, so versions of a product that
/// agree about an instant have equal samples there, whatever they differ in elsewhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSample {
    /// Cells that hold data in some step: gaps in them are filled.
    pub domain: ObjectKey,
    /// Field at the instant or before it; none where accumulation starts, that is zero in every cell of the domain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<ObjectKey>,
    /// Field after the instant; none where the one before holds alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<After>,
    /// How complete the sums of accumulated carbon are, where uncertainty is drawn and some are not complete.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contributed: Option<Counts>,
}

/// Stored steps and time that contributed to sums, beside the fields of these sums.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// To the field at the instant or before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<ObjectKey>,
    /// To the field after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<ObjectKey>,
}

/// A field that the values move towards.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct After {
    /// The field.
    #[serde(rename = "frame")]
    pub field: ObjectKey,
    /// Its weight (eq. 3 in docs/method.md), above 0 and below 1.
    #[serde(with = "crate::exact")]
    pub weight: f64,
}

impl Manifest {
    /// What the values at an instant are made of; none without steps.
    pub fn time_sample(&self, time: TimeMs) -> Option<TimeSample> {
        let Bracket {
            before,
            after,
            weight,
        } = self.bracket(time)?;
        let field = |step: usize| self.steps[step].field.clone();
        Some(TimeSample {
            domain: self.domain.clone(),
            before: before.map(field),
            // A field without weight shows nowhere: it may come and go without a trace.
            after: (weight > 0.0).then(|| After {
                field: field(after),
                weight,
            }),
            contributed: None,
        })
    }

    /// The same with how complete the sums are, for pictures that show it. Nothing is added to it where all sums are
    /// complete, where values are no sums, and in versions that did not count.
    pub fn time_sample_with_counts(&self, time: TimeMs) -> Option<TimeSample> {
        let sample = self.time_sample(time)?;
        let bracket = self.bracket(time)?;
        let incomplete = |step: usize| {
            let step = &self.steps[step];
            let contributed = step.contributed.as_ref()?;
            (contributed.complete_cells < step.valid_cells).then(|| contributed.counts.clone())
        };
        let after = sample.after.as_ref().map(|_| bracket.after);
        let counts = Counts {
            before: bracket.before.and_then(incomplete),
            after: after.and_then(incomplete),
        };
        Some(TimeSample {
            contributed: (counts != Counts::default()).then_some(counts),
            ..sample
        })
    }
}

impl TimeSample {
    /// Checks a sample that came from outside.
    ///
    /// # Errors
    /// Objects of other kinds than fields and a domain, or a weight that is none.
    pub fn validate(&self) -> Result<(), ContractError> {
        let bad = |key: &ObjectKey, reason: &str| {
            Err(ContractError::invalid("sample", key.as_str(), reason))
        };
        if !self.domain.is_in(Kind::Domain.folder()) {
            return bad(&self.domain, "a domain is wanted");
        }
        let after = self.after.as_ref();
        let fields = self.before.iter().chain(after.map(|after| &after.field));
        for field in fields {
            if !field.is_in(Kind::Field.folder()) {
                return bad(field, "a field is wanted");
            }
        }
        let counts = self.contributed.iter();
        for key in counts.flat_map(|counts| counts.before.iter().chain(&counts.after)) {
            if !key.is_in(Kind::Contributed.folder()) {
                return bad(key, "counts of steps are wanted");
            }
        }
        match after {
            Some(After { field, weight }) if !(*weight > 0.0 && *weight < 1.0) => {
                bad(field, "weights lie between 0 and 1")
            }
            _ => Ok(()),
        }
    }

    /// Name of the product, for people: the folder of its domain.
    pub fn product(&self) -> &str {
        self.domain.as_str().split('/').nth(1).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digest::Digest;
    use crate::grid::Grid;
    use crate::manifest::{Contributed, MANIFEST_SCHEMA, Step};
    use crate::product::ProductId;
    use crate::quantity::Quantity;
    use crate::time::Period;

    fn field(content: &str) -> ObjectKey {
        ObjectKey::field(&"p".parse().unwrap(), &Digest::of(content.as_bytes()))
    }

    /// Months from January 2000 on, with a field each.
    fn manifest(quantity: Quantity, fields: &[&str]) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        let step = |(month, content): (u32, &&str)| Step {
            masked: None,
            period: Period::month(2000, month).unwrap(),
            field: field(content),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: fields.len() as u64,
            title: String::new(),
            quantity,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: (1..).zip(fields).map(step).collect(),
            domain: ObjectKey::domain(&product, &Digest::of(b"d")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    fn at(manifest: &Manifest, time: &str) -> TimeSample {
        manifest.time_sample(time.parse().unwrap()).unwrap()
    }

    #[test]
    fn a_landing_changes_the_moments_that_it_touches_and_no_others() {
        let flux = |fields: &[&str]| manifest(Quantity::CarbonFlux, fields);
        let (old, new) = (flux(&["a", "b"]), flux(&["a", "b", "c"]));
        assert_ne!(old.id(), new.id());
        for time in ["1999-01-01", "2000-01-20", "2000-02-10"] {
            assert_eq!(at(&old, time), at(&new, time), "{time}");
        }
        // The middle of what was the last step: the field after it has no weight yet.
        let middle = Period::month(2000, 2).unwrap().mid();
        assert_eq!(old.time_sample(middle), new.time_sample(middle));
        assert_ne!(at(&old, "2000-02-20"), at(&new, "2000-02-20"));
        let revised = flux(&["a", "B"]);
        assert_eq!(at(&old, "2000-01-10"), at(&revised, "2000-01-10"));
        assert_ne!(at(&old, "2000-01-20"), at(&revised, "2000-01-20"));
    }

    #[test]
    fn a_wider_domain_changes_every_moment() {
        let old = manifest(Quantity::CarbonFlux, &["a"]);
        let mut wider = old.clone();
        wider.domain = ObjectKey::domain(&old.product, &Digest::of(b"wider"));
        assert_ne!(at(&old, "2000-01-10"), at(&wider, "2000-01-10"));
    }

    #[test]
    fn accumulation_starts_from_nothing_and_moves_to_the_end_of_its_step() {
        let carbon = manifest(Quantity::AccumulatedCarbon, &["a", "b"]);
        let start = at(&carbon, "2000-01-01");
        assert_eq!((&start.before, &start.after), (&None, &None));
        let moving = at(&carbon, "2000-01-16T12:00:00Z");
        assert_eq!(moving.before, None);
        let after = moving.after.unwrap();
        assert_eq!(
            (after.field, after.weight.to_bits()),
            (field("a"), 0.5_f64.to_bits())
        );
        let end = at(&carbon, "2000-02-01");
        assert_eq!((end.before, end.after), (Some(field("a")), None));
    }

    #[test]
    fn counts_belong_to_a_moment_where_sums_are_incomplete_and_are_asked_for() {
        let mut carbon = manifest(Quantity::AccumulatedCarbon, &["a", "b", "c"]);
        let counts = |content: &str| {
            ObjectKey::contributed(&"p".parse().unwrap(), &Digest::of(content.as_bytes()))
        };
        for (step, (content, complete_cells)) in
            carbon.steps.iter_mut().zip([("a", 0), ("b", 0), ("c", 1)])
        {
            step.contributed = Some(Contributed {
                counts: counts(content),
                complete_cells,
                since: None,
            });
        }
        let with_counts = |time: &str| {
            let sample = carbon
                .time_sample_with_counts(time.parse().unwrap())
                .unwrap();
            sample.validate().unwrap();
            let plain = TimeSample {
                contributed: None,
                ..sample.clone()
            };
            assert_eq!(plain, at(&carbon, time), "{time}");
            sample.contributed
        };
        let both = |before: Option<&str>, after: Option<&str>| {
            Some(Counts {
                before: before.map(counts),
                after: after.map(counts),
            })
        };
        assert_eq!(
            with_counts("2000-01-01"),
            None,
            "nothing is accumulated yet"
        );
        assert_eq!(with_counts("2000-01-10"), both(None, Some("a")));
        assert_eq!(with_counts("2000-02-10"), both(Some("a"), Some("b")));
        assert_eq!(with_counts("2000-03-10"), both(Some("b"), None));
        assert_eq!(with_counts("2000-06-01"), None, "complete");
        carbon.steps[1].contributed = None; // as an older version wrote it
        let old = carbon.time_sample_with_counts("2000-03-10".parse().unwrap());
        assert_eq!(old.unwrap().contributed, None);
        let strange = TimeSample {
            contributed: Some(Counts {
                before: Some(field("a")),
                after: None,
            }),
            ..at(&carbon, "2000-02-10")
        };
        assert!(strange.validate().is_err());
    }

    #[test]
    fn moments_of_other_objects_are_refused() {
        let good = at(&manifest(Quantity::CarbonFlux, &["a", "b"]), "2000-01-20");
        good.validate().unwrap();
        let after = |field: &str, weight| {
            let field = field.parse().unwrap();
            Some(After { field, weight })
        };
        let is_refused = |change: &dyn Fn(&mut TimeSample)| {
            let mut sample = good.clone();
            change(&mut sample);
            sample.validate().is_err()
        };
        assert!(is_refused(&|m| m.domain = field("a")));
        assert!(is_refused(&|m| m.before = Some("raw/p/x".parse().unwrap())));
        assert!(is_refused(&|m| m.before = Some("frames".parse().unwrap())));
        assert!(is_refused(&|m| m.after = after("tiles/x", 0.5)));
        for weight in [0.0, 1.0, -0.5, f64::NAN] {
            assert!(is_refused(&|m| m.after = after("frames/p/x", weight)));
        }
    }
}
