//! Regions with names: the bands that papers report, and a few seas.

use super::{Polygon, Region};

/// A region with a name people use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedRegion {
    /// Name on the command line and in URLs.
    pub name: &'static str,
    /// Title for people.
    pub title: &'static str,
    /// West, south, east, north of its bounds, degrees.
    pub bounds_deg: [f64; 4],
    /// Outer boundary where it is no box.
    corners: &'static [[f64; 2]],
}

/// Named regions: the ocean bands that Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009, table 6, reports, and
/// a few seas as boxes.
pub const NAMED_REGIONS: &[NamedRegion] = &[
    boxed("global", "Global ocean", [-180.0, -90.0, 180.0, 90.0]),
    boxed(
        "north-of-50n",
        "North of 50° N",
        [-180.0, 50.0, 180.0, 90.0],
    ),
    boxed("14n-50n", "14° N to 50° N", [-180.0, 14.0, 180.0, 50.0]),
    boxed("14s-14n", "14° S to 14° N", [-180.0, -14.0, 180.0, 14.0]),
    boxed("14s-50s", "14° S to 50° S", [-180.0, -50.0, 180.0, -14.0]),
    boxed("50s-62s", "50° S to 62° S", [-180.0, -62.0, 180.0, -50.0]),
    boxed(
        "south-of-62s",
        "South of 62° S",
        [-180.0, -90.0, 180.0, -62.0],
    ),
    NamedRegion {
        name: "equatorial-pacific",
        title: "Equatorial Pacific, 14° S to 14° N",
        bounds_deg: [125.5, -14.0, 284.5, 14.0],
        corners: EQUATORIAL_PACIFIC,
    },
    boxed(
        "china-sea",
        "China Sea, 100° E to 130° E, 0° to 41° N",
        [100.0, 0.0, 130.0, 41.0],
    ),
];

/// Coasts to coasts: east of the Philippines, Halmahera, New Guinea and Cape York (so without the Indonesian seas and
/// the Arafura Sea), west of the Americas from El Salvador along the isthmus to Peru (so without the Caribbean). Corners
/// lie on land wherever there is land.
const EQUATORIAL_PACIFIC: &[[f64; 2]] = &[
    [125.5, 14.0],  // east of Samar
    [126.5, 7.5],   // Mindanao
    [127.5, 4.0],   // Talaud Islands
    [128.0, 1.0],   // Halmahera
    [131.0, -0.8],  // Bird's Head, New Guinea
    [134.0, -3.0],  // its neck
    [138.0, -4.5],  // central range
    [141.0, -6.0],  // central range
    [143.5, -9.0],  // Torres Strait, north
    [142.5, -11.0], // Cape York
    [143.5, -14.0], // Cape York Peninsula, east coast
    [284.5, -14.0], // Peru, south of Lima
    [282.0, -8.0],  // Peru, Trujillo
    [280.5, -5.0],  // Peru, Piura
    [281.0, -1.0],  // Ecuador
    [283.0, 4.0],   // Colombia
    [283.0, 7.5],   // Darien
    [280.5, 9.0],   // Panama Canal
    [279.0, 9.2],   // Panama, west
    [276.5, 10.5],  // Costa Rica
    [275.0, 13.0],  // Nicaragua
    [272.0, 14.0],  // Honduras
];

const fn boxed(name: &'static str, title: &'static str, bounds_deg: [f64; 4]) -> NamedRegion {
    NamedRegion {
        name,
        title,
        bounds_deg,
        corners: &[],
    }
}

impl NamedRegion {
    /// The named region, if there is one; capitals are as small letters.
    pub fn find(name: &str) -> Option<&'static Self> {
        NAMED_REGIONS
            .iter()
            .find(|region| region.name.eq_ignore_ascii_case(name))
    }

    /// Its shape.
    pub fn region(&self) -> Region {
        let [west, south, east, north] = self.bounds_deg;
        if self.name == "global" {
            Region::Global
        } else if self.corners.is_empty() {
            Region::Box {
                west,
                south,
                east,
                north,
            }
        } else {
            Region::Polygons(vec![Polygon {
                outer: self.corners.to_vec(),
                holes: vec![],
            }])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_region_is_found_by_its_name() {
        for named in NAMED_REGIONS {
            assert_eq!(named.name.parse::<Region>().unwrap(), named.region());
        }
    }
}
