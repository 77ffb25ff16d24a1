//! Observations of platforms of one dataset, in the order of time, in; the way of each out, one place for each time.

use std::collections::BTreeMap;

use contract::observation::{Observation, TrackPoint};

/// Most places of several ways that are held together, 24 bytes each: a way is held whole until its last place says which are its answer.
pub(super) const MAX_HELD: usize = 4_000_000;

/// Whole ways of platforms.
#[derive(Debug, Default)]
pub(super) struct Ways {
    places: BTreeMap<String, Vec<TrackPoint>>,
    held: usize,
}

impl Ways {
    /// Puts the place of a row at the end of its platform's way; of one time the first counts.
    pub(super) fn add(&mut self, row: &Observation) {
        let place = TrackPoint {
            time: row.time,
            lon_deg: row.lon_deg,
            lat_deg: row.lat_deg,
        };
        match self.places.get_mut(&row.platform) {
            Some(way) if way.last().is_some_and(|last| last.time == row.time) => return,
            Some(way) => way.push(place),
            None => {
                self.places.insert(row.platform.clone(), vec![place]);
            }
        }
        self.held += 1;
    }

    /// Places of all of them.
    pub(super) fn held(&self) -> usize {
        self.held
    }

    /// The whole way of a platform; empty of one that was nowhere.
    pub(super) fn of(&self, platform: &str) -> Vec<TrackPoint> {
        self.places.get(platform).cloned().unwrap_or_default()
    }
}
