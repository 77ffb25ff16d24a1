//! Regions that budgets are asked for: the globe, named regions, boxes and polygons.

mod asked;
mod cells;
mod collection;
mod kept;
mod mask;
mod named;
mod text;

use serde::{Deserialize, Serialize};

use crate::ContractError;
pub use asked::AskedRegion;
pub use cells::Cells;
pub use collection::{MAX_REGIONS, named_regions};
pub use kept::{KeptRegion, MAX_KEPT_CORNERS};
pub use mask::MaskCode;
pub use named::{NAMED_REGIONS, NamedRegion};

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

/// A polygon in longitude and latitude, degrees, its edges straight between these numbers as they are (RFC 7946, section
/// 3.1.1): from -100 to 100 it is 200 degrees wide. Longitudes may pass 180 where it crosses the date line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// Outer boundary, as `[lon, lat]` corners; closed or not.
    pub outer: Vec<[f64; 2]>,
    /// Holes.
    pub holes: Vec<Vec<[f64; 2]>>,
}

impl Region {
    /// A box with `west` wrapped into [-180, 180) and `east` above it.
    ///
    /// # Errors
    /// Not finite, latitudes past a pole or not rising, no width, or more of it than once around.
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
        // Edges that are sums have the noise of sums.
        let asked_deg = crate::grid::rounded_deg(east - west);
        if asked_deg > 360.0 {
            let reason = format!(
                "it is {asked_deg} degrees wide: a box goes once around at most, its east is at most its west + 360"
            );
            return bad(&reason);
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

    /// Parses `global`, a named region, `west,south,east,north`, GeoJSON text or well-known text.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if let Some(named) = NamedRegion::find(s) {
            return Ok(named.region());
        }
        if let Some(region) = text::polygons(s) {
            return region.map(Self::Polygons);
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
            "west,south,east,north in degrees, GeoJSON, POLYGON or MULTIPOLYGON text, the cells of a mask that have a code as MASK:CODE, or one of {}",
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
    fn a_box_that_goes_around_more_than_once_is_refused_with_its_width() {
        for (text, width) in [("0,-10,400,10", "400"), ("-180,-90,180.5,90", "360.5")] {
            let refused = text.parse::<Region>().unwrap_err().to_string();
            let told = format!("it is {width} degrees wide: a box goes once around");
            assert!(refused.contains(&told), "{refused}");
        }
        // 0.1 and 360 have a sum that lies further than 360 from 0.1.
        for west in [0.1, -179.9, 33.3] {
            let region = Region::new_box(west, -1.0, west + 360.0, 1.0).unwrap();
            assert!(matches!(region, Region::Box { west, east, .. } if east - west > 359.9));
        }
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
}
