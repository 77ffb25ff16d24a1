//! What is a ring, what it holds, and what is refused.

use super::*;
use crate::region::area::integral_m2;

fn region(corners: &[[f64; 2]]) -> Region {
    Region::Polygons(vec![Polygon {
        outer: corners.to_vec(),
        holes: vec![],
    }])
}

fn area(corners: &[[f64; 2]]) -> f64 {
    let rings = rings(&region(corners)).unwrap();
    rings
        .iter()
        .map(|ring| signed_area_m2(ring, Earth::Wgs84))
        .sum()
}

fn box_area(south: f64, north: f64, width: f64) -> f64 {
    Earth::Wgs84.cell_area_m2(south, north, width)
}

fn rectangle(west: f64, south: f64, east: f64, north: f64) -> [[f64; 2]; 4] {
    [[west, south], [east, south], [east, north], [west, north]]
}

#[test]
fn a_rectangle_is_as_wide_as_it_is_written() {
    for (west, east) in [
        (-100.0, 100.0),
        (170.0, 190.0),
        (-179.0, 179.0),
        (-180.0, 180.0),
        (0.0, 360.0),
        (-190.0, 10.0),
    ] {
        let corners = rectangle(west, -10.0, east, 10.0);
        let expected = box_area(-10.0, 10.0, east - west);
        let backwards: Vec<_> = corners.into_iter().rev().collect();
        assert!((area(&corners) / expected - 1.0).abs() < 1e-12, "{west}");
        assert!((area(&backwards) / expected - 1.0).abs() < 1e-12, "{west}");
    }
}

#[test]
fn half_the_world_as_four_corners_is_half_the_world() {
    let half = area(&rectangle(0.0, -90.0, 180.0, 90.0));
    assert!((half / box_area(-90.0, 90.0, 180.0) - 1.0).abs() < 1e-12);
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
        .map(|pair| integral_m2(Earth::Wgs84, pair[0], pair[1], 0.0))
        .sum();
    let south = Earth::Wgs84.zone_area_m2_per_rad((-90f64).to_radians()) * 360f64.to_radians();
    assert!((area(&corners) / (sector - south) - 1.0).abs() < 1e-12);
}

#[test]
fn a_ring_round_a_pole_along_one_parallel_has_no_area_and_is_told_what_to_do() {
    let corners: Vec<_> = (0..36)
        .map(|i| [f64::from(i * 10) - 175.0, -62.0])
        .collect();
    let error = rings(&region(&corners)).unwrap_err().to_string();
    assert!(
        error.contains("no area") && error.contains("pole"),
        "{error}"
    );
}

#[test]
fn what_is_no_ring_is_refused_with_a_reason() {
    let refused = |corners: &[[f64; 2]]| rings(&region(corners)).unwrap_err().to_string();
    assert!(refused(&[]).contains("fewer than three"));
    assert!(refused(&[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]).contains("fewer than three"));
    assert!(refused(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("no area"));
    let swapped = refused(&[[0.0, 0.0], [1.0, 100.0], [2.0, 2.0]]);
    assert!(
        swapped.contains("no longitude, latitude") && swapped.contains("longitude comes first")
    );
    assert!(refused(&[[f64::NAN, 0.0], [1.0, 1.0], [2.0, 2.0]]).contains("no longitude, latitude"));
    assert!(refused(&[[-190.0, 0.0], [190.0, 1.0], [2.0, 2.0]]).contains("380 degrees wide"));
    assert!(rings(&Region::Polygons(vec![])).is_err());
    let crowd = vec![[0.0, 0.0]; MAX_CORNERS + 1];
    assert!(refused(&crowd).contains("at most"));
}
