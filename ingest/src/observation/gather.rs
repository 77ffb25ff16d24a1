//! Observations of one file as they are found, within the limits of the contract and of memory; what the file gives a
//! value for and what is no observation is counted.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use contract::event::RejectReason;
use contract::grid::wrap_lon_deg;
use contract::masked::MaskedCells;
use contract::observation::Observation;

use super::convert::Conversion;
use crate::check::MAX_IMPLAUSIBLE_SHARE;
use crate::error::Rejection;
use crate::figures::figures;

/// Most observations of one file: about 300 MB.
pub(crate) const MAX_OBSERVATIONS: usize = 1 << 20;
/// Memory of one observation with its texts, bytes.
pub(crate) const OBSERVATION_BYTES: u64 = 300;
/// Share of a number within which another says the same: some steps of float32, in which files keep one value in two units, by
/// factors of six digits (knots of 0.514444 m/s).
const SAME_SHARE: f64 = 1e-6;

/// What was found in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Found {
    /// At least one.
    pub(crate) observations: Vec<Observation>,
    /// Values that the file gave and that are no observations.
    pub(crate) masked: MaskedCells,
    /// What was measured and is not read, and why.
    pub(crate) passed_over: Vec<Rejection>,
}

/// The observations of one file.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    found: Vec<Observation>,
    /// How many were found before each variable, and its name.
    variables: Vec<(usize, String)>,
    /// Values outside the valid range that the file states.
    out_of_range: u64,
    /// Values without a place or a time.
    unplaced: u64,
    /// Values that do not count in the mode of their cast, where there is none that does.
    superseded: u64,
    /// Values of properties that several variables say different things of.
    contradicted: u64,
    /// What was measured and is not read.
    passed_over: Vec<Rejection>,
    /// By property.
    tallies: BTreeMap<String, Tally>,
}

/// How many values of a property can be true.
#[derive(Debug, Default)]
struct Tally {
    taken: u64,
    implausible: u64,
    /// What is wrong with the first that cannot.
    example: String,
}

impl Gathered {
    /// What is taken from here on is of this variable.
    pub(super) fn begin(&mut self, variable: &str) {
        self.variables.push((self.found.len(), variable.to_owned()));
    }

    /// Takes an observation; one that breaks a limit of the contract (a place past a pole, say) is counted and left out.
    pub(super) fn take(&mut self, observation: Observation) -> Result<(), Rejection> {
        if self.found.len() >= MAX_OBSERVATIONS {
            let detail = format!(
                "holds more than {MAX_OBSERVATIONS} observations; give it in smaller pieces"
            );
            return Err(Rejection::new(RejectReason::TooLarge, "file", detail));
        }
        let checked = observation.validate();
        let tally = self.tally(&observation.property);
        match checked {
            Ok(()) => {
                tally.taken += 1;
                self.found.push(Observation {
                    lon_deg: wrap_lon_deg(observation.lon_deg),
                    ..observation
                });
            }
            Err(error) => tally.mask(|| error.to_string()),
        }
        Ok(())
    }

    /// Counts a value that cannot be true, in the stored unit.
    pub(super) fn implausible(&mut self, conversion: &Conversion, value: f64) {
        let tally = self.tally(&conversion.property);
        tally.mask(|| {
            let (value, bounds) = (figures(value), conversion.bounds());
            format!("{value} {}{bounds}", conversion.unit)
        });
    }

    /// Counts a value of digits that are no number.
    pub(super) fn unread(&mut self, conversion: &Conversion, text: &str) {
        /// Letters of it that are told.
        const MOST: usize = 32;
        let tally = self.tally(&conversion.property);
        tally.mask(|| {
            let told: String = text.chars().take(MOST).collect();
            format!("{told:?}, which is no number")
        });
    }

    /// Notes what was measured and is not read.
    pub(super) fn pass_over(&mut self, rejection: Rejection) {
        if !self.passed_over.contains(&rejection) {
            self.passed_over.push(rejection);
        }
    }

    /// Counts a value outside the valid range that the file states.
    pub(super) fn out_of_range(&mut self) {
        self.out_of_range += 1;
    }

    /// Counts a value whose place or time the file does not say, or that cannot be.
    pub(super) fn unplaced(&mut self) {
        self.unplaced += 1;
    }

    /// Counts a value that was taken back and that no other one took the place of.
    pub(super) fn superseded(&mut self) {
        self.superseded += 1;
    }

    fn tally(&mut self, property: &str) -> &mut Tally {
        // Most observations are of a property that came before.
        if !self.tallies.contains_key(property) {
            self.tallies.insert(property.to_owned(), Tally::default());
        }
        self.tallies
            .get_mut(property)
            .expect("it was put in just now")
    }

    /// What was found. A file of which much cannot be true is refused, and one without any observation: `why` is the
    /// reason if no value was found at all. Properties of which two variables say different things are passed over.
    pub(super) fn finish(mut self, why: Rejection) -> Result<Found, Rejection> {
        let contradictions = self.tell_apart();
        if self.found.is_empty()
            && let Some(first) = contradictions.first()
        {
            return Err(first.clone());
        }
        let mut implausible = self.unplaced + self.contradicted;
        for (property, tally) in &self.tallies {
            let all = tally.taken + tally.implausible;
            if tally.implausible as f64 > MAX_IMPLAUSIBLE_SHARE * all as f64 {
                let detail = format!(
                    "has {} of {all} values that cannot be true, such as {}; correct unit, fill value, times or places in the file",
                    tally.implausible, tally.example
                );
                return Err(Rejection::new(RejectReason::Values, property, detail));
            }
            implausible += tally.implausible;
        }
        let masked = MaskedCells {
            out_of_range: self.out_of_range,
            poor_quality: self.superseded,
            implausible,
        };
        if self.found.is_empty() && !masked.is_none() {
            let detail = format!(
                "holds no observation ({masked}); correct its places, times, valid range or fill value"
            );
            return Err(Rejection::new(RejectReason::Values, "file", detail));
        }
        if self.found.is_empty() {
            return Err(why);
        }
        let passed_over = self.passed_over.into_iter().chain(contradictions);
        Ok(Found {
            observations: self.found,
            masked,
            passed_over: passed_over.collect(),
        })
    }
}

impl Gathered {
    /// Leaves out, and counts, observations that a later one of the same name says something else than: one of the two is
    /// wrong, and only one can be kept. If they are of two variables, nothing says which of these is meant: all of their property
    /// is left out and counted. Returns one contradiction of each such property.
    fn tell_apart(&mut self) -> Vec<Rejection> {
        let mut order: Vec<usize> = (0..self.found.len()).collect();
        // Of one name the order of the file stays.
        order.sort_by(|a, b| by_name(&self.found[*a], &self.found[*b]));
        let is_same = |a: &usize, b: &usize| by_name(&self.found[*a], &self.found[*b]).is_eq();
        let mut others = vec![];
        for same in order.chunk_by(is_same) {
            let last = same[same.len() - 1];
            let is_other = |at: &&usize| says_other(&self.found[**at], &self.found[last]);
            others.extend(same.iter().filter(is_other).map(|at| (*at, last)));
        }
        others.sort_unstable();
        let mut contradictions: BTreeMap<String, Rejection> = BTreeMap::new();
        for (at, last) in &others {
            let (own, kept) = (&self.found[*at], &self.found[*last]);
            if let (Some(a), Some(b)) = (self.variable_of(*at), self.variable_of(*last))
                && a != b
            {
                if !contradictions.contains_key(&own.property) {
                    let rejection = contradiction((a, own), (b, kept));
                    contradictions.insert(own.property.clone(), rejection);
                }
                continue;
            }
            let example = format!(
                "two of {} on {} at {} m, {} and {} {}",
                own.platform,
                own.time,
                own.depth_m,
                figures(own.value),
                figures(kept.value),
                own.unit
            );
            let property = own.property.clone();
            let tally = self.tally(&property);
            tally.taken -= 1;
            tally.mask(|| example);
        }
        let mut at = 0;
        let mut left_out = others.into_iter().map(|(at, _)| at).peekable();
        self.found.retain(|one| {
            at += 1;
            left_out.next_if_eq(&(at - 1)).is_none() && !contradictions.contains_key(&one.property)
        });
        for property in contradictions.keys() {
            let tally = self.tallies.remove(property).unwrap_or_default();
            self.contradicted += tally.taken + tally.implausible;
        }
        contradictions.into_values().collect()
    }

    /// The variable that an observation is of; none in a file that is no set of variables.
    fn variable_of(&self, at: usize) -> Option<&str> {
        let after = self.variables.partition_point(|(first, _)| *first <= at);
        let (_, name) = &self.variables[after.checked_sub(1)?];
        Some(name)
    }
}

/// What is wrong with two variables that say different things of one sample.
fn contradiction((a, own): (&str, &Observation), (b, other): (&str, &Observation)) -> Rejection {
    let detail = format!(
        "are both {} and differ at the same time, place and depth ({} and {} {} on {}); leave one of them out, or \
         give it a standard name of its own",
        own.property,
        figures(own.value),
        figures(other.value),
        own.unit,
        own.time
    );
    Rejection::new(RejectReason::Corrupt, format!("{a} and {b}"), detail)
}

/// The order of the names of observations of one dataset.
fn by_name(a: &Observation, b: &Observation) -> Ordering {
    let by_depth = || a.depth_m.total_cmp(&b.depth_m);
    let by_property = || a.property.cmp(&b.property);
    let by_platform = || a.platform.cmp(&b.platform);
    (a.time.cmp(&b.time))
        .then_with(by_depth)
        .then_with(by_property)
        .then_with(by_platform)
}

/// Do two observations of one name differ in what they say, by more than rounding?
fn says_other(a: &Observation, b: &Observation) -> bool {
    let is_other = |a: f64, b: f64| (a - b).abs() > SAME_SHARE * a.abs().max(b.abs());
    is_other(a.value, b.value) || is_other(a.lon_deg, b.lon_deg) || is_other(a.lat_deg, b.lat_deg)
}

impl Tally {
    fn mask(&mut self, example: impl FnOnce() -> String) {
        if self.implausible == 0 {
            self.example = example();
        }
        self.implausible += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::observation::{PlatformKind, Quality};

    fn sst(value: f64, lat_deg: f64) -> Observation {
        Observation {
            dataset: "buoys".parse().unwrap(),
            platform: "1".to_owned(),
            kind: PlatformKind::Buoy,
            time: "2012-01-01T00:50:00Z".parse().unwrap(),
            lon_deg: 190.0,
            lat_deg,
            depth_m: 0.6,
            property: "sea_surface_temperature".to_owned(),
            value,
            unit: "K".to_owned(),
            quality: Quality::NotEvaluated,
        }
    }

    fn why() -> Rejection {
        Rejection::new(RejectReason::NoVariable, "file", "nothing")
    }

    /// So many values, and so many that are none: by their number, by their place, and by the file's own range.
    fn gathered(good: usize, [hot, lost, outside]: [usize; 3]) -> Gathered {
        let conversion = Conversion::new("sea_surface_temperature", "K").unwrap();
        let mut gathered = Gathered::default();
        for _ in 0..good {
            gathered.take(sst(290.0, 10.0)).unwrap();
        }
        for _ in 0..hot {
            gathered.implausible(&conversion, 400.0);
        }
        for _ in 0..lost {
            gathered.take(sst(290.0, 91.0)).unwrap();
        }
        for _ in 0..outside {
            gathered.out_of_range();
        }
        gathered
    }

    #[test]
    fn a_few_values_that_cannot_be_true_are_left_out_and_counted() {
        let found = gathered(38, [1, 1, 5]).finish(why()).unwrap();
        assert_eq!(found.observations.len(), 38);
        let masked = found.masked;
        assert_eq!((masked.implausible, masked.out_of_range), (2, 5));
    }

    #[test]
    fn many_of_one_property_refuse_the_file_however_good_the_others_are() {
        let mut gathered = gathered(37, [2, 0, 0]);
        for _ in 0..1000 {
            let property = "air_temperature".to_owned();
            gathered
                .take(Observation {
                    property,
                    ..sst(290.0, 10.0)
                })
                .unwrap();
        }
        let refused = gathered.finish(why()).unwrap_err();
        assert_eq!(refused.reason, RejectReason::Values);
        assert_eq!(refused.object, "sea_surface_temperature");
        for word in ["2 of 39", "400 K", "270", "325"] {
            assert!(refused.detail.contains(word), "{refused}");
        }
    }

    /// So many hours of one buoy.
    fn hours(count: usize) -> Vec<Observation> {
        let hour = |at: usize| Observation {
            time: format!("2012-01-{:02}T{:02}:00:00Z", at / 24 + 1, at % 24)
                .parse()
                .unwrap(),
            lon_deg: -170.0,
            ..sst(290.0, 10.0)
        };
        (0..count).map(hour).collect()
    }

    #[test]
    fn of_two_values_of_one_time_and_depth_the_later_is_kept_and_the_other_counted() {
        let mut gathered = Gathered::default();
        for observation in hours(40) {
            gathered.take(observation).unwrap();
        }
        let again = hours(3).remove(2);
        gathered.take(again.clone()).unwrap();
        let warmer = Observation {
            value: 291.0,
            ..again.clone()
        };
        gathered.take(warmer.clone()).unwrap();
        let deeper = Observation {
            depth_m: 5.0,
            ..warmer.clone()
        };
        gathered.take(deeper.clone()).unwrap();
        let found = gathered.finish(why()).unwrap();
        assert_eq!(found.masked.implausible, 2);
        assert_eq!(found.observations.len(), 41);
        assert_eq!(found.observations[39..], [warmer, deeper]);
        assert!(!found.observations.contains(&again));
    }

    #[test]
    fn many_values_of_one_time_or_one_time_at_many_places_refuse_the_file() {
        for (value, lon_deg) in [(291.0, 190.0), (290.0, 191.0)] {
            let mut gathered = Gathered::default();
            let other = |o: Observation| Observation {
                value,
                lon_deg,
                ..o
            };
            for observation in hours(30)
                .into_iter()
                .chain(hours(30).into_iter().map(other))
            {
                gathered.take(observation).unwrap();
            }
            let refused = gathered.finish(why()).unwrap_err();
            assert_eq!(refused.reason, RejectReason::Values);
            assert!(refused.detail.contains("30 of 60"), "{refused}");
            assert!(
                refused.detail.contains("two of 1 on 2012-01-01"),
                "{refused}"
            );
        }
    }

    #[test]
    fn two_variables_that_say_different_things_of_one_sample_refuse_the_file_with_both() {
        let mut gathered = Gathered::default();
        for (variable, value) in [("raw", 290.0), ("adjusted", 290.5)] {
            gathered.begin(variable);
            for observation in hours(2) {
                gathered
                    .take(Observation {
                        value,
                        ..observation
                    })
                    .unwrap();
            }
        }
        let refused = gathered.finish(why()).unwrap_err();
        assert_eq!(refused.object, "raw and adjusted");
        assert!(
            refused.detail.contains("sea_surface_temperature"),
            "{refused}"
        );
    }

    #[test]
    fn a_property_of_which_two_variables_say_different_things_is_left_out_alone() {
        let mut gathered = Gathered::default();
        for (variable, property, value) in [
            ("air", "air_temperature", 280.0),
            ("one", "sea_surface_temperature", 290.0),
            ("other", "sea_surface_temperature", 290.5),
        ] {
            gathered.begin(variable);
            for observation in hours(2) {
                let property = property.to_owned();
                gathered
                    .take(Observation {
                        property,
                        value,
                        ..observation
                    })
                    .unwrap();
            }
        }
        let found = gathered.finish(why()).unwrap();
        let is_air = |o: &Observation| o.property == "air_temperature";
        assert!(found.observations.iter().all(is_air));
        assert_eq!((found.observations.len(), found.masked.implausible), (2, 4));
        let told: Vec<&str> = found.passed_over.iter().map(|one| &*one.object).collect();
        assert_eq!(told, ["one and other"]);
    }

    #[test]
    fn values_that_differ_by_rounding_say_the_same() {
        let of = |value: f64, lon_deg: f64| Observation {
            lon_deg,
            ..sst(value, 10.0)
        };
        let own = of(285.5, 190.0);
        assert!(!says_other(&own, &of(285.5 + 1e-4, 190.0)));
        assert!(!says_other(&own, &of(f64::from(12.35_f32) + 273.15, 190.0)));
        assert!(says_other(&own, &of(285.51, 190.0)));
        assert!(says_other(&own, &of(285.5, 190.01)));
        assert!(!says_other(&of(0.0, 0.0), &of(-0.0, 0.0)));
    }

    #[test]
    fn a_file_without_observations_says_why() {
        let none = gathered(0, [0, 0, 0]).finish(why()).unwrap_err();
        assert_eq!(none, why());
        let outside = gathered(0, [0, 0, 3]).finish(why()).unwrap_err();
        assert_eq!(outside.reason, RejectReason::Values);
        assert!(outside.detail.contains("3 values masked"), "{outside}");
        assert!(gathered(0, [0, 1, 0]).finish(why()).is_err());
    }
}
