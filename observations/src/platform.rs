//! What is known of one platform in all: for maps and lists.

use std::collections::{BTreeMap, BTreeSet};

use contract::observation::{Observation, Platform, PlatformList};
use contract::product::ProductId;
use contract::time::TimeMs;

/// The narrower of the bounds that run from -180 to 180 and those from 0 to 360.
///
/// - `plain`, `eastward`: least and greatest longitude, degrees, in [-180, 180) and in [0, 360)
pub(crate) fn bounds_deg(plain: [f64; 2], eastward: [f64; 2], lat: [f64; 2]) -> [f64; 4] {
    let [west, east] = if eastward[1] - eastward[0] < plain[1] - plain[0] {
        eastward
    } else {
        plain
    };
    let turn_deg = if west >= 180.0 { -360.0 } else { 0.0 };
    [west + turn_deg, lat[0], east + turn_deg, lat[1]]
}

/// At most `limit` platforms of those that there are, which are one more than the limit at least if there are more.
pub(crate) fn list(platforms: impl Iterator<Item = Platform>, limit: u32) -> PlatformList {
    let limit = limit as usize;
    let mut platforms: Vec<Platform> = platforms.take(limit + 1).collect();
    let is_complete = platforms.len() <= limit;
    platforms.truncate(limit);
    PlatformList {
        platforms,
        is_complete,
    }
}

/// Longitude in [0, 360).
pub(crate) fn eastward_lon_deg(lon: f64) -> f64 {
    if lon < 0.0 { lon + 360.0 } else { lon }
}

/// Platforms from observations that come in any order.
#[derive(Debug, Default)]
pub(crate) struct Gathering {
    found: BTreeMap<(ProductId, String), Gathered>,
}

#[derive(Debug)]
struct Gathered {
    /// The observation that time, then property, then depth make the last one.
    last: Observation,
    first: TimeMs,
    plain: [f64; 2],
    eastward: [f64; 2],
    lat: [f64; 2],
    properties: BTreeSet<String>,
    count: u64,
}

impl Gathering {
    pub(crate) fn add(&mut self, o: Observation) {
        let name = (o.dataset.clone(), o.platform.clone());
        let eastward = eastward_lon_deg(o.lon_deg);
        let Some(known) = self.found.get_mut(&name) else {
            let gathered = Gathered {
                first: o.time,
                plain: [o.lon_deg; 2],
                eastward: [eastward; 2],
                lat: [o.lat_deg; 2],
                properties: BTreeSet::from([o.property.clone()]),
                count: 1,
                last: o,
            };
            self.found.insert(name, gathered);
            return;
        };
        known.first = known.first.min(o.time);
        widen(&mut known.plain, o.lon_deg);
        widen(&mut known.eastward, eastward);
        widen(&mut known.lat, o.lat_deg);
        known.count += 1;
        if !known.properties.contains(&o.property) {
            known.properties.insert(o.property.clone());
        }
        if is_later(&o, &known.last) {
            known.last = o;
        }
    }

    /// Platforms by dataset and name.
    pub(crate) fn finish(self) -> impl Iterator<Item = Platform> {
        self.found
            .into_iter()
            .map(|((dataset, platform), g)| Platform {
                dataset,
                platform,
                kind: g.last.kind,
                first: g.first,
                last: g.last.time,
                bounds_deg: bounds_deg(g.plain, g.eastward, g.lat),
                lon_deg: g.last.lon_deg,
                lat_deg: g.last.lat_deg,
                properties: g.properties.into_iter().collect(),
                count: g.count,
            })
    }
}

/// Later in time; at one time the first property and then the least depth stands for the platform.
fn is_later(a: &Observation, b: &Observation) -> bool {
    let by_name = || {
        let property = a.property.cmp(&b.property);
        property.then(a.depth_m.total_cmp(&b.depth_m))
    };
    a.time > b.time || a.time == b.time && by_name().is_lt()
}

fn widen(range: &mut [f64; 2], number: f64) {
    range[0] = range[0].min(number);
    range[1] = range[1].max(number);
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;
    use crate::batch::tests::observation;

    #[test]
    fn a_ship_across_the_date_line_has_narrow_bounds() {
        let mut gathering = Gathering::default();
        for (lon_deg, hour) in [(179.0, 0), (-179.5, 1), (-178.0, 2)] {
            let time = format!("2012-01-01T{hour:02}:00:00Z").parse().unwrap();
            gathering.add(Observation {
                lon_deg,
                time,
                ..observation("s", 1.0)
            });
        }
        let ship = gathering.finish().next().unwrap();
        assert_eq!(ship.bounds_deg, [179.0, -0.0, 182.0, -0.0]);
        assert_eq!((ship.lon_deg, ship.count), (-178.0, 3));
        assert_eq!(bounds_deg([-10.0, 5.0], [5.0, 350.0], [0.0; 2])[0], -10.0);
        assert_eq!(
            bounds_deg([-170.0, -160.0], [190.0, 200.0], [0.0; 2])[0],
            -170.0
        );
    }
}
