//! Names for single samples of a file that does not say whose they are: an instant and a place in, a name out.

use std::collections::BTreeMap;

use contract::time::TimeMs;

use super::name;

/// Samples of one instant at several places, which one platform cannot have measured: each place is one of its own.
#[derive(Debug, Default)]
pub(super) struct Points {
    /// Which of the places of its instant one is, from 0.
    places: BTreeMap<(TimeMs, u64, u64), u32>,
    /// Places of each instant.
    counts: BTreeMap<TimeMs, u32>,
}

impl Points {
    /// The name of the platform of a sample: that of all of them (`name`) for the first place of its instant, with a number
    /// behind it for further ones. The same for whatever is measured there and then.
    pub(super) fn name(
        &mut self,
        name: &str,
        time: TimeMs,
        [lon_deg, lat_deg]: [f64; 2],
    ) -> String {
        let place = (time, lon_deg.to_bits(), lat_deg.to_bits());
        let number = *self.places.entry(place).or_insert_with(|| {
            let count = self.counts.entry(time).or_default();
            *count += 1;
            *count
        });
        if number == 1 {
            name.to_owned()
        } else {
            name::numbered(name, number)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_one_instant_are_told_apart_whatever_is_measured_there() {
        let mut points = Points::default();
        let [early, late] =
            ["2000-01-01", "2000-01-02"].map(|text| text.parse::<TimeMs>().unwrap());
        let mut name = |time, lon_deg| points.name("cast", time, [lon_deg, 10.0]);
        assert_eq!(name(early, 1.0), "cast");
        assert_eq!(name(early, 2.0), "cast-2");
        assert_eq!(name(late, 2.0), "cast");
        assert_eq!(name(early, 1.0), "cast");
        assert_eq!(name(early, 2.0), "cast-2");
        assert_eq!(name(early, 3.0), "cast-3");
    }
}
