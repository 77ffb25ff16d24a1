//! How often edges cross: each crossing has to be resolved, and some thousand corners that are drawn to and fro have millions of them.

use super::ring::Checked;

/// Most crossings that are resolved: a few seconds.
const MOST: u64 = 250_000;
/// Pairs of edges that are looked at, some tenths of a second.
const LOOKS: u64 = 100_000_000;
/// Edges of which every pair is looked at where there are too many pairs.
const SAMPLE: usize = 8192;
/// Crossings among these that tell anything of all: one long edge crosses a coast some dozen times.
const TELLING: u64 = 256;

/// An edge from west to east, and its southern and northern ends.
#[derive(Clone, Copy)]
struct Edge {
    from: [f64; 2],
    to: [f64; 2],
    lats: [f64; 2],
}

impl Edge {
    fn of([one, other]: [[f64; 2]; 2]) -> Self {
        let is_eastwards = one[0] <= other[0];
        let (from, to) = if is_eastwards {
            (one, other)
        } else {
            (other, one)
        };
        Self {
            from,
            to,
            lats: [one[1].min(other[1]), one[1].max(other[1])],
        }
    }

    /// On which side a place lies.
    fn side(&self, [lon, lat]: [f64; 2]) -> f64 {
        let [across, up] = [self.to[0] - self.from[0], self.to[1] - self.from[1]];
        across * (lat - self.from[1]) - up * (lon - self.from[0])
    }

    /// Do two cross between their ends?
    fn crosses(&self, other: &Self) -> bool {
        self.lats[0] < other.lats[1]
            && other.lats[0] < self.lats[1]
            && self.side(other.from) * self.side(other.to) < 0.0
            && other.side(self.from) * other.side(self.to) < 0.0
    }
}

/// How many crossings are too many, where edges of polygons have so many; none where they have not.
pub(super) fn too_many(polygons: &[Checked]) -> Option<u64> {
    let rings = polygons.iter().flat_map(Checked::rings);
    let edges = rings.flat_map(|ring| {
        let next = ring.iter().cycle().skip(1);
        ring.iter()
            .zip(next)
            .map(|(from, to)| Edge::of([*from, *to]))
    });
    let edges: Vec<Edge> = edges.collect();
    let pairs = (edges.len() as u64).pow(2) / 2;
    let is_too_many = pairs > MOST && has_more(edges, pairs);
    is_too_many.then_some(MOST)
}

/// By all pairs that meet in longitude; where these are very many, by those of some edges.
fn has_more(mut edges: Vec<Edge>, pairs: u64) -> bool {
    edges.sort_by(|one, other| one.from[0].total_cmp(&other.from[0]));
    if let Some(count) = counted(&edges, LOOKS) {
        return count > MOST;
    }
    let some = edges.iter().step_by(edges.len().div_ceil(SAMPLE));
    let some: Vec<Edge> = some.copied().collect();
    let of_some = counted(&some, u64::MAX).unwrap_or(u64::MAX);
    let of_pairs = (some.len() as u64).pow(2) / 2;
    of_some >= TELLING
        && u128::from(of_some) * u128::from(pairs) > u128::from(MOST) * u128::from(of_pairs)
}

/// Crossings of edges in the order of their western ends, up to one more than [`MOST`]; none if more pairs would have to be looked at.
fn counted(edges: &[Edge], looks: u64) -> Option<u64> {
    let (mut open, mut crossings, mut looked): (Vec<Edge>, u64, u64) = (vec![], 0, 0);
    for edge in edges {
        looked += open.len() as u64;
        if looked > looks {
            return None;
        }
        open.retain(|other| {
            crossings += u64::from(edge.crosses(other));
            other.to[0] >= edge.from[0]
        });
        if crossings > MOST {
            break;
        }
        open.push(*edge);
    }
    Some(crossings)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(outer: Vec<[f64; 2]>) -> Checked {
        Checked {
            outer,
            holes: vec![],
        }
    }

    /// Corners anywhere, from a generator of its own (Lehmer's, of 48 bits).
    fn scribble(count: usize) -> Checked {
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(25_214_903_917).wrapping_add(11) & ((1 << 48) - 1);
            state as f64 / (1_u64 << 48) as f64
        };
        of((0..count)
            .map(|_| [next() * 100.0, next() * 80.0 - 40.0])
            .collect())
    }

    fn around(count: usize) -> Checked {
        let place = |at: usize| {
            let (sin, cos) = (at as f64 / count as f64 * std::f64::consts::TAU).sin_cos();
            [40.0 * cos, 40.0 * sin]
        };
        of((0..count).map(place).collect())
    }

    #[test]
    fn edges_that_cross_are_counted_and_those_that_touch_are_not() {
        let count = |ring: &Checked| {
            let edges = ring.outer.iter().zip(ring.outer.iter().cycle().skip(1));
            let mut edges: Vec<Edge> = edges.map(|(a, b)| Edge::of([*a, *b])).collect();
            edges.sort_by(|one, other| one.from[0].total_cmp(&other.from[0]));
            counted(&edges, u64::MAX)
        };
        let bow = of(vec![[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]);
        assert_eq!(count(&bow), Some(1));
        assert_eq!(count(&around(1000)), Some(0));
        // Every other edge of a pentagram.
        let star: Vec<[f64; 2]> = (0..5).map(|at| around(5).outer[at * 2 % 5]).collect();
        assert_eq!(count(&of(star)), Some(5));
    }

    #[test]
    fn scribbles_are_too_much_and_long_coasts_are_not() {
        assert_eq!(too_many(&[scribble(300)]), None);
        assert_eq!(too_many(&[scribble(3000)]), Some(MOST));
        assert_eq!(too_many(&[scribble(200_000)]), Some(MOST));
        assert_eq!(too_many(&[around(999_999)]), None);
        // Polygons one over the other cross as well.
        let both = [scribble(900), scribble(901)];
        assert_eq!(too_many(&both), Some(MOST));
        // A comb: edges side by side, of which very many pairs meet in longitude and none cross.
        let tooth = |at: usize| [[0.0, at as f64 * 1e-4], [50.0, at as f64 * 1e-4 + 5e-5]];
        let mut comb: Vec<[f64; 2]> = (0..200_000).flat_map(tooth).collect();
        comb.push([-1.0, 20.0]);
        comb.push([-1.0, 0.0]);
        assert_eq!(too_many(&[of(comb)]), None);
    }
}
