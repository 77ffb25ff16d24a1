//! Every place counts once; what needs no repair is not touched.

use contract::earth::Earth;
use contract::region::{Polygon, Region};

use crate::region::extent::region_area_m2;
use crate::region::ring::Ring;
use crate::region::rings::rings;

type Corners = Vec<[f64; 2]>;

fn square(west: f64, south: f64, size: f64) -> Corners {
    let (east, north) = (west + size, south + size);
    vec![[west, south], [east, south], [east, north], [west, north]]
}

fn region(polygons: &[(Corners, Vec<Corners>)]) -> Region {
    let polygon = |(outer, holes): &(Corners, Vec<Corners>)| Polygon {
        outer: outer.clone(),
        holes: holes.clone(),
    };
    Region::Polygons(polygons.iter().map(polygon).collect())
}

fn area(polygons: &[(Corners, Vec<Corners>)]) -> f64 {
    region_area_m2(&region(polygons), Earth::Wgs84).unwrap()
}

fn assert_close(a: f64, b: f64) {
    assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
}

#[test]
fn what_repeats_counts_once() {
    let one = (square(0.25, 0.25, 0.5), vec![]);
    assert_close(
        area(&[one.clone(), one.clone()]),
        area(std::slice::from_ref(&one)),
    );
    let backwards = (one.0.iter().rev().copied().collect(), vec![]);
    assert_close(
        area(&[one.clone(), backwards]),
        area(std::slice::from_ref(&one)),
    );
    // A ring that goes round twice, and one whose corners are doubled.
    let twice = [one.0.clone(), one.0.clone()].concat();
    assert_close(area(&[(twice, vec![])]), area(std::slice::from_ref(&one)));
    let doubled = one.0.iter().flat_map(|corner| [*corner; 2]).collect();
    assert_close(area(&[(doubled, vec![])]), area(&[one]));
}

#[test]
fn corners_in_the_middle_of_edges_are_kept_as_they_are_written() {
    let mut outer = square(0.1, 0.2, 0.7);
    outer.insert(1, [0.3, 0.2]);
    outer.push([0.1, 0.5]);
    let hole: Corners = square(0.3, 0.4, 0.1).into_iter().rev().collect();
    let found = rings(&region(&[(outer.clone(), vec![hole.clone()])])).unwrap();
    let corners: Vec<&[[f64; 2]]> = found.iter().map(Ring::corners).collect();
    assert_eq!(corners, [&outer[..], &hole[..]]);
}

#[test]
fn what_overlaps_counts_once_also_a_turn_apart() {
    let boxes = |a: Corners, b: Corners| area(&[(a, vec![]), (b, vec![])]);
    let strip = |width: f64| Earth::Wgs84.cell_area_m2(0.0, 10.0, width);
    assert_close(
        boxes(square(0.0, 0.0, 10.0), square(5.0, 0.0, 10.0)),
        strip(15.0),
    );
    assert_close(
        boxes(square(175.0, 0.0, 10.0), square(-180.0, 0.0, 10.0)),
        strip(15.0),
    );
    assert_close(
        boxes(square(181.0, 0.0, 10.0), square(-179.0, 0.0, 10.0)),
        strip(10.0),
    );
    assert_close(
        boxes(square(-185.0, 0.0, 10.0), square(175.0, 0.0, 10.0)),
        strip(10.0),
    );
    // Neighbours that share an edge across the date line.
    assert_close(
        boxes(square(170.0, 0.0, 10.0), square(-180.0, 0.0, 10.0)),
        strip(20.0),
    );
}

#[test]
fn both_lobes_of_a_bow_tie_and_the_middle_of_a_star_are_inside() {
    let bow_tie = vec![[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]];
    let lobes = [
        vec![[0.0, 0.0], [5.0, 5.0], [0.0, 10.0]],
        vec![[10.0, 0.0], [10.0, 10.0], [5.0, 5.0]],
    ];
    let apart: f64 = lobes.into_iter().map(|lobe| area(&[(lobe, vec![])])).sum();
    assert_close(area(&[(bow_tie, vec![])]), apart);
    let corner = |i: usize| {
        let angle = i as f64 * 0.8 * std::f64::consts::PI;
        [10.0 * angle.cos(), 10.0 * angle.sin()]
    };
    let star: Corners = (0..5).map(corner).collect();
    // Five triangles from the middle hold all of it but count nothing twice.
    let inner =
        10.0 * (0.2 * std::f64::consts::PI).cos().recip() * (0.4 * std::f64::consts::PI).cos();
    let outline: Corners = (0..10)
        .map(|i| {
            let angle = f64::from(i) * 0.2 * std::f64::consts::PI;
            let radius = if i % 2 == 0 { 10.0 } else { inner };
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect();
    assert_close(area(&[(star, vec![])]), area(&[(outline, vec![])]));
}

#[test]
fn holes_are_taken_out_once_and_only_of_their_own_polygon() {
    let outer = || square(0.0, 0.0, 10.0);
    let hole = || square(2.0, 2.0, 4.0);
    let ring = area(&[(outer(), vec![])]) - area(&[(hole(), vec![])]);
    assert_close(area(&[(outer(), vec![hole()])]), ring);
    assert_close(area(&[(outer(), vec![hole(), hole()])]), ring);
    // A hole outside of its ring takes nothing, one half outside its inner half.
    assert_close(
        area(&[(outer(), vec![square(20.0, 0.0, 5.0)])]),
        area(&[(outer(), vec![])]),
    );
    let half = Earth::Wgs84.cell_area_m2(2.0, 6.0, 2.0);
    assert_close(
        area(&[(outer(), vec![square(-2.0, 2.0, 4.0)])]),
        area(&[(outer(), vec![])]) - half,
    );
    // Another polygon in the hole counts, and a hole a turn away from its ring is its hole.
    assert_close(
        area(&[(outer(), vec![hole()]), (hole(), vec![])]),
        area(&[(outer(), vec![])]),
    );
    let past = area(&[(square(175.0, 0.0, 10.0), vec![square(-179.0, 2.0, 4.0)])]);
    assert_close(past, ring);
}

#[test]
fn rings_that_need_no_repair_keep_their_corners() {
    let odd = vec![[0.1, 0.2], [7.7, 0.3], [5.1, 9.9]];
    let hole = vec![[4.0, 2.0], [4.3, 2.1], [4.1, 3.3]];
    let far = vec![[170.3, -10.1], [190.7, -10.2], [180.0, 3.1]];
    let rings = rings(&region(&[
        (odd.clone(), vec![hole.clone()]),
        (far.clone(), vec![]),
    ]))
    .unwrap();
    let corners: Vec<_> = rings.iter().map(|ring| ring.corners().to_vec()).collect();
    let backwards: Corners = hole.into_iter().rev().collect();
    assert_eq!(corners, [odd, backwards, far]);
}

#[test]
fn tiny_polygons_keep_their_size_beside_large_ones() {
    let tiny = square(33.333_333, 44.444_444, 1e-4);
    let own = area(&[(tiny.clone(), vec![])]);
    let large = area(&[(square(-60.0, -30.0, 40.0), vec![])]);
    let repeated = |corners: &Corners| vec![(corners.clone(), vec![]), (corners.clone(), vec![])];
    let mut all = repeated(&square(-60.0, -30.0, 40.0));
    all.extend(repeated(&tiny));
    assert!(((area(&all) - large) / own - 1.0).abs() < 1e-3);
    assert!((area(&repeated(&tiny)) / own - 1.0).abs() < 1e-6);
}
