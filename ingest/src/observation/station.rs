//! Where stations are whose files do not say it.

use std::sync::LazyLock;

use contract::grid::LonLatDeg;
use serde::Deserialize;

/// A station of a network.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Station {
    /// Its name in file names.
    pub(super) id: String,
    /// Longitude, degrees east.
    lon_deg: f64,
    /// Latitude, degrees north.
    lat_deg: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stations {
    ndbc: Vec<Station>,
}

static SHIPPED: LazyLock<Stations> = LazyLock::new(|| {
    toml::from_str(include_str!("stations.toml")).expect("a test reads the shipped stations")
});

impl Station {
    pub(super) fn place(&self) -> LonLatDeg {
        LonLatDeg {
            lon: self.lon_deg,
            lat: self.lat_deg,
        }
    }
}

/// The NDBC station that a file's name names.
pub(super) fn ndbc(file_name: &str) -> Option<&'static Station> {
    let words = file_name.split(|c: char| !c.is_ascii_alphanumeric());
    let names = |station: &Station, word: &str| {
        // 44005h2012.txt is a year of station 44005.
        let is_year = |rest: &str| {
            rest.strip_prefix(['h', 'H'])
                .is_some_and(|y| y.bytes().all(|b| b.is_ascii_digit()))
        };
        let head = word.get(..station.id.len());
        head.is_some_and(|head| head.eq_ignore_ascii_case(&station.id))
            && (word.len() == station.id.len() || is_year(&word[station.id.len()..]))
    };
    let known = &SHIPPED.ndbc;
    words
        .into_iter()
        .find_map(|word| known.iter().find(|station| names(station, word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_stations_are_places_and_are_found_by_file_names() {
        for station in &SHIPPED.ndbc {
            let LonLatDeg { lon, lat } = station.place();
            assert!(LonLatDeg::new(lon, lat).is_ok() && (-180.0..180.0).contains(&lon));
        }
        for name in ["buoy_44005_2012.dat", "44005h2012.txt", "44005.txt"] {
            assert_eq!(ndbc(name).unwrap().id, "44005", "{name}");
        }
        for name in ["144005.txt", "440051.txt", "buoy.dat", ""] {
            assert_eq!(ndbc(name), None, "{name}");
        }
    }
}
