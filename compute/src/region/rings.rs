//! Rings of a region's polygons: corners checked and taken as RFC 7946 says, each place counted once, turned.

use contract::earth::Earth;
use contract::region::{MAX_CORNERS, Polygon, Region};

use super::area::signed_area_m2;
use super::crossings;
use super::cut::WORLD_DEG;
use super::ring::{Checked, Ring};
use super::union::united;
use crate::ComputeError;
use crate::awaited::Awaited;

/// Slack when angles are compared, degrees: a tenth of a millimetre.
const SLACK_DEG: f64 = 1e-9;
/// Farthest longitude of a corner, degrees.
const MAX_LON_DEG: f64 = 720.0;
/// Area below which a region has none, m².
const MIN_AREA_M2: f64 = 1e-6;

/// The rings of a region: every place that lies in any of its polygons is inside of them once.
///
/// Inside of a ring is what it goes round at all, in either direction and however often (the non-zero rule); a polygon
/// is the inside of its outer ring less that of its holes; a region is the union of its polygons, also where one is
/// written with longitudes past 180 and another is not.
///
/// # Errors
/// No corner, corners that are no places, more than a million of them, edges that cross very often, a ring that is wider than the earth, or no
/// area.
pub(super) fn rings(region: &Region) -> Result<Vec<Ring>, ComputeError> {
    rings_while(region, &Awaited::always())
}

/// The same for as long as it is awaited.
///
/// # Errors
/// As [`rings`], and `NotAwaited`.
pub(super) fn rings_while(region: &Region, awaited: &Awaited) -> Result<Vec<Ring>, ComputeError> {
    match region {
        Region::Global => {
            let [west, east] = WORLD_DEG;
            Ok(vec![Ring::rectangle([west, -90.0, east, 90.0])])
        }
        Region::Box {
            west,
            south,
            east,
            north,
        } => Ok(vec![Ring::rectangle([*west, *south, *east, *north])]),
        Region::Polygons(polygons) => {
            let polygons = checked(polygons)?;
            awaited.check()?;
            if let Some(most) = crossings::too_many(&polygons) {
                return Err(bad(format!(
                    "its edges cross more than {most} times, and at most so many crossings are resolved; give polygons whose \
                     edges do not cross, or fewer corners"
                )));
            }
            let rings = united(&polygons, awaited)?;
            let area_m2: f64 = rings
                .iter()
                .map(|ring| signed_area_m2(ring, Earth::Sphere))
                .sum();
            if area_m2 < MIN_AREA_M2 {
                return Err(bad(
                    "it has no area with edges straight in longitude and latitude (RFC 7946); a ring round a pole is \
                     led along 180 to the pole and back along -180",
                ));
            }
            Ok(rings)
        }
    }
}

/// Polygons whose corners are places.
pub(super) fn checked(polygons: &[Polygon]) -> Result<Vec<Checked>, ComputeError> {
    let all = polygons
        .iter()
        .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes));
    let corner_count: usize = all.map(Vec::len).sum();
    if corner_count > MAX_CORNERS {
        return Err(bad(format!(
            "{corner_count} corners, at most {MAX_CORNERS} are taken; simplify it"
        )));
    }
    if polygons.is_empty() {
        return Err(bad("it has no polygon"));
    }
    let polygon = |polygon: &Polygon| {
        Ok(Checked {
            outer: open(&polygon.outer)?,
            holes: polygon
                .holes
                .iter()
                .map(|hole| open(hole))
                .collect::<Result<_, _>>()?,
        })
    };
    polygons.iter().map(polygon).collect()
}

/// Corners of a ring without the repeated last one.
fn open(corners: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, ComputeError> {
    let place = |corner: &&[f64; 2]| {
        let [lon, lat] = **corner;
        lon.abs() <= MAX_LON_DEG && lat.abs() <= 90.0 + SLACK_DEG
    };
    if let Some(corner) = corners.iter().find(|corner| !place(corner)) {
        return Err(bad(format!(
            "{corner:?} is no longitude, latitude in degrees: the longitude comes first, and the latitude is -90 to 90"
        )));
    }
    let repeated = corners.len() > 1 && corners.first() == corners.last();
    let corners = &corners[..corners.len() - usize::from(repeated)];
    if corners.len() < 3 {
        return Err(bad("a ring has fewer than three corners"));
    }
    let corners: Vec<_> = corners
        .iter()
        .map(|&[lon, lat]| [lon, lat.clamp(-90.0, 90.0)])
        .collect();
    let (west, east) = Ring::new(corners.clone()).lon_range_deg();
    if east - west > 360.0 + SLACK_DEG {
        return Err(bad(format!(
            "a ring is {} degrees wide; the earth has 360",
            east - west
        )));
    }
    Ok(corners)
}

pub(super) fn bad(reason: impl Into<String>) -> ComputeError {
    ComputeError::Region {
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests;
