//! Which cell and which steps an observation belongs to: pure maths.

use contract::grid::LonLatDeg;
use contract::manifest::{Bracket, Manifest};
use contract::observation::Observation;
use contract::time::TimeMs;
use cube::CellAt;

use super::{LeftOut, TimeMatch};

/// Mean radius of the earth, km (IUGG: (2a + b) / 3 of GRS 80).
const EARTH_RADIUS_KM: f64 = 6371.0088;
const HOUR_MS: f64 = 3_600_000.0;

/// The share of one step in a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    step: usize,
    weight: f64,
}

/// An observation with its cell and steps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pair {
    /// Its index.
    pub(super) observation: usize,
    /// Row and column of its cell.
    cell: (u32, u32),
    pub(super) shares: Vec<Share>,
    /// The product's value, once its steps were added; NaN where one of them has no data.
    pub(super) gridded: f64,
    pub(super) distance_km: f64,
    pub(super) hours: f64,
}

/// All observations with a cell and a step.
pub(super) struct Pairing {
    pub(super) pairs: Vec<Pair>,
    pub(super) left_out: LeftOut,
}

impl Pair {
    /// Its cell at each of its steps.
    pub(super) fn cells(&self) -> impl Iterator<Item = CellAt> {
        let (row, col) = self.cell;
        self.shares.iter().map(move |share| CellAt {
            step: share.step,
            row,
            col,
        })
    }

    /// Adds up the values of these, in their order.
    pub(super) fn add(&mut self, values: &[f32]) {
        for (share, value) in self.shares.iter().zip(values) {
            self.gridded += share.weight * f64::from(*value);
        }
    }
}

/// Finds cell and steps of every observation.
pub(super) fn all(
    manifest: &Manifest,
    observations: &[Observation],
    time_match: TimeMatch,
) -> Pairing {
    let mut pairing = Pairing {
        pairs: vec![],
        left_out: LeftOut::default(),
    };
    for (index, observation) in observations.iter().enumerate() {
        let Some((shares, hours)) = shares(manifest, observation.time, time_match) else {
            pairing.left_out.other_time += 1;
            continue;
        };
        let place = LonLatDeg {
            lon: observation.lon_deg,
            lat: observation.lat_deg,
        };
        let Some((row, col)) = manifest.grid.cell_at(place) else {
            pairing.left_out.outside += 1;
            continue;
        };
        pairing.pairs.push(Pair {
            observation: index,
            cell: (row, col),
            shares,
            gridded: 0.0,
            distance_km: distance_km(place, manifest.grid.cell_center(row, col)),
            hours,
        });
    }
    pairing
}

/// The steps that a time is compared with and their weights, and hours from the middle of the covering step; none if no
/// step covers it. Values are not interpolated over a gap between two steps.
fn shares(manifest: &Manifest, time: TimeMs, time_match: TimeMatch) -> Option<(Vec<Share>, f64)> {
    let after = manifest
        .steps
        .partition_point(|step| step.period.start <= time);
    let covering = after.checked_sub(1)?;
    let period = manifest.steps[covering].period;
    if period.end <= time {
        return None;
    }
    let hours = (time.ms() - period.mid().ms()) as f64 / HOUR_MS;
    let alone = vec![Share {
        step: covering,
        weight: 1.0,
    }];
    if time_match == TimeMatch::Nearest {
        return Some((alone, hours));
    }
    let shares = match manifest.bracket(time)? {
        Bracket {
            before: Some(before),
            after,
            weight,
        } if before != after && is_seamless(manifest, before, after) => {
            let share = |step, weight| Share { step, weight };
            vec![share(before, 1.0 - weight), share(after, weight)]
        }
        _ => alone,
    };
    Some((shares, hours))
}

fn is_seamless(manifest: &Manifest, before: usize, after: usize) -> bool {
    manifest.steps[before].period.end == manifest.steps[after].period.start
}

/// Great-circle distance on a sphere, km; the haversine form keeps its digits for short distances.
fn distance_km(a: LonLatDeg, b: LonLatDeg) -> f64 {
    let (lat_a, lat_b) = (a.lat.to_radians(), b.lat.to_radians());
    let half_lat = ((lat_b - lat_a) / 2.0).sin();
    let half_lon = ((b.lon - a.lon).to_radians() / 2.0).sin();
    let square = half_lat * half_lat + lat_a.cos() * lat_b.cos() * half_lon * half_lon;
    2.0 * EARTH_RADIUS_KM * square.sqrt().min(1.0).asin()
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::{MANIFEST_SCHEMA, Step};
    use contract::quantity::Quantity;
    use contract::time::Period;

    fn manifest(months: &[u32]) -> Manifest {
        let product = "sst".parse().unwrap();
        let digest = Digest::of(b"");
        let step = |month: &u32| Step {
            masked: None,
            period: Period::month(2010, *month).unwrap(),
            field: ObjectKey::field(&product, &digest),
            raw_sha256: digest,
            origin: "f.nc".into(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: String::new(),
            quantity: Quantity::SeaSurfaceTemperature,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 180,
                cols: 360,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: months.iter().map(step).collect(),
            domain: ObjectKey::domain(&product, &digest),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    fn at(months: &[u32], time: &str, how: TimeMatch) -> Option<(Vec<(usize, f64)>, f64)> {
        let (shares, hours) = shares(&manifest(months), time.parse().unwrap(), how)?;
        Some((
            shares.into_iter().map(|s| (s.step, s.weight)).collect(),
            hours,
        ))
    }

    #[test]
    fn a_time_belongs_to_the_month_that_covers_it() {
        let (shares, hours) = at(&[1, 2, 3], "2010-02-15", TimeMatch::Nearest).unwrap();
        assert_eq!((shares, hours), (vec![(1, 1.0)], 0.0));
        let (shares, hours) = at(&[1, 2, 3], "2010-02-01", TimeMatch::Nearest).unwrap();
        assert_eq!((shares, hours), (vec![(1, 1.0)], -14.0 * 24.0));
        for outside in ["2009-12-31T23:59:59Z", "2010-04-01"] {
            assert_eq!(at(&[1, 2, 3], outside, TimeMatch::Nearest), None);
        }
        assert_eq!(at(&[1, 3], "2010-02-10", TimeMatch::Linear), None, "a gap");
    }

    #[test]
    fn between_two_middles_both_months_count() {
        // Middles are 16 January 12:00 and 15 February 0:00; half way is 31 January 6:00.
        let (shares, _) = at(&[1, 2], "2010-01-31T06:00:00Z", TimeMatch::Linear).unwrap();
        assert_eq!(shares, [(0, 0.5), (1, 0.5)]);
        let (shares, _) = at(&[1, 2], "2010-01-02", TimeMatch::Linear).unwrap();
        assert_eq!(shares, [(0, 1.0)], "before the first middle");
        let (shares, _) = at(&[1, 3], "2010-01-31", TimeMatch::Linear).unwrap();
        assert_eq!(shares, [(0, 1.0)], "not over a gap");
    }

    #[test]
    fn a_degree_of_latitude_is_111_km() {
        let place = |lon, lat| LonLatDeg { lon, lat };
        // 6371.0088 km times pi / 180.
        assert!((distance_km(place(0.0, 0.0), place(0.0, 1.0)) - 111.195_080).abs() < 1e-5);
        assert!((distance_km(place(179.5, 0.0), place(-179.5, 0.0)) - 111.195_080).abs() < 1e-5);
        assert_eq!(distance_km(place(10.0, 50.0), place(10.0, 50.0)), 0.0);
    }
}
