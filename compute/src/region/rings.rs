//! Rings of a region's polygons: corners checked, unwrapped across the date line, closed round poles, turned.

use contract::region::{MAX_CORNERS, Polygon};

use super::area::signed_area_m2;
use crate::ComputeError;
use contract::earth::Earth;

/// Slack when angles are compared, degrees: a tenth of a millimetre.
const SLACK_DEG: f64 = 1e-9;

/// A closed ring: corners `[lon, lat]` in degrees, longitudes going on past 180, the first not repeated at the end.
/// Outer rings run against the clock, holes with it, so that signed areas add up.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    corners: Vec<[f64; 2]>,
}

impl Ring {
    /// Edges as pairs of corners.
    pub(super) fn edges(&self) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(&from, &to)| [from, to])
    }

    /// Westernmost and easternmost longitude.
    pub(super) fn lon_range_deg(&self) -> (f64, f64) {
        let lons = || self.corners.iter().map(|corner| corner[0]);
        (
            lons().fold(f64::INFINITY, f64::min),
            lons().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

/// The rings of some polygons.
///
/// Two neighbouring corners more than 180 but less than 360 degrees apart are joined the short way, across the date
/// line; exactly 360 degrees apart they are joined along the parallel, as maps of the whole world do. A ring that goes
/// once round the earth holds the pole of the hemisphere that its corners' mean latitude lies in.
///
/// # Errors
/// No corner, corners that are no places, more than a million of them, or a ring that goes round more than once, is
/// wider than the earth or has no area.
pub(super) fn rings(polygons: &[Polygon]) -> Result<Vec<Ring>, ComputeError> {
    let all = || {
        polygons
            .iter()
            .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes))
    };
    let corner_count: usize = all().map(Vec::len).sum();
    if corner_count > MAX_CORNERS {
        return Err(bad(format!(
            "{corner_count} corners, at most {MAX_CORNERS} are taken; simplify it"
        )));
    }
    if polygons.is_empty() {
        return Err(bad("it has no polygon"));
    }
    let mut rings = vec![];
    for polygon in polygons {
        rings.push(ring(&polygon.outer, true)?);
        for hole in &polygon.holes {
            rings.push(ring(hole, false)?);
        }
    }
    Ok(rings)
}

fn ring(corners: &[[f64; 2]], against_the_clock: bool) -> Result<Ring, ComputeError> {
    let (mut corners, turns) = unwrapped(corners)?;
    close_round_pole(&mut corners, turns)?;
    let mut ring = Ring { corners };
    let (west, east) = ring.lon_range_deg();
    if east - west > 360.0 + SLACK_DEG {
        return Err(bad(format!("a ring is {} degrees wide", east - west)));
    }
    let area_m2 = signed_area_m2(&ring, Earth::Sphere);
    if area_m2.abs() < 1e-3 {
        return Err(bad("a ring has no area"));
    }
    if (area_m2 > 0.0) != against_the_clock {
        ring.corners.reverse();
    }
    Ok(ring)
}

/// Corners with longitudes that go on past 180, and how many turns east of its start the ring comes back. A repeated
/// last corner is dropped.
fn unwrapped(corners: &[[f64; 2]]) -> Result<(Vec<[f64; 2]>, f64), ComputeError> {
    let place = |corner: &&[f64; 2]| {
        let [lon, lat] = **corner;
        lon.is_finite() && lat.is_finite() && lon.abs() <= 720.0 && lat.abs() <= 90.0 + SLACK_DEG
    };
    if let Some(corner) = corners.iter().find(|corner| !place(corner)) {
        return Err(bad(format!(
            "{corner:?} is no longitude, latitude in degrees"
        )));
    }
    let repeated = corners.len() > 1 && corners.first() == corners.last();
    let corners = &corners[..corners.len() - usize::from(repeated)];
    if corners.len() < 3 {
        return Err(bad("a ring has fewer than three corners"));
    }
    let mut out: Vec<[f64; 2]> = Vec::with_capacity(corners.len() + 3);
    let mut turns = 0.0;
    for (i, &[lon, lat]) in corners.iter().enumerate() {
        turns += corners[..i]
            .last()
            .map_or(0.0, |before| turns_between(before[0], lon));
        out.push([lon + 360.0 * turns, lat.clamp(-90.0, 90.0)]);
    }
    Ok((
        out,
        turns + turns_between(corners[corners.len() - 1][0], corners[0][0]),
    ))
}

/// Whole turns to add to the second of two neighbouring longitudes so that the edge between them goes the short way;
/// none where they are just a turn apart.
fn turns_between(from: f64, to: f64) -> f64 {
    let east = to - from;
    let stays = east.abs() <= 180.0 + SLACK_DEG || (east.abs() - 360.0).abs() < SLACK_DEG;
    if stays { 0.0 } else { -(east / 360.0).round() }
}

/// A ring that comes back some whole turns away is led over the pole.
fn close_round_pole(corners: &mut Vec<[f64; 2]>, turns: f64) -> Result<(), ComputeError> {
    if turns == 0.0 {
        return Ok(());
    }
    if turns.abs() > 1.5 {
        return Err(bad("a ring goes round the earth more than once"));
    }
    let [lon, lat] = corners[0];
    let mean_lat = corners.iter().map(|corner| corner[1]).sum::<f64>() / corners.len() as f64;
    let pole = 90f64.copysign(mean_lat);
    corners.push([lon + 360.0 * turns, lat]);
    corners.push([lon + 360.0 * turns, pole]);
    corners.push([lon, pole]);
    Ok(())
}

pub(super) fn bad(reason: impl Into<String>) -> ComputeError {
    ComputeError::Region {
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outer(corners: &[[f64; 2]]) -> Result<Vec<Ring>, ComputeError> {
        rings(&[Polygon {
            outer: corners.to_vec(),
            holes: vec![],
        }])
    }

    fn area(corners: &[[f64; 2]]) -> f64 {
        signed_area_m2(&outer(corners).unwrap()[0], Earth::Wgs84)
    }

    #[test]
    fn a_ring_may_pass_180_or_jump_across_it() {
        let passing = area(&[[170.0, -10.0], [190.0, -10.0], [190.0, 10.0], [170.0, 10.0]]);
        let jumping = area(&[
            [170.0, -10.0],
            [-170.0, -10.0],
            [-170.0, 10.0],
            [170.0, 10.0],
            [170.0, -10.0],
        ]);
        let expected = Earth::Wgs84.cell_area_m2(-10.0, 10.0, 20.0);
        assert!((passing / expected - 1.0).abs() < 1e-12);
        assert!((jumping / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn half_the_world_as_four_corners_is_half_the_world() {
        let half = area(&[[0.0, -90.0], [180.0, -90.0], [180.0, 90.0], [0.0, 90.0]]);
        assert!((half / Earth::Wgs84.cell_area_m2(-90.0, 90.0, 180.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_whole_world_as_four_corners_is_the_whole_world() {
        let world = area(&[
            [-180.0, -90.0],
            [180.0, -90.0],
            [180.0, 90.0],
            [-180.0, 90.0],
            [-180.0, -90.0],
        ]);
        assert!((world / Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_ring_round_a_pole_holds_it_in_either_direction() {
        let mut corners: Vec<_> = (0..36)
            .map(|i| [f64::from(i * 10) - 175.0, -62.0])
            .collect();
        let expected = Earth::Wgs84.cell_area_m2(-90.0, -62.0, 360.0);
        assert!((area(&corners) / expected - 1.0).abs() < 1e-12);
        corners.reverse();
        assert!((area(&corners) / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn antarctica_as_natural_earth_draws_it_is_planar() {
        // Its ring runs along the coast at 180 E, down to the pole, back along the pole and up at 180 W.
        let corners = [
            [-180.0, -84.0],
            [-90.0, -70.0],
            [0.0, -70.0],
            [90.0, -66.0],
            [180.0, -84.0],
            [180.0, -90.0],
            [-180.0, -90.0],
        ];
        let sector: f64 = corners[..5]
            .windows(2)
            .map(|pair| super::super::area::integral_m2(Earth::Wgs84, pair[0], pair[1], 0.0))
            .sum();
        let south = Earth::Wgs84.zone_area_m2_per_rad((-90f64).to_radians()) * 360f64.to_radians();
        assert!((area(&corners) / (sector - south) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_ring_is_refused_with_a_reason() {
        let refused = |corners: &[[f64; 2]]| outer(corners).unwrap_err().to_string();
        assert!(refused(&[]).contains("fewer than three"));
        assert!(refused(&[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]).contains("fewer than three"));
        assert!(refused(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("no area"));
        assert!(
            refused(&[[0.0, 0.0], [1.0, 100.0], [2.0, 2.0]]).contains("no longitude, latitude")
        );
        assert!(
            refused(&[[f64::NAN, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("no longitude, latitude")
        );
        assert!(rings(&[]).is_err());
        let crowd = vec![[0.0, 0.0]; MAX_CORNERS + 1];
        assert!(refused(&crowd).contains("at most"));
    }
}
