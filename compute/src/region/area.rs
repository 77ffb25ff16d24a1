//! Areas inside rings, and the integrals along edges that they are made of.

use contract::earth::Earth;

use super::ring::Ring;

/// Widest span of latitude that one quadrature takes, degrees.
const SPAN_DEG: f64 = 5.0;

/// Area inside a ring, m²: positive if its corners run against the clock. By Green's theorem it is the integral of
/// longitude over the zone function along the ring, or minus that of the zone function over longitude.
pub(super) fn signed_area_m2(ring: &Ring, earth: Earth) -> f64 {
    -ring
        .edges()
        .map(|[from, to]| integral_m2(earth, from, to, 0.0))
        .sum::<f64>()
}

/// Integral of (zone area - `base`) over longitude along a straight edge, m².
///
/// `from` and `to` are `[lon, lat]` in degrees, `base` is a zone area in m² per radian. Five-point Gauss-Legendre on
/// pieces of at most 5 degrees of latitude: the integrand is analytic with derivatives of the size of the earth's
/// radius squared, so that the relative error of a piece is below 1e-15 and rounding is what remains.
pub(super) fn integral_m2(earth: Earth, from: [f64; 2], to: [f64; 2], base: f64) -> f64 {
    /// Abscissas and weights on [-1, 1]: Abramowitz & Stegun (1964), table 25.4, n = 5.
    const POINTS: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683, 0.478_628_670_499_366_47),
        (-0.538_469_310_105_683, 0.478_628_670_499_366_47),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let width_rad = (to[0] - from[0]).to_radians();
    if width_rad == 0.0 {
        return 0.0;
    }
    let pieces = ((to[1] - from[1]).abs() / SPAN_DEG).ceil().max(1.0);
    let step_deg = (to[1] - from[1]) / pieces;
    let mut mean = 0.0;
    for piece in 0..pieces as u32 {
        let middle_deg = from[1] + step_deg * (f64::from(piece) + 0.5);
        for (x, weight) in POINTS {
            let lat_rad = (middle_deg + 0.5 * step_deg * x).to_radians();
            mean += 0.5 * weight * (earth.zone_area_m2_per_rad(lat_rad) - base);
        }
    }
    width_rad * mean / pieces
}

#[cfg(test)]
mod tests {
    use contract::region::{Polygon, Region};

    use super::*;
    use crate::region::extent::region_area_m2;

    fn polygon(corners: &[[f64; 2]]) -> Region {
        Region::Polygons(vec![Polygon {
            outer: corners.to_vec(),
            holes: vec![],
        }])
    }

    #[test]
    fn a_polygon_that_is_a_box_has_the_area_of_the_box() {
        let square = polygon(&[[10.0, -20.0], [40.0, -20.0], [40.0, 55.0], [10.0, 55.0]]);
        for earth in [Earth::Wgs84, Earth::Sphere] {
            let area = region_area_m2(&square, earth).unwrap();
            assert!((area / earth.cell_area_m2(-20.0, 55.0, 30.0) - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn a_triangle_on_the_sphere_has_its_closed_form() {
        // Between latitude 0 and 60 at 0 E and the corner 30 E, 0 N the width shrinks linearly with latitude:
        // area = R^2 * integral of (30 deg) (1 - phi / 60 deg) cos(phi) = R^2 (pi/6) (1 - cos(pi/3)) / (pi/3) = R^2 / 4.
        let triangle = polygon(&[[0.0, 0.0], [30.0, 0.0], [0.0, 60.0]]);
        let area = region_area_m2(&triangle, Earth::Sphere).unwrap();
        let expected = 6_371_000.0f64.powi(2) / 4.0;
        assert!((area / expected - 1.0).abs() < 1e-14, "{area} {expected}");
    }

    #[test]
    fn the_direction_of_a_ring_does_not_matter_and_holes_are_taken_out() {
        let outer = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let mut backwards = outer;
        backwards.reverse();
        let hole = vec![[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]];
        let area = |outer: [[f64; 2]; 4]| {
            let region = Region::Polygons(vec![Polygon {
                outer: outer.to_vec(),
                holes: vec![hole.clone()],
            }]);
            region_area_m2(&region, Earth::Wgs84).unwrap()
        };
        let expected =
            Earth::Wgs84.cell_area_m2(0.0, 10.0, 10.0) - Earth::Wgs84.cell_area_m2(2.0, 4.0, 2.0);
        assert!((area(outer) / expected - 1.0).abs() < 1e-13);
        assert!((area(backwards) / expected - 1.0).abs() < 1e-13);
    }
}
