//! How large a region is and how much of it is sea; what a reader should know of how it was taken.

use contract::earth::{Earth, WGS84_EQUATORIAL_RADIUS_M};
use contract::region::{Polygon, Region};

use super::area::signed_area_m2;
use super::ring::Ring;
use super::rings::{checked, rings, rings_while};
use super::sea::sea;
use super::union::{coarsest_step_deg, groups};
use crate::ComputeError;
use crate::awaited::Awaited;

/// Edges wider than this may have been meant to go the other way round, degrees.
const WIDE_EDGE_DEG: f64 = 180.0;
/// Share of the area by which polygons that overlap differ from their union before it is worth a word.
const OVERLAP_SHARE: f64 = 1e-6;

/// Areas of a region, wherever grids may lie, and notes about its shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Extent {
    /// Area asked for, m².
    pub area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_m2: f64,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
}

/// Area of a region, m², wherever grids may lie.
pub fn region_area_m2(region: &Region, earth: Earth) -> Result<f64, ComputeError> {
    Ok(area_m2(region, &rings(region)?, earth))
}

/// The same by its rings.
fn area_m2(region: &Region, rings: &[Ring], earth: Earth) -> f64 {
    match region {
        Region::Global => earth.cell_area_m2(-90.0, 90.0, 360.0),
        Region::Box {
            west,
            south,
            east,
            north,
        } => earth.cell_area_m2(*south, *north, east - west),
        Region::Polygons(_) => rings.iter().map(|ring| signed_area_m2(ring, earth)).sum(),
    }
}

/// By how much areas of polygons as they are written and of their union may differ since corners of the union are rounded, m²: the step of
/// its lattice times the length of all outlines.
pub(crate) fn rounding_m2(polygons: &[Polygon]) -> f64 {
    let outlines = || {
        polygons
            .iter()
            .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes))
    };
    // Degrees of the equator.
    let length_deg = |[from, to]: [[f64; 2]; 2]| {
        let nearest_lat_deg = if from[1] * to[1] > 0.0 {
            from[1].abs().min(to[1].abs())
        } else {
            0.0
        };
        let along_both_deg = (to[0] - from[0]).abs() + (to[1] - from[1]).abs();
        along_both_deg * nearest_lat_deg.to_radians().cos()
    };
    let lengths_deg: f64 = outlines()
        .map(|outline| {
            let ring = Ring::new(outline.clone());
            ring.edges().map(length_deg).sum::<f64>()
        })
        .sum();
    let step_deg = coarsest_step_deg(outlines().flatten());
    step_deg.to_radians() * lengths_deg.to_radians() * WGS84_EQUATORIAL_RADIUS_M.powi(2)
}

/// The extent of a region; its sea is what is no land of Natural Earth.
pub fn extent(region: &Region, earth: Earth) -> Result<Extent, ComputeError> {
    extent_while(region, earth, &Awaited::always())
}

/// The same for as long as it is awaited.
///
/// # Errors
/// Those of the region, and `NotAwaited`.
pub(crate) fn extent_while(
    region: &Region,
    earth: Earth,
    awaited: &Awaited,
) -> Result<Extent, ComputeError> {
    let rings = rings_while(region, awaited)?;
    awaited.check()?;
    let of_sea = sea(&rings)?
        .iter()
        .map(|ring| signed_area_m2(ring, earth))
        .sum();
    awaited.check()?;
    Ok(outlined(region, &rings, earth)?.with_ocean(of_sea))
}

/// The extent of a region without its sea, for as long as it is awaited.
///
/// # Errors
/// Those of the region, and `NotAwaited`.
pub(crate) fn outline(
    region: &Region,
    earth: Earth,
    awaited: &Awaited,
) -> Result<Extent, ComputeError> {
    let rings = rings_while(region, awaited)?;
    awaited.check()?;
    outlined(region, &rings, earth)
}

fn outlined(region: &Region, rings: &[Ring], earth: Earth) -> Result<Extent, ComputeError> {
    let area_m2 = area_m2(region, rings, earth);
    let mut notes = vec![];
    if let Region::Polygons(polygons) = region {
        notes.extend(wide_edge(polygons));
        notes.extend(overlap(polygons, area_m2, earth)?);
    }
    Ok(Extent {
        area_m2,
        ocean_m2: 0.0,
        notes,
    })
}

impl Extent {
    /// The same with so much sea in it.
    pub(crate) fn with_ocean(mut self, ocean_m2: f64) -> Self {
        // Both areas are rounded apart.
        self.ocean_m2 = ocean_m2.clamp(0.0, self.area_m2);
        if self.ocean_m2 == 0.0 {
            let none = "no sea lies in the region: it has no coverage, and no gaps";
            self.notes.push(none.to_owned());
        }
        self
    }
}

/// The widest edge, if it is so wide that it may have been meant to cross the date line.
fn wide_edge(polygons: &[Polygon]) -> Option<String> {
    let width_deg = |[from, to]: &[[f64; 2]; 2]| (to[0] - from[0]).abs();
    let edges = polygons
        .iter()
        .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes))
        .flat_map(|ring| {
            let next = ring.iter().cycle().skip(1);
            ring.iter().zip(next).map(|(from, to)| [*from, *to])
        });
    let [from, to] = edges
        .filter(|edge| width_deg(edge) > WIDE_EDGE_DEG)
        // Edges along a parallel from 180 to -180 are how maps of the whole world end.
        .filter(|[from, to]| from[1].abs() < 90.0 || to[1].abs() < 90.0)
        .max_by(|a, b| width_deg(a).total_cmp(&width_deg(b)))?;
    let width_deg = width_deg(&[from, to]);
    Some(format!(
        "the edge from {},{} to {},{} is taken {width_deg} degrees wide, straight in longitude (RFC 7946); if it is meant \
         to cross the date line, write longitudes past 180 or cut the polygon there; if the ring is meant to hold a pole, \
         lead it along 180 to the pole and back along -180",
        from[0], from[1], to[0], to[1]
    ))
}

/// A word about polygons that cross or overlap. What rounding leaves of long and thin ones whose corners the union moves is no overlap.
fn overlap(
    polygons: &[Polygon],
    area_m2: f64,
    earth: Earth,
) -> Result<Option<String>, ComputeError> {
    let size = |ring: &Vec<[f64; 2]>| signed_area_m2(&Ring::new(ring.clone()), earth).abs();
    let added_m2: f64 = polygons
        .iter()
        .map(|p| size(&p.outer) - p.holes.iter().map(size).sum::<f64>())
        .sum();
    let difference_m2 = (added_m2 - area_m2).abs();
    if difference_m2 <= OVERLAP_SHARE * area_m2 || difference_m2 <= overlaid_rounding_m2(polygons)?
    {
        return Ok(None);
    }
    Ok(Some(format!(
        "rings cross, overlap or repeat: added up they would be {:.6} million km², every place counted once it is {:.6}",
        added_m2 / 1e12,
        area_m2 / 1e12
    )))
}

/// [`rounding_m2`] of polygons that are overlaid together, each group of them on a lattice of its own.
fn overlaid_rounding_m2(polygons: &[Polygon]) -> Result<f64, ComputeError> {
    let of_group = |group: Vec<usize>| {
        let together = group.into_iter().map(|index| polygons[index].clone());
        rounding_m2(&together.collect::<Vec<_>>())
    };
    Ok(groups(&checked(polygons)?).into_iter().map(of_group).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(text: &str) -> Vec<String> {
        extent(&text.parse().unwrap(), Earth::Wgs84).unwrap().notes
    }

    #[test]
    fn an_edge_that_jumps_across_the_date_line_is_taken_as_written_and_said_to_be() {
        let jumping = notes("POLYGON((179 -20,-179 -20,-179 -10,179 -10,179 -20))");
        assert_eq!(jumping.len(), 1, "{jumping:?}");
        assert!(jumping[0].contains("358 degrees wide"), "{jumping:?}");
        assert!(jumping[0].contains("past 180"), "{jumping:?}");
        let passing = notes("POLYGON((179 -20,181 -20,181 -10,179 -10,179 -20))");
        assert_eq!(passing, Vec::<String>::new());
    }

    #[test]
    fn what_overlaps_is_said_with_both_areas() {
        let twice = notes(
            "MULTIPOLYGON(((-30 0,-20 0,-20 10,-30 10,-30 0)),((-30 0,-20 0,-20 10,-30 10,-30 0)))",
        );
        assert_eq!(twice.len(), 1, "{twice:?}");
        assert!(
            twice[0].contains("2.449") && twice[0].contains("1.224"),
            "{twice:?}"
        );
    }

    #[test]
    fn rounded_corners_of_long_thin_strips_are_no_overlap() {
        // Strips of 160 degrees whose edges lie between points of the lattice, which are 1.2e-7 degrees apart.
        let strips = |[first, second]: [[&str; 2]; 2]| {
            let ring = |[south, north]: [&str; 2]| {
                format!("((-80 {south},80 {south},80 {north},-80 {north},-80 {south}))")
            };
            let text = format!("MULTIPOLYGON({},{})", ring(first), ring(second));
            let region: Region = text.parse().unwrap();
            let outline = outline(&region, Earth::Wgs84, &Awaited::always());
            outline.unwrap().notes
        };
        let beside = strips([["0", "0.0000101"], ["0.0000101", "0.0000202"]]);
        assert_eq!(beside, Vec::<String>::new());
        let over = strips([["0", "0.0000202"], ["0.0000101", "0.0000303"]]);
        assert_eq!(over.len(), 1, "{over:?}");
        assert!(over[0].contains("rings cross"), "{over:?}");
    }

    #[test]
    fn what_nobody_waits_for_is_not_measured() {
        let region: Region = "POLYGON((0 0,10 1,20 0,10 9,0 0))".parse().unwrap();
        let never = Awaited::never();
        for measure in [extent_while, outline] {
            let ended = measure(&region, Earth::Wgs84, &never);
            assert!(matches!(ended, Err(ComputeError::NotAwaited)), "{ended:?}");
            measure(&region, Earth::Wgs84, &Awaited::always()).unwrap();
        }
    }

    #[test]
    fn a_region_without_sea_says_so() {
        assert!(notes("5,20,10,25")[0].contains("no sea"));
    }
}
