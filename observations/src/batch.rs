//! Observations as they come in to what is stored: checked, in one spelling, sorted, each name once.

use contract::ContractError;
use contract::grid::wrap_lon_deg;
use contract::observation::Observation;

use crate::key;

/// Checks and sorts a batch; of several observations of one name the last one stays.
///
/// # Errors
/// The first observation that breaks a limit: then nothing of the batch is stored.
pub(crate) fn prepare(observations: &[Observation]) -> Result<Vec<Observation>, ContractError> {
    let mut batch = observations
        .iter()
        .map(|o| o.validate().map(|()| plain(o)))
        .collect::<Result<Vec<_>, _>>()?;
    // The sort is stable: of equal names the one given last is the last.
    batch.sort_by(key::order);
    batch.dedup_by(|later, kept| {
        let same = key::order(later, kept).is_eq();
        if same {
            std::mem::swap(later, kept);
        }
        same
    });
    Ok(batch)
}

/// One spelling for equal things: longitude in [-180, 180), no negative zero.
fn plain(observation: &Observation) -> Observation {
    Observation {
        lon_deg: wrap_lon_deg(observation.lon_deg) + 0.0,
        lat_deg: observation.lat_deg + 0.0,
        depth_m: observation.depth_m + 0.0,
        value: observation.value + 0.0,
        ..observation.clone()
    }
}

/// Do two observations of one name say the same?
#[expect(clippy::float_cmp, reason = "the same numbers, not near ones")]
pub(crate) fn says_the_same(a: &Observation, b: &Observation) -> bool {
    (a.kind, a.quality, &a.unit) == (b.kind, b.quality, &b.unit)
        && a.lon_deg == b.lon_deg
        && a.lat_deg == b.lat_deg
        && a.value == b.value
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use contract::observation::{PlatformKind, Quality};

    pub(crate) fn observation(platform: &str, value: f64) -> Observation {
        Observation {
            dataset: "buoys".parse().unwrap(),
            platform: platform.to_owned(),
            kind: PlatformKind::Buoy,
            time: "2012-01-01T00:50:00Z".parse().unwrap(),
            lon_deg: 190.0,
            lat_deg: -0.0,
            depth_m: -0.0,
            property: "sea_surface_temperature".to_owned(),
            value,
            unit: "K".to_owned(),
            quality: Quality::Good,
        }
    }

    #[test]
    fn of_one_name_the_last_one_stays() {
        let given = [
            observation("b", 1.0),
            observation("a", 2.0),
            observation("b", 3.0),
            observation("b", 4.0),
        ];
        let batch = prepare(&given).unwrap();
        let found: Vec<_> = batch
            .iter()
            .map(|o| (o.platform.as_str(), o.value))
            .collect();
        assert_eq!(found, [("a", 2.0), ("b", 4.0)]);
    }

    #[test]
    fn equal_places_have_one_spelling() {
        let batch = prepare(&[observation("a", -0.0)]).unwrap();
        let o = &batch[0];
        assert_eq!(o.lon_deg.to_bits(), (-170.0f64).to_bits());
        for number in [o.lat_deg, o.depth_m, o.value] {
            assert_eq!(number.to_bits(), 0.0f64.to_bits());
        }
    }

    #[test]
    fn one_bad_observation_stops_its_batch() {
        let mut bad = observation("a", 1.0);
        bad.lat_deg = 91.0;
        assert!(prepare(&[observation("b", 1.0), bad]).is_err());
    }
}
