#![expect(clippy::float_cmp, reason = "these values are exact")]

use super::*;

#[test]
fn multiples_lie_between_two_numbers_and_once_all_round() {
    let of = |step, from, to| multiples(step, from, to).collect::<Vec<_>>();
    assert_eq!(of(10.0, -12.0, 21.0), [-10.0, 0.0, 10.0, 20.0]);
    assert_eq!(of(90.0, -180.0, 180.0), [-180.0, -90.0, 0.0, 90.0]);
    assert_eq!(of(45.0, 0.0, 30.0), [0.0]);
    assert!(of(90.0, 10.0, 80.0).is_empty());
}

#[test]
fn round_a_pole_all_meridians_are_seen() {
    let cap = |lat, angle| Cap {
        lon: 0.0,
        lat,
        angle,
    };
    assert_eq!(cap(80.0, 20.0).half_width(), 180.0);
    assert!((cap(0.0, 30.0).half_width() - 30.0).abs() < 1e-9);
    assert!(cap(60.0, 20.0).half_width() > 40.0);
}
