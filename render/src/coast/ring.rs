//! Outlines of land and of lakes on the sphere, and borders: unpacked once.

use std::ops::Range;
use std::sync::LazyLock;

use contract::land::LAND;
use glam::DVec3;

use super::packed::unpack;

/// Shores of lakes, then borders; `pack.py` packs them.
const INLAND: &[u8] = include_bytes!("inland.bin");
/// Edges of the map that outlines are cut along, degrees: its sides, and what leads to the south pole.
const SIDE_DEG: f64 = 180.0;
const POLE_DEG: f64 = -89.0;
/// Edges of a run: longer ones are looked at more seldom, shorter ones are more often not seen.
const RUN_EDGES: usize = 64;

/// A closed outline.
#[derive(Debug)]
pub struct Ring {
    /// Its corners on the unit sphere, in the axes of eq. 4 (docs/method.md).
    pub corners: Vec<DVec3>,
    /// Of the edge after each corner: it is a shore, not an edge of the map it was cut along.
    pub is_shore: Vec<bool>,
    /// 1: its interior lies on the left seen from above; -1: it is cut out of another one.
    pub sign: i32,
    /// All of it lies round here.
    pub cap: Cap,
    /// All of its edges, in order.
    pub runs: Vec<Run>,
}

/// Edges that follow one another and lie near one another: one look tells of most whether any of them is seen.
#[derive(Debug)]
pub struct Run {
    /// Numbers of the edges, which are those of the corners that they begin at.
    pub edges: Range<usize>,
    /// All of them lie in a ball round this place; it need not be on the sphere.
    pub center: DVec3,
    /// Radius of the ball, earth radii.
    pub radius: f64,
}

impl Run {
    /// All edges of a line, closed or not, in runs of so many.
    fn all(corners: &[DVec3], is_closed: bool, length: usize) -> Vec<Self> {
        let edges = if is_closed {
            corners.len()
        } else {
            corners.len().saturating_sub(1)
        };
        let run = |first: usize| {
            let edges = first..(first + length).min(edges);
            let own = || (edges.start..=edges.end).map(|at| corners[at % corners.len()]);
            let center = own().sum::<DVec3>() / (edges.len() + 1) as f64;
            let radius = own().map(|corner| corner.distance(center));
            Self {
                radius: radius.fold(0.0, f64::max),
                center,
                edges,
            }
        };
        (0..edges).step_by(length).map(run).collect()
    }
}

/// A part of the sphere round a place.
#[derive(Debug, Clone, Copy)]
pub struct Cap {
    pub center: DVec3,
    /// Radians.
    pub radius: f64,
}

/// A line that is not closed.
#[derive(Debug)]
pub struct Border {
    pub corners: Vec<DVec3>,
    pub cap: Cap,
    /// All of its edges, in order.
    pub runs: Vec<Run>,
}

/// Land, its interior on the left.
pub static LAND_RINGS: LazyLock<Vec<Ring>> = LazyLock::new(|| {
    let rings = LAND.iter().map(|ring| {
        let mut places = ring.clone();
        if area(&places) < 0.0 {
            places.reverse();
        }
        Ring::of(&places)
    });
    rings.collect()
});

/// Lakes, and islands in them, which run the other way.
pub static LAKE_RINGS: LazyLock<Vec<Ring>> =
    LazyLock::new(|| inland()[0].iter().map(|places| Ring::of(places)).collect());

/// Borders of countries on land.
pub static BORDERS: LazyLock<Vec<Border>> = LazyLock::new(|| {
    let lines = inland().swap_remove(1);
    let lines = lines.into_iter().map(|places| {
        let corners: Vec<_> = places.into_iter().map(normal).collect();
        let cap = Cap::round(&corners);
        let runs = Run::all(&corners, false, RUN_EDGES);
        Border { corners, cap, runs }
    });
    lines.collect()
});

fn inland() -> Vec<Vec<Vec<[f64; 2]>>> {
    let lists = unpack(INLAND).expect("the lines in the program are whole; a test reads them");
    let degrees = |line: Vec<super::Place>| line.into_iter().map(super::Place::degrees).collect();
    let lists = lists
        .into_iter()
        .map(|lines| lines.into_iter().map(degrees).collect());
    lists.collect()
}

/// Twice the area within an outline on the map, square degrees; positive anticlockwise.
fn area(places: &[[f64; 2]]) -> f64 {
    let ends = places.iter().zip(places.iter().cycle().skip(1));
    ends.map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum()
}

pub(super) fn normal([lon_deg, lat_deg]: [f64; 2]) -> DVec3 {
    let (sin_lon, cos_lon) = lon_deg.to_radians().sin_cos();
    let (sin_lat, cos_lat) = lat_deg.to_radians().sin_cos();
    DVec3::new(cos_lat * sin_lon, cos_lat * cos_lon, sin_lat)
}

impl Cap {
    fn round(corners: &[DVec3]) -> Self {
        let center = corners.iter().sum::<DVec3>().normalize_or(DVec3::Z);
        let radius = corners.iter().map(|corner| angle(center, *corner));
        Self {
            center,
            radius: radius.fold(0.0, f64::max),
        }
    }

    /// Between its middle and a place, radians.
    pub fn angle_to(&self, place: DVec3) -> f64 {
        angle(self.center, place)
    }
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

impl Ring {
    /// Where a run of its edges begins and ends.
    pub fn ends(&self, run: &Run) -> [DVec3; 2] {
        [run.edges.start, run.edges.end].map(|at| self.corners[at % self.corners.len()])
    }

    /// The edges of a run, each with its ends.
    pub fn edges(&self, run: &Run) -> impl Iterator<Item = (DVec3, DVec3)> {
        let [_, last] = self.ends(run);
        let own = &self.corners[run.edges.clone()];
        let ends = own.iter().skip(1).copied().chain([last]);
        own.iter().copied().zip(ends)
    }

    fn of(places: &[[f64; 2]]) -> Self {
        let ends = places.iter().zip(places.iter().cycle().skip(1));
        let is_cut = |a: &[f64; 2], b: &[f64; 2]| {
            let on_side = |place: &[f64; 2]| place[0].abs() >= SIDE_DEG;
            (on_side(a) && on_side(b)) || a[1] < POLE_DEG || b[1] < POLE_DEG
        };
        let corners: Vec<_> = places.iter().copied().map(normal).collect();
        Self {
            is_shore: ends.map(|(a, b)| !is_cut(a, b)).collect(),
            sign: if area(places) < 0.0 { -1 } else { 1 },
            cap: Cap::round(&corners),
            runs: Run::all(&corners, true, RUN_EDGES),
            corners,
        }
    }
}

#[cfg(test)]
impl Ring {
    /// The same with every edge a run, so that each is looked at by itself.
    pub(crate) fn in_single_edges(&self) -> Self {
        Self {
            corners: self.corners.clone(),
            is_shore: self.is_shore.clone(),
            sign: self.sign,
            cap: self.cap,
            runs: Run::all(&self.corners, true, 1),
        }
    }
}

#[cfg(test)]
impl Border {
    /// The same with every edge a run.
    pub(crate) fn in_single_edges(&self) -> Self {
        Self {
            corners: self.corners.clone(),
            cap: self.cap,
            runs: Run::all(&self.corners, false, 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn land_lakes_and_borders_are_there_and_run_the_right_way() {
        assert!(LAND_RINGS.len() > 1400 && LAKE_RINGS.len() > 200 && BORDERS.len() > 300);
        assert!(LAND_RINGS.iter().all(|ring| ring.sign == 1));
        let islands = LAKE_RINGS.iter().filter(|ring| ring.sign < 0).count();
        assert!((10..100).contains(&islands), "{islands} islands in lakes");
        assert!(INLAND.len() < 150_000);
        for ring in LAND_RINGS.iter().chain(LAKE_RINGS.iter()) {
            assert_eq!(ring.corners.len(), ring.is_shore.len());
            let farthest = ring.corners.iter().map(|corner| ring.cap.angle_to(*corner));
            assert!(farthest.fold(0.0, f64::max) <= ring.cap.radius + 1e-12);
        }
    }

    #[test]
    fn runs_hold_every_edge_once() {
        let rings = LAND_RINGS.iter().chain(LAKE_RINGS.iter());
        let closed = rings.map(|ring| (&ring.corners, &ring.runs, ring.corners.len()));
        let open = BORDERS.iter();
        let open = open.map(|line| (&line.corners, &line.runs, line.corners.len() - 1));
        for (corners, runs, edges) in closed.chain(open) {
            let numbers = runs.iter().flat_map(|run| run.edges.clone());
            assert!(numbers.eq(0..edges));
            for run in runs {
                let own = (run.edges.start..=run.edges.end).map(|at| corners[at % corners.len()]);
                let farthest = own.map(|corner| corner.distance(run.center));
                assert!(farthest.fold(0.0, f64::max) <= run.radius + 1e-12);
            }
        }
    }

    #[test]
    fn lakes_and_borders_are_where_they_are() {
        let nearest = |corners: &mut dyn Iterator<Item = DVec3>, lon: f64, lat: f64| {
            let place = normal([lon, lat]);
            corners
                .map(|corner| angle(corner, place))
                .fold(f64::INFINITY, f64::min)
        };
        for (lon, lat, name) in [
            (-79.9, 43.3, "Lake Ontario at Hamilton"),
            (32.6, 0.05, "Lake Victoria at Entebbe"),
            (49.9, 40.4, "the Caspian Sea at Baku"),
            (103.7, 51.5, "Lake Baikal at Kultuk"),
        ] {
            let mut shores = LAKE_RINGS.iter().flat_map(|ring| ring.corners.clone());
            let off = nearest(&mut shores, lon, lat).to_degrees();
            assert!(off < 0.35, "{name}: {off}");
        }
        for (lon, lat, name) in [
            (7.59, 47.59, "three countries at Basel"),
            (-123.3, 49.0, "the 49th parallel at the Pacific"),
            (-54.6, -25.6, "three countries at Iguazu"),
        ] {
            let mut lines = BORDERS.iter().flat_map(|line| line.corners.clone());
            let off = nearest(&mut lines, lon, lat).to_degrees();
            assert!(off < 0.6, "{name}: {off}");
        }
    }

    #[test]
    fn edges_that_the_map_was_cut_along_are_no_shores() {
        for ring in LAND_RINGS.iter() {
            let ends = ring.corners.iter().zip(ring.corners.iter().cycle().skip(1));
            for ((a, b), is_shore) in ends.zip(&ring.is_shore) {
                let on_side = |corner: &DVec3| corner.x.abs() < 1e-9 && corner.y < 0.0;
                let along = on_side(a) && on_side(b);
                assert!(!(*is_shore && along), "{a} {b}");
                // No shore is as long as a cut.
                assert!(!*is_shore || angle(*a, *b).to_degrees() < 3.0, "{a} {b}");
            }
        }
    }
}
