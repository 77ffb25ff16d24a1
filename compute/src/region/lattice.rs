//! Rings on a lattice of integers, where they are overlaid without rounding (`i_overlay`).

use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::{IntOverlayOptions, Overlay};
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::solver::Solver;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::{IntContour, IntShapes};

use super::ring::Ring;
use crate::ComputeError;

/// Largest coordinate, as a power of two: what the library leaves room for in its products of 64 bits.
const COORDINATE_BITS: i32 = 30;
/// Finest lattice, as a power of two of points in a degree: doubles at 720 degrees are no finer.
const FINEST_BITS: i32 = 42;
/// Edges beyond which the library cuts them at lines of longitude.
const MOST_UNCUT: usize = 16_000;
/// Most pieces that edges are cut into, of 40 bytes each, which the library holds all at once.
const MOST_PIECES: f64 = 16e6;
/// Most pairs of edges that are looked at one by one: some ten seconds.
const MOST_PAIRS: f64 = 1e10;
/// Edges of which every pair is looked at, to know of how many of all that would be.
const SAMPLE: usize = 8192;
/// Steps of the lattice that take as long as it takes to see whether two edges cross.
const STEPS_A_PAIR: f64 = 4.0;

/// Points that are a power of two apart, so that whole and half degrees lie on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    origin_deg: [f64; 2],
    points_per_deg: f64,
}

impl Lattice {
    /// The finest lattice that holds west, south, east, north: 2 to 4 parts in 10⁹ of the wider side.
    pub(super) fn over([west, south, east, north]: [f64; 4]) -> Self {
        let half_deg = (0.5 * (east - west).max(north - south)).max(f64::MIN_POSITIVE);
        // A bit is left for the origin, which is a point of the lattice and so not quite in the middle.
        let bits = COORDINATE_BITS - 1 - half_deg.log2().floor() as i32;
        let points_per_deg = f64::from(bits.min(FINEST_BITS)).exp2();
        let on_lattice = |deg: f64| (deg * points_per_deg).round() / points_per_deg;
        let origin_deg = [0.5 * (west + east), 0.5 * (south + north)].map(on_lattice);
        Self {
            origin_deg,
            points_per_deg,
        }
    }

    /// How far its points are apart, degrees.
    pub(super) fn step_deg(&self) -> f64 {
        self.points_per_deg.recip()
    }

    /// The nearest points of a ring's corners.
    pub(super) fn contour(&self, corners: &[[f64; 2]]) -> IntContour {
        let number = |deg: f64, origin: f64| ((deg - origin) * self.points_per_deg).round() as i32;
        let [lon, lat] = self.origin_deg;
        corners
            .iter()
            .map(|corner| IntPoint::new(number(corner[0], lon), number(corner[1], lat)))
            .collect()
    }

    /// The rings of shapes: outer ones against the clock, holes with it.
    pub(super) fn rings(&self, shapes: &IntShapes) -> Vec<Ring> {
        let deg = |number: i32, origin: f64| f64::from(number) / self.points_per_deg + origin;
        let [lon, lat] = self.origin_deg;
        let ring = |contour: &IntContour| {
            let corners = contour
                .iter()
                .map(|point| [deg(point.x, lon), deg(point.y, lat)]);
            Ring::new(corners.collect())
        };
        shapes.iter().flatten().map(ring).collect()
    }
}

/// What the subject's rings go round, less what the others go round: shapes of an outer ring, against the clock, and
/// holes, with it. Corners in the middle of a straight line are left out ([`straightened`]).
///
/// # Errors
/// `Region` where edges are so many and so long that it would take too long.
pub(super) fn difference(
    subject: &[IntContour],
    others: &[IntContour],
) -> Result<IntShapes, ComputeError> {
    // With the corners of straight lines in it, the library (4.5.2) makes points without an end of half of all regions that have some
    // along a coast, and of others areas that are 6 % too small.
    let options = IntOverlayOptions::keep_output_points();
    let solver = solver(&[subject, others])?;
    let mut overlay = Overlay::with_contours_custom(subject, others, options, solver);
    let rule = if others.is_empty() {
        OverlayRule::Subject
    } else {
        OverlayRule::Difference
    };
    Ok(overlay.overlay(rule, FillRule::NonZero))
}

/// How the library finds what crosses.
///
/// Of very many edges it (4.5.2) cuts each at lines of longitude, and goes to the latitude of a cut by steps of the lattice, from a place that
/// is the further off the longer the edge is: of one across the world up to 2²⁷ steps a cut, which together take seconds for each such edge.
/// Where that is more work than to hold each edge against those that it meets in longitude, edges are taken as they are. So they are where they
/// are cut into very many pieces (of a million edges across the world these would take 40 GB), and where very many lie between two cuts.
///
/// # Errors
/// `Region` where neither can be done.
fn solver(contours: &[&[IntContour]]) -> Result<Solver, ComputeError> {
    let edges = || {
        let contours = contours.iter().copied().flatten();
        contours.flat_map(|contour| contour.iter().zip(contour.iter().cycle().skip(1)))
    };
    let count = edges().count();
    if count <= MOST_UNCUT {
        return Ok(Solver::default());
    }
    let ends = edges().fold([i32::MAX, i32::MIN], |[west, east], (from, _to)| {
        [west.min(from.x), east.max(from.x)]
    });
    let all_wide = f64::from(ends[0].abs_diff(ends[1])).max(1.0);
    // It has so many parts of all longitudes at most, and half of them at least.
    let parts = f64::from(count.ilog2() / 2 + 1).exp2();
    let looks = looks(edges(), count, 2.0 * all_wide / parts);
    let count = count as f64;
    let (mut steps, mut pairs, mut pieces) = (0.0, 0.0, 0.0);
    for (from, to) in edges() {
        let share = f64::from(from.x.abs_diff(to.x)) / all_wide;
        steps += steps_to_a_cut(*from, *to) as f64 * (share * count.sqrt() + 1.0);
        pairs += share * count;
        pieces += share * parts + 1.0;
    }
    let is_cut = steps <= STEPS_A_PAIR * pairs && pieces <= MOST_PIECES;
    if is_cut && looks.cut <= MOST_PAIRS {
        return Ok(Solver::default());
    }
    if looks.uncut > MOST_PAIRS {
        let reason = format!(
            "its {count} edges, and those of land in it, are so long that {:.1e} pairs of them lie in the same longitudes, and at most \
             {MOST_PAIRS:.0e} are looked at; give fewer corners, or shorter edges",
            looks.uncut
        );
        return Err(ComputeError::Region { reason });
    }
    Ok(Solver::LIST)
}

/// Pairs of edges that are looked at.
struct Looks {
    /// Of edges that are cut: those that meet in latitude and lie between the same two cuts, or nearly.
    cut: f64,
    /// Of edges as they are: those that meet in longitude.
    uncut: f64,
}

/// How many pairs of some edges are looked at, by those of a sample; none where all pairs are not too many. Cuts are so far apart at most.
fn looks<'a>(
    edges: impl Iterator<Item = (&'a IntPoint, &'a IntPoint)>,
    count: usize,
    apart: f64,
) -> Looks {
    let mut looks = Looks {
        cut: 0.0,
        uncut: 0.0,
    };
    if (count as f64).powi(2) / 2.0 <= MOST_PAIRS {
        return looks;
    }
    // An odd step comes by each side of teeth that have an even number of them.
    let step = count.div_ceil(SAMPLE) | 1;
    let bounds = |(from, to): (&IntPoint, &IntPoint)| {
        let lons = [from.x.min(to.x), from.x.max(to.x)].map(f64::from);
        (lons, [from.y.min(to.y), from.y.max(to.y)])
    };
    let some: Vec<([f64; 2], [i32; 2])> = edges.step_by(step).map(bounds).collect();
    let (mut cut, mut uncut) = (0_u64, 0_u64);
    for (at, (lons, lats)) in some.iter().enumerate() {
        for (other_lons, other_lats) in &some[at + 1..] {
            let between = (lons[0] - other_lons[1]).max(other_lons[0] - lons[1]);
            let meet_in_latitude = lats[0] <= other_lats[1] && other_lats[0] <= lats[1];
            uncut += u64::from(between <= 0.0);
            cut += u64::from(meet_in_latitude && between < apart);
        }
    }
    let of_all = (count as f64 / some.len() as f64).powi(2);
    looks.cut = cut as f64 * of_all;
    looks.uncut = uncut as f64 * of_all;
    looks
}

/// Most steps that the library takes to the latitude of one cut of an edge.
fn steps_to_a_cut(from: IntPoint, to: IntPoint) -> u64 {
    let [width, height] = [from.x.abs_diff(to.x), from.y.abs_diff(to.y)].map(u64::from);
    match (width * height).checked_ilog2() {
        Some(log) => width >> (63 - log),
        None => 0,
    }
}

/// A ring without the corners that lie on the line from the one before to the one after.
pub(super) fn straightened(contour: &IntContour) -> IntContour {
    let is_straight = |from: IntPoint, by: IntPoint, to: IntPoint| {
        let [from, by, to] = [from, by, to].map(|point| [point.x, point.y].map(i128::from));
        let [a, b] = [
            [by[0] - from[0], by[1] - from[1]],
            [to[0] - by[0], to[1] - by[1]],
        ];
        a[0] * b[1] == a[1] * b[0]
    };
    let mut kept: Vec<IntPoint> = Vec::with_capacity(contour.len());
    for point in contour {
        while let [.., from, by] = kept[..]
            && is_straight(from, by, *point)
        {
            kept.pop();
        }
        if kept.last() != Some(point) {
            kept.push(*point);
        }
    }
    // Round the first corner.
    while let [first, second, .., before, last] = kept[..] {
        if is_straight(before, last, first) {
            kept.pop();
        } else if is_straight(last, first, second) {
            kept.remove(0);
        } else {
            break;
        }
    }
    kept
}

/// Edges of rings without their direction, in order.
pub(super) fn edges<'a>(contours: impl Iterator<Item = &'a IntContour>) -> Vec<[i32; 4]> {
    let mut edges: Vec<_> = contours
        .flat_map(|contour| contour.iter().zip(contour.iter().cycle().skip(1)))
        .filter(|(from, to)| from != to)
        .map(|(from, to)| {
            let (from, to) = ([from.x, from.y], [to.x, to.y]);
            let (low, high) = (from.min(to), from.max(to));
            [low[0], low[1], high[0], high[1]]
        })
        .collect();
    edges.sort_unstable();
    edges
}

#[cfg(test)]
mod tests {
    use i_overlay::core::solver::Strategy;

    use super::*;

    fn contour(corners: &[[i32; 2]]) -> IntContour {
        let points = corners.iter().map(|&[x, y]| IntPoint::new(x, y));
        points.collect()
    }

    #[test]
    fn long_edges_are_not_cut_among_very_many_others() {
        let half = 1 << 29;
        let [diagonal, upright] = [
            [[-half, -half], [half, half], [-half, half]],
            [[-half, -half], [half, -half], [half, half]],
        ]
        .map(|corners| contour(&corners));
        let short: Vec<[i32; 2]> = (0..20_000).map(|at| [at, at % 2]).collect();
        let (coast, few) = (contour(&short), contour(&short[..100]));
        let strategy = |subject: &IntContour, other: &IntContour| {
            let [subject, other] = [subject, other].map(std::slice::from_ref);
            solver(&[subject, other]).unwrap().strategy
        };
        assert_eq!(strategy(&diagonal, &coast), Strategy::List);
        assert_eq!(strategy(&coast, &diagonal), Strategy::List);
        assert_eq!(strategy(&diagonal, &few), Strategy::Auto);
        // The last edge goes back to the first corner.
        assert_eq!(strategy(&upright, &coast), Strategy::List);
        assert_eq!(strategy(&coast, &few), Strategy::Auto);
        let level = contour(&[[-half, 0], [half, 0], [half, 9], [-half, 9]]);
        assert_eq!(strategy(&level, &coast), Strategy::Auto);
        // One in the other.
        let nested = (1..=5000_i32).map(|at| at << 16);
        let nested: Vec<_> = nested
            .map(|to| contour(&[[to, 0], [0, to], [-to, 0], [0, -to]]))
            .collect();
        let strategy = |all: &[IntContour]| solver(&[all, &[]]).unwrap().strategy;
        assert_eq!(strategy(&nested), Strategy::List);
        assert_eq!(strategy(&nested[..100]), Strategy::Auto);
    }

    #[test]
    fn edges_are_not_cut_into_more_pieces_than_can_be_held() {
        let half = 1 << 29;
        // Edges across the world, to and fro, each a step further north.
        let comb = |count: i32| {
            let corner = |at: i32| [if at % 2 == 0 { -half } else { half }, at];
            [contour(&(0..count).map(corner).collect::<Vec<_>>())]
        };
        let strategy = |all: &[IntContour]| solver(&[all, &[]]).map(|solver| solver.strategy);
        assert_eq!(strategy(&comb(20_000)).unwrap(), Strategy::Auto);
        assert_eq!(strategy(&comb(70_000)).unwrap(), Strategy::List);
        let refused = strategy(&comb(200_000)).unwrap_err();
        assert!(matches!(refused, ComputeError::Region { .. }), "{refused}");
        assert!(refused.to_string().contains("fewer corners"), "{refused}");
        // Upright teeth beside a long level edge, all of them between two cuts.
        let mut teeth: Vec<[i32; 2]> = (0..300_000).map(|at| [at, at % 2 * half]).collect();
        teeth.extend([[300_000, 0], [half, 0], [half, -1]]);
        let teeth = [contour(&teeth)];
        assert_eq!(strategy(&teeth).unwrap(), Strategy::List);
        // A coast of a million short ones has few.
        let coast: Vec<[i32; 2]> = (0..1_000_000).map(|at| [at, at % 2]).collect();
        let coast = [contour(&coast)];
        assert_eq!(strategy(&coast).unwrap(), Strategy::Auto);
    }
}
