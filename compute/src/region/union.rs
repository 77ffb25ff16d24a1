//! Polygons made one region: what crosses, overlaps or repeats is counted once; what does not keeps its corners.

use contract::earth::Earth;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree, RTreeObject as _};

use super::area::signed_area_m2;
use super::cut::{WORLD_DEG, bounds_deg, into_the_world};
use super::lattice::{Lattice, difference, edges, straightened};
use super::ring::{Checked, Ring};
use crate::ComputeError;
use crate::awaited::Awaited;

/// The rings of the union of polygons.
///
/// Polygons whose bounds meet are overlaid together, on a lattice as fine as they are small. Where the overlay changes
/// no edge, the rings are taken as they were written, bit for bit.
///
/// # Errors
/// `Region` where edges are too many and too long; `NotAwaited`, asked before each overlay.
pub(super) fn united(polygons: &[Checked], awaited: &Awaited) -> Result<Vec<Ring>, ComputeError> {
    let mut rings = vec![];
    for group in groups(polygons) {
        awaited.check()?;
        let group: Vec<&Checked> = group.into_iter().map(|index| &polygons[index]).collect();
        let [west, _, east, _] =
            bounds_deg(group.iter().flat_map(|polygon| polygon.rings().flatten()));
        if east - west > 360.0 {
            // Parts may meet a turn apart: all are brought into the same longitudes.
            let cut: Vec<_> = group.iter().map(|polygon| in_the_world(polygon)).collect();
            rings.extend(overlaid(&cut, None, awaited)?);
        } else {
            let parts: Vec<_> = group
                .iter()
                .map(|polygon| Parts {
                    outers: vec![polygon.outer.clone()],
                    holes: polygon.holes.clone(),
                })
                .collect();
            rings.extend(overlaid(&parts, Some(&group), awaited)?);
        }
    }
    Ok(rings)
}

/// Step of the coarsest lattice that [`united`] brings corners to, of all polygons together or of any of them, degrees.
pub(super) fn coarsest_step_deg<'a>(corners: impl IntoIterator<Item = &'a [f64; 2]>) -> f64 {
    let [mut west, south, mut east, north] = bounds_deg(corners);
    if east - west > 360.0 {
        [west, east] = WORLD_DEG;
    }
    Lattice::over([west, south, east, north]).step_deg()
}

/// A polygon, perhaps in several parts: what outer rings go round less what holes go round.
struct Parts {
    outers: Vec<Vec<[f64; 2]>>,
    holes: Vec<Vec<[f64; 2]>>,
}

fn in_the_world(polygon: &Checked) -> Parts {
    Parts {
        outers: into_the_world(&polygon.outer),
        holes: polygon
            .holes
            .iter()
            .flat_map(|hole| into_the_world(hole))
            .collect(),
    }
}

/// The union of polygons in one plane; `as_written` are they as rings, if they may be kept.
fn overlaid(
    polygons: &[Parts],
    as_written: Option<&[&Checked]>,
    awaited: &Awaited,
) -> Result<Vec<Ring>, ComputeError> {
    let corners = polygons
        .iter()
        .flat_map(|polygon| polygon.outers.iter().chain(&polygon.holes).flatten());
    let lattice = Lattice::over(bounds_deg(corners));
    let (mut given, mut shapes) = (vec![], vec![]);
    for polygon in polygons {
        awaited.check()?;
        let contours =
            |rings: &[Vec<[f64; 2]>]| rings.iter().map(|ring| lattice.contour(ring)).collect();
        let (outers, holes): (Vec<_>, Vec<_>) =
            (contours(&polygon.outers), contours(&polygon.holes));
        shapes.extend(difference(&outers, &holes)?);
        given.extend(outers.iter().chain(&holes).map(straightened));
    }
    awaited.check()?;
    if polygons.len() > 1 {
        let contours: Vec<_> = shapes.into_iter().flatten().collect();
        shapes = difference(&contours, &[])?;
    }
    Ok(match as_written {
        Some(polygons) if edges(given.iter()) == edges(shapes.iter().flatten()) => {
            let rings = |polygon: &&Checked| {
                let outer = turned(polygon.outer.clone(), true);
                let holes = polygon.holes.iter().cloned();
                std::iter::once(outer)
                    .chain(holes.map(|hole| turned(hole, false)))
                    .collect::<Vec<_>>()
            };
            polygons.iter().flat_map(rings).collect()
        }
        _ => lattice.rings(&shapes),
    })
}

/// A ring that runs against the clock, or with it.
fn turned(mut corners: Vec<[f64; 2]>, against_the_clock: bool) -> Ring {
    let ring = Ring::new(corners.clone());
    if (signed_area_m2(&ring, Earth::Sphere) > 0.0) != against_the_clock {
        corners.reverse();
    }
    Ring::new(corners)
}

/// Polygons in groups whose bounds meet, also some turns apart: the numbers of those that [`united`] overlays together.
pub(super) fn groups(polygons: &[Checked]) -> Vec<Vec<usize>> {
    let bounds = |polygon: &Checked| {
        let [west, south, east, north] = bounds_deg(polygon.rings().flatten());
        Rectangle::from_corners([west, south], [east, north])
    };
    let bounds: Vec<_> = polygons.iter().map(bounds).collect();
    let indexed = bounds.iter().enumerate();
    let mut tree = RTree::bulk_load(indexed.map(|(i, b)| GeomWithData::new(*b, i)).collect());
    let mut is_grouped = vec![false; polygons.len()];
    let mut groups = vec![];
    for first in 0..polygons.len() {
        if is_grouped[first] {
            continue;
        }
        // Its own bounds find it first.
        let (mut group, mut waiting) = (vec![], vec![first]);
        while let Some(next) = waiting.pop() {
            for turn in -4..=4 {
                let turned = moved(&bounds[next].envelope(), 360.0 * f64::from(turn));
                for met in tree.drain_in_envelope_intersecting(turned) {
                    is_grouped[met.data] = true;
                    group.push(met.data);
                    waiting.push(met.data);
                }
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

fn moved(envelope: &AABB<[f64; 2]>, turn_deg: f64) -> AABB<[f64; 2]> {
    let corner = |[lon, lat]: [f64; 2]| [lon + turn_deg, lat];
    AABB::from_corners(corner(envelope.lower()), corner(envelope.upper()))
}

#[cfg(test)]
mod tests;
