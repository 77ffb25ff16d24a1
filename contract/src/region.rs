//! Regions that budgets are asked for: the globe, named regions, boxes and polygons.

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Most corners a region's polygons may have together.
pub const MAX_CORNERS: usize = 1_000_000;

/// A part of the earth's surface; edges are straight in longitude and latitude.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// All of it.
    Global,
    /// A box, degrees; `east` may pass 180 so that a box may cross the date line.
    Box {
        /// Western edge, in [-180, 180).
        west: f64,
        /// Southern edge.
        south: f64,
        /// Eastern edge, above `west` by at most 360.
        east: f64,
        /// Northern edge.
        north: f64,
    },
    /// Polygons, each an outer ring and its holes.
    Polygons(Vec<Polygon>),
}

/// A polygon in longitude and latitude, degrees; longitudes may pass 180 where it crosses the date line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// Outer boundary, as `[lon, lat]` corners; closed or not.
    pub outer: Vec<[f64; 2]>,
    /// Holes.
    pub holes: Vec<Vec<[f64; 2]>>,
}

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
    /// The named region, if there is one.
    pub fn find(name: &str) -> Option<&'static Self> {
        NAMED_REGIONS.iter().find(|region| region.name == name)
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

impl Region {
    /// A box with `west` wrapped into [-180, 180) and `east` above it.
    ///
    /// # Errors
    /// Not finite, latitudes past a pole or not rising, or no width.
    pub fn new_box(west: f64, south: f64, east: f64, north: f64) -> Result<Self, ContractError> {
        let bad = |reason: &str| {
            Err(ContractError::invalid(
                "box",
                &format!("{west},{south},{east},{north}"),
                reason,
            ))
        };
        if ![west, south, east, north]
            .iter()
            .all(|v| v.is_finite() && v.abs() <= 720.0)
        {
            return bad("four numbers west,south,east,north in degrees");
        }
        if south >= north || south < -90.0 || north > 90.0 {
            return bad("latitudes must rise from south to north within -90 to 90");
        }
        let width = if east - west >= 360.0 {
            360.0
        } else {
            (east - west).rem_euclid(360.0)
        };
        if width == 0.0 {
            return bad("it has no width");
        }
        let west = crate::grid::wrap_lon_deg(west);
        Ok(Self::Box {
            west,
            south,
            east: west + width,
            north,
        })
    }
}

impl std::str::FromStr for Region {
    type Err = ContractError;

    /// Parses `global`, a named region, or `west,south,east,north`.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if let Some(named) = NamedRegion::find(s) {
            return Ok(named.region());
        }
        let numbers: Result<Vec<f64>, _> = s
            .split(',')
            .take(5)
            .map(|part| part.trim().parse())
            .collect();
        if let Ok(&[west, south, east, north]) = numbers.as_deref() {
            return Self::new_box(west, south, east, north);
        }
        let names: Vec<_> = NAMED_REGIONS.iter().map(|r| r.name).collect();
        let reason = format!(
            "west,south,east,north in degrees, or one of {}",
            names.join(", ")
        );
        Err(ContractError::invalid("region", s, reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_across_the_date_line_goes_on_eastwards() {
        let region: Region = "170,-10,-170,10".parse().unwrap();
        assert_eq!(
            region,
            Region::Box {
                west: 170.0,
                south: -10.0,
                east: 190.0,
                north: 10.0
            }
        );
        let other: Region = "170,-10,190,10".parse().unwrap();
        assert_eq!(region, other);
    }

    #[test]
    fn a_whole_turn_is_kept() {
        let region: Region = "0,-10,360,10".parse().unwrap();
        assert_eq!(
            region,
            Region::Box {
                west: 0.0,
                south: -10.0,
                east: 360.0,
                north: 10.0
            }
        );
    }

    #[test]
    fn nonsense_regions_are_refused() {
        for s in [
            "",
            "atlantis",
            "1,2,3",
            "1,2,3,4,5",
            "0,10,10,0",
            "0,0,0,10",
            "nan,0,1,1",
            "0,-91,1,1",
            "1e300,0,1,1",
        ] {
            assert!(s.parse::<Region>().is_err(), "{s}");
        }
    }

    #[test]
    fn every_named_region_is_found_by_its_name() {
        for named in NAMED_REGIONS {
            assert_eq!(named.name.parse::<Region>().unwrap(), named.region());
        }
    }
}
