//! Rings cut at a line of longitude or latitude, and brought into the longitudes of the world.

/// Westernmost and easternmost longitude of the world, degrees.
pub(super) const WORLD_DEG: [f64; 2] = [-180.0, 180.0];
/// Turns by which rings are moved that may lie some turns off.
pub(super) const TURNS_DEG: [f64; 5] = [-720.0, -360.0, 0.0, 360.0, 720.0];

/// West, south, east, north of some corners, degrees.
pub(super) fn bounds_deg<'a>(corners: impl IntoIterator<Item = &'a [f64; 2]>) -> [f64; 4] {
    let none = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    corners.into_iter().fold(none, |[w, s, e, n], &[lon, lat]| {
        [w.min(lon), s.min(lat), e.max(lon), n.max(lat)]
    })
}

/// The parts of a ring that lie in the world when it is moved by whole turns.
pub(super) fn into_the_world(corners: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let [first, last] = WORLD_DEG;
    let [west, _, east, _] = bounds_deg(corners);
    let mut parts = vec![];
    for turn in TURNS_DEG {
        if west + turn < last && east + turn > first {
            let moved: Vec<_> = corners
                .iter()
                .map(|&[lon, lat]| [lon + turn, lat])
                .collect();
            parts.push(inside(moved, [first, -90.0, last, 90.0]));
        }
    }
    parts.retain(|part| part.len() >= 3);
    parts
}

/// The part of a ring within bounds (Sutherland and Hodgman 1974, doi:10.1145/360767.360802). Parts that fall apart stay
/// joined along the bounds, there and back, so that what it goes round stays the same.
pub(super) fn inside(corners: Vec<[f64; 2]>, bounds_deg: [f64; 4]) -> Vec<[f64; 2]> {
    let [west, south, east, north] = bounds_deg;
    let halves = [
        (0, west, 1.0),
        (0, east, -1.0),
        (1, south, 1.0),
        (1, north, -1.0),
    ];
    halves.into_iter().fold(corners, |corners, half| {
        let (axis, limit_deg, sign) = half;
        cut(&corners, axis, limit_deg, sign)
    })
}

/// What lies above a limit on an axis (0 longitude, 1 latitude), or below it if `sign` is negative.
fn cut(corners: &[[f64; 2]], axis: usize, limit_deg: f64, sign: f64) -> Vec<[f64; 2]> {
    let above = |corner: &[f64; 2]| (corner[axis] - limit_deg) * sign >= 0.0;
    if corners.iter().all(above) {
        return corners.to_vec();
    }
    let mut kept = Vec::with_capacity(corners.len() + 2);
    let next = corners.iter().cycle().skip(1);
    for (from, to) in corners.iter().zip(next) {
        if above(from) {
            kept.push(*from);
        }
        if above(from) != above(to) {
            let other = 1 - axis;
            let share = (limit_deg - from[axis]) / (to[axis] - from[axis]);
            let mut at = [limit_deg; 2];
            at[other] = from[other] + (to[other] - from[other]) * share;
            kept.push(at);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_past_the_date_line_falls_into_two() {
        let ring = [[170.0, 0.0], [190.0, 0.0], [190.0, 10.0], [170.0, 10.0]];
        let bounds: Vec<_> = into_the_world(&ring).iter().map(bounds_deg).collect();
        assert_eq!(
            bounds,
            [[-180.0, 0.0, -170.0, 10.0], [170.0, 0.0, 180.0, 10.0]]
        );
    }

    #[test]
    fn a_ring_within_the_world_stays_as_it_is() {
        let ring = vec![[-180.0, 0.0], [180.0, 0.0], [3.3, 77.7]];
        assert_eq!(into_the_world(&ring), [ring]);
    }

    #[test]
    fn nothing_is_left_beyond_the_bounds() {
        let triangle = vec![[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]];
        let bounds = [-1.0, 2.0, 4.0, 5.0];
        let part = inside(triangle, bounds);
        assert_eq!(
            bounds_deg(&part).map(f64::to_bits),
            [0.0, 2.0, 4.0, 5.0].map(f64::to_bits)
        );
        assert!(inside(part, [20.0, 20.0, 30.0, 30.0]).is_empty());
    }
}
