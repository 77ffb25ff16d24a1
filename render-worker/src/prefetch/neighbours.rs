//! A product, an instant and a direction of time in; the fields that are wanted next out.

use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::time_sample::{Counts, TimeSample};

/// Which way time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Heading {
    /// Nobody has said yet.
    Unknown,
    Forward,
    Backward,
}

impl Heading {
    /// The direction from one place in a product to another; none keeps what it was.
    pub(super) fn after(self, from: f64, to: f64) -> Self {
        if to > from {
            Self::Forward
        } else if to < from {
            Self::Backward
        } else {
            self
        }
    }
}

/// Steps of a sample's fields, first and last; -1 stands before the first step, where accumulation starts.
fn steps_of(manifest: &Manifest, sample: &TimeSample) -> Option<[i64; 2]> {
    let index = |field: &ObjectKey| {
        let found = manifest.steps.iter().position(|step| step.field == *field);
        found.map(|index| index as i64)
    };
    let before = match &sample.before {
        Some(field) => index(field)?,
        None => -1,
    };
    let after = match &sample.after {
        Some(after) => index(&after.field)?,
        None => before,
    };
    Some([before, after])
}

/// Where in a product a sample lies: 2.25 is a quarter of the way from the third step to the fourth. None if the
/// product does not have its fields.
pub(super) fn place_of(manifest: &Manifest, sample: &TimeSample) -> Option<f64> {
    let [before, _] = steps_of(manifest, sample)?;
    let weight = sample.after.as_ref().map_or(0.0, |after| after.weight);
    Some(before as f64 + weight)
}

/// The samples of single fields that are wanted next, nearest first: `most` of them in the direction of time, in both
/// if that is not known. Who plays a product to its end goes on at its start.
pub(super) fn next(
    manifest: &Manifest,
    sample: &TimeSample,
    heading: Heading,
    most: usize,
) -> Vec<TimeSample> {
    let Some([first, last]) = steps_of(manifest, sample) else {
        return vec![];
    };
    let each = |i: i64| {
        let (later, earlier) = (last + i, first - i);
        match heading {
            Heading::Unknown => vec![later, earlier],
            Heading::Forward => vec![later],
            Heading::Backward => vec![earlier],
        }
    };
    let count = manifest.steps.len() as i64;
    let mut wanted = vec![];
    for step in (1..=most as i64).flat_map(each) {
        let step = step.rem_euclid(count.max(1));
        if (first..=last).contains(&step) || wanted.contains(&step) {
            continue;
        }
        wanted.push(step);
    }
    // Of a picture that shows how complete sums are, the next ones will, too.
    let counts = |step: usize| {
        let contributed = manifest.steps[step].contributed.as_ref()?;
        sample.contributed.as_ref().map(|_| Counts {
            before: Some(contributed.counts.clone()),
            after: None,
        })
    };
    let single = |step: i64| TimeSample {
        domain: sample.domain.clone(),
        before: Some(manifest.steps[step as usize].field.clone()),
        after: None,
        contributed: counts(step as usize),
    };
    wanted.into_iter().map(single).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::manifest::{MANIFEST_SCHEMA, Step};
    use contract::product::ProductId;
    use contract::quantity::Quantity;
    use contract::time::Period;

    fn field(month: u32) -> ObjectKey {
        ObjectKey::field(&"p".parse().unwrap(), &Digest::of(&[month as u8]))
    }

    /// The months of 2000 up to one.
    fn manifest(quantity: Quantity, months: u32) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        let step = |month| Step {
            masked: None,
            period: Period::month(2000, month).unwrap(),
            field: field(month),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
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
            steps: (1..=months).map(step).collect(),
            domain: ObjectKey::domain(&product, &Digest::of(b"d")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    fn wanted(manifest: &Manifest, time: &str, heading: Heading, most: usize) -> Vec<u32> {
        let sample = manifest.time_sample(time.parse().unwrap()).unwrap();
        let next = next(manifest, &sample, heading, most).into_iter();
        let month =
            |sample: TimeSample| (1..=12).find(|month| sample.before == Some(field(*month)));
        next.map(|sample| month(sample).unwrap()).collect()
    }

    #[test]
    fn the_field_ahead_is_wanted_and_behind_the_end_the_first_one() {
        let flux = manifest(Quantity::CarbonFlux, 12);
        let of = |time, heading, most| wanted(&flux, time, heading, most);
        assert_eq!(of("2000-05-01", Heading::Forward, 1), [6]);
        assert_eq!(of("2000-05-01", Heading::Forward, 2), [6, 7]);
        assert_eq!(of("2000-05-01", Heading::Backward, 1), [3]);
        assert_eq!(of("2000-05-01", Heading::Unknown, 1), [6, 3]);
        assert_eq!(of("2000-12-30", Heading::Forward, 1), [1]);
        assert_eq!(of("2000-01-02", Heading::Backward, 1), [12]);
    }

    #[test]
    fn accumulation_starts_before_its_first_field() {
        let carbon = manifest(Quantity::AccumulatedCarbon, 12);
        assert_eq!(wanted(&carbon, "2000-01-10", Heading::Forward, 1), [2]);
        let at = |time: &str| {
            let sample = carbon.time_sample(time.parse().unwrap()).unwrap();
            place_of(&carbon, &sample).unwrap()
        };
        assert!(at("2000-01-01") < at("2000-01-10") && at("2000-01-10") < at("2000-02-10"));
    }

    #[test]
    fn what_is_there_already_is_not_wanted_and_strangers_want_nothing() {
        let two = manifest(Quantity::CarbonFlux, 2);
        assert_eq!(wanted(&two, "2000-01-30", Heading::Unknown, 4), [0_u32; 0]);
        let flux = manifest(Quantity::CarbonFlux, 12);
        let mut stranger = flux.time_sample("2000-05-01".parse().unwrap()).unwrap();
        stranger.before = Some("frames/p/elsewhere".parse().unwrap());
        assert!(next(&flux, &stranger, Heading::Forward, 1).is_empty());
        assert_eq!(place_of(&flux, &stranger), None);
    }

    #[test]
    fn the_direction_is_that_of_the_last_move() {
        let heading = Heading::Unknown.after(2.0, 2.0);
        assert_eq!(heading, Heading::Unknown);
        let heading = heading.after(2.0, 2.5);
        assert_eq!(heading, Heading::Forward);
        assert_eq!(heading.after(2.5, 2.5), Heading::Forward);
        assert_eq!(heading.after(2.5, 2.25), Heading::Backward);
    }
}
