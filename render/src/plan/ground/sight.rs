//! The ground from a camera: outlines and lines of the globe in, what is seen of them in pixels out.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::coast::Pen;
use crate::coast::ring::{Border, Cap, Ring, Run};
use crate::plan::camera::Camera;

/// Edges of an outline that one core goes along at once.
const EDGES_AT_ONCE: usize = 1024;
/// Runs of an outline that one core goes along at once.
const RUNS_AT_ONCE: usize = 16;
/// Shores of lakes, fainter than those of the sea.
const LAKE_PEN: Pen = Pen {
    half_width_px: 0.5,
    strength: 0.45,
};
const BORDER_PEN: Pen = Pen {
    half_width_px: 0.4,
    strength: 1.0,
};
/// Outlines that reach no farther than this from their middle are land without a line: it would be all there is to see, a fleck
/// in the sea.
const LEAST_OUTLINE_PX: f64 = 1.5;
/// From here on lines round them are whole.
const WHOLE_OUTLINE_PX: f64 = 4.0;
/// Farthest beyond the globe's outline that hidden corners are led round it, seen from the camera, radians.
const BEYOND_RAD: f64 = 0.05;
/// Longest step of that, radians: straight lines between them pass the globe.
const STEP_RAD: f64 = 0.35;
/// What is farther outside the picture than this is not seen, nor is any of a line there, pixels.
const ASIDE_PX: f64 = 4.0;
/// How far outside corners behind a camera in the globe are led round the picture, half diagonals.
const OUTSIDE: f64 = 4.0;

/// A line as it is seen, pixels.
pub(super) type Line = (Pen, [DVec2; 2]);

/// What one ring covers.
pub(super) struct Covered {
    /// All of the picture, so many times.
    pub(super) everywhere: i32,
    /// Of its outline, those that reach rows of the picture, in their order.
    pub(super) edges: Vec<[DVec2; 2]>,
}

/// What becomes of every edge of a closed outline, in order; long outlines are shared among cores.
fn along<A: Copy + Sync, B: Send>(closed: &[A], each: impl Fn(A, A, &mut Vec<B>) + Sync) -> Vec<B> {
    let part = |first: usize| {
        let mut made = Vec::with_capacity(EDGES_AT_ONCE + 16);
        for at in first..(first + EDGES_AT_ONCE).min(closed.len()) {
            let next = if at + 1 == closed.len() { 0 } else { at + 1 };
            each(closed[at], closed[next], &mut made);
        }
        made
    };
    if closed.len() <= EDGES_AT_ONCE {
        return part(0);
    }
    let parts = 0..closed.len().div_ceil(EDGES_AT_ONCE);
    let parts = parts
        .into_par_iter()
        .map(|number| part(number * EDGES_AT_ONCE));
    let parts: Vec<_> = parts.collect();
    parts.into_iter().flatten().collect()
}

/// Where all edges of a run lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lie {
    /// Beyond the horizon.
    Hidden,
    /// Before the camera and this side of the horizon, on one side of what the picture shows.
    Aside,
    /// Some may be seen.
    Near,
}

/// A side of what a picture shows: places on or beyond it have a coordinate below 0.
struct Side {
    gradient: DVec3,
    length: f64,
}

impl Side {
    fn new(gradient: DVec3) -> Self {
        Self {
            length: gradient.length(),
            gradient,
        }
    }
}

/// The ground from a camera: the globe from outside or, below the sea surface, from inside.
pub(super) struct Sight<'a> {
    camera: &'a Camera,
    /// Left, right, upper and lower edge of the picture and a little beyond, as planes through the camera.
    sides: [Side; 4],
    middle_px: DVec2,
    /// Towards the camera from the globe's middle.
    up: DVec3,
    /// From there to the horizon, radians.
    horizon: f64,
    /// How far beyond the horizon, along its normals, hidden corners are led round the globe.
    beyond: f64,
    /// Where the line of sight backwards leaves the globe, from inside.
    behind: Option<DVec3>,
}

impl<'a> Sight<'a> {
    pub(super) fn new(camera: &'a Camera, size_px: [u32; 2]) -> Self {
        let distance = camera.place.length();
        let horizon = (1.0 / distance).clamp(-1.0, 1.0).acos();
        // The outline is seen so far from straight down; what is led round it stays below the level of the eye, so that
        // the circle is convex.
        let outline = FRAC_PI_2 - horizon;
        let angle = BEYOND_RAD.min((FRAC_PI_2 - outline) / 2.0);
        let middle_px = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1])) / 2.0;
        let [across, down] = [camera.right, -camera.top].map(|axis| axis * camera.focal_px);
        let [half_width, half_height] =
            [middle_px.x, middle_px.y].map(|half| camera.forward * (half + ASIDE_PX));
        Self {
            camera,
            sides: [
                half_width + across,
                half_width - across,
                half_height + down,
                half_height - down,
            ]
            .map(Side::new),
            middle_px,
            up: camera.place / distance,
            horizon,
            beyond: angle.tan() * (distance * distance - 1.0).max(0.0).sqrt(),
            behind: camera.is_below().then(|| behind(camera)),
        }
    }

    /// How far a place is above its horizon, from inside how far ahead; changes evenly along a straight line.
    fn above(&self, place: DVec3) -> f64 {
        match self.behind {
            Some(_) => self.camera.ahead(place),
            None => place.dot(self.camera.place) - 1.0,
        }
    }

    fn seen_px(&self, place: DVec3) -> DVec2 {
        self.camera.seen_px(place) + self.middle_px
    }

    /// Is all of a run on one side of what the picture shows, as far as it is before the camera?
    fn is_aside(&self, run: &Run) -> bool {
        let sight = run.center - self.camera.place;
        let beyond = |side: &Side| sight.dot(side.gradient) + run.radius * side.length < 0.0;
        self.sides.iter().any(beyond)
    }

    /// Where a run lies, from outside the globe.
    fn lie(&self, run: &Run) -> Lie {
        let above = self.above(run.center);
        let reach = run.radius * self.camera.place.length();
        if above < -reach {
            Lie::Hidden
        } else if above > reach && self.camera.ahead(run.center) > run.radius && self.is_aside(run)
        {
            Lie::Aside
        } else {
            Lie::Near
        }
    }

    /// May any of a line be seen?
    fn is_near(&self, run: &Run) -> bool {
        let is_hidden = self.behind.is_none() && self.lie(run) == Lie::Hidden;
        !is_hidden && !self.is_aside(run)
    }

    /// Does it keep so far from the axis through the camera that it is not led round it?
    fn is_off_axis(&self, run: &Run) -> bool {
        run.center.reject_from_normalized(self.up).length() > run.radius
    }

    /// Is all of it beyond the horizon?
    fn is_hidden(&self, cap: &Cap) -> bool {
        self.behind.is_none() && cap.angle_to(self.up) - cap.radius > self.horizon
    }

    /// May it reach the place opposite the camera?
    fn may_be_opposite(&self, cap: &Cap) -> bool {
        PI - cap.angle_to(self.up) <= cap.radius + 1e-6
    }

    /// What rings cover, in their order.
    pub(super) fn outlines(&self, rings: &[Ring]) -> Vec<Covered> {
        let covered: Vec<_> = rings.par_iter().map(|ring| self.covered(ring)).collect();
        covered.into_iter().flatten().collect()
    }

    /// What one ring covers; none if it cannot be seen.
    fn covered(&self, ring: &Ring) -> Option<Covered> {
        if let Some(behind) = self.behind {
            // All of the globe is round the camera, and what holds the place behind it covers all but what it leaves out.
            let is_all_round = ring.cap.angle_to(behind) <= ring.cap.radius + 1e-6
                && turns_round(behind, ring) == ring.sign;
            return Some(Covered {
                everywhere: if is_all_round { ring.sign } else { 0 },
                edges: self.edges(&self.outline_from_inside(ring)),
            });
        }
        let may_be_opposite = self.may_be_opposite(&ring.cap);
        if self.is_hidden(&ring.cap) && !may_be_opposite {
            return None;
        }
        // What holds the place opposite goes round the globe the other way: it covers all but its hole.
        let is_all_round = may_be_opposite && self.turns(ring) == -ring.sign;
        Some(Covered {
            everywhere: if is_all_round { ring.sign } else { 0 },
            edges: self.edges(&self.outline(ring)),
        })
    }

    /// The edges of an outline in pixels that reach rows of the picture: the others cover nothing of it.
    fn edges(&self, outline: &[DVec2]) -> Vec<[DVec2; 2]> {
        let height_px = 2.0 * self.middle_px.y;
        along(outline, |a, b, edges| {
            let (top, bottom) = (a.y.min(b.y), a.y.max(b.y));
            if bottom > 0.0 && top < height_px {
                edges.push([a, b]);
            }
        })
    }

    /// An outline as it is seen from inside, where left and right are the other way round: what lies behind the camera is
    /// led round the picture.
    fn outline_from_inside(&self, ring: &Ring) -> Vec<DVec2> {
        let mut path = Vec::with_capacity(ring.corners.len() + 16);
        let corners = || ring.corners.iter().rev();
        for (&a, &b) in corners().zip(corners().cycle().skip(1)) {
            let (from, to) = (self.above(a), self.above(b));
            let crossing = || a + (b - a) * (from / (from - to));
            match (from >= 0.0, to >= 0.0) {
                (true, true) => path.push(self.seen_px(b)),
                (true, false) => {
                    let edge = crossing();
                    path.push(self.seen_px(edge));
                    self.lead_round_picture(&mut path, edge, b);
                }
                (false, true) => {
                    let edge = crossing();
                    self.lead_round_picture(&mut path, a, edge);
                    path.extend([edge, b].map(|place| self.seen_px(place)));
                }
                (false, false) => self.lead_round_picture(&mut path, a, b),
            }
        }
        path
    }

    /// Goes on round the picture, far outside, from the azimuth of one place about the line of sight to that of another.
    fn lead_round_picture(&self, path: &mut Vec<DVec2>, from: DVec3, to: DVec3) {
        let azimuth = |place: DVec3| {
            let sight = place - self.camera.place;
            sight
                .dot(self.camera.top)
                .atan2(sight.dot(self.camera.right))
        };
        let first = azimuth(from);
        let way = short_way(azimuth(to) - first);
        let steps = (way.abs() / STEP_RAD).ceil().max(1.0) as u32;
        let radius_px = OUTSIDE * self.middle_px.length();
        for step in 0..=steps {
            let (sin, cos) = (first + way * f64::from(step) / f64::from(steps)).sin_cos();
            path.push(self.middle_px + DVec2::new(cos, -sin) * radius_px);
        }
    }

    /// Of a place, round the axis through the camera, radians.
    fn azimuth(&self, place: DVec3) -> f64 {
        let [east, north, _up] = self.camera.ground;
        place.dot(north).atan2(place.dot(east))
    }

    /// How often an outline goes round that axis, anticlockwise seen from the camera.
    fn turns(&self, ring: &Ring) -> i32 {
        let step = |a, b| short_way(self.azimuth(b) - self.azimuth(a));
        let turned = |run: &Run| {
            if self.is_off_axis(run) {
                let [a, b] = ring.ends(run);
                return step(a, b);
            }
            ring.edges(run).map(|(a, b)| step(a, b)).sum()
        };
        (ring.runs.iter().map(turned).sum::<f64>() / TAU).round() as i32
    }

    /// An outline as it is seen, hidden parts led round the globe, what lies behind the camera cut off.
    fn outline(&self, ring: &Ring) -> Vec<DVec2> {
        let part = |runs: &[Run]| {
            let mut path = vec![];
            for run in runs {
                let [first, last] = ring.ends(run);
                match self.lie(run) {
                    Lie::Hidden if self.is_off_axis(run) => {
                        self.lead_round(&mut path, first, last);
                    }
                    // The straight way covers the same of the picture: between the two there is nothing of it.
                    Lie::Aside => path.push(last),
                    Lie::Hidden | Lie::Near => {
                        for (a, b) in ring.edges(run) {
                            self.go_along(&mut path, a, b);
                        }
                    }
                }
            }
            path
        };
        let parts: Vec<_> = ring.runs.par_chunks(RUNS_AT_ONCE).map(part).collect();
        self.ahead(&parts.concat())
    }

    /// Goes on along an edge, as far as it is this side of the horizon, and round the globe for the rest.
    fn go_along(&self, path: &mut Vec<DVec3>, a: DVec3, b: DVec3) {
        let (from, to) = (self.above(a), self.above(b));
        let crossing = || a + (b - a) * (from / (from - to));
        match (from >= 0.0, to >= 0.0) {
            (true, true) => path.push(b),
            (true, false) => {
                let edge = crossing();
                path.push(edge);
                self.lead_round(path, edge, b);
            }
            (false, true) => {
                let edge = crossing();
                self.lead_round(path, a, edge);
                path.extend([edge, b]);
            }
            (false, false) => self.lead_round(path, a, b),
        }
    }

    /// Goes on round the globe, beyond its outline, from the azimuth of one place to that of another.
    fn lead_round(&self, path: &mut Vec<DVec3>, from: DVec3, to: DVec3) {
        let first = self.azimuth(from);
        let way = short_way(self.azimuth(to) - first);
        let steps = (way.abs() / STEP_RAD).ceil().max(1.0) as u32;
        let [east, north, _up] = self.camera.ground;
        let (sin, cos) = self.horizon.sin_cos();
        for step in 0..=steps {
            let azimuth = first + way * f64::from(step) / f64::from(steps);
            let level = east * azimuth.cos() + north * azimuth.sin();
            let place = self.up * cos + level * sin;
            path.push(place * (1.0 + self.beyond));
        }
    }

    /// The part of a closed path before the camera (Sutherland and Hodgman 1974), in pixels.
    fn ahead(&self, path: &[DVec3]) -> Vec<DVec2> {
        along(path, |a, b, seen| {
            let (from, to) = (self.camera.ahead(a), self.camera.ahead(b));
            if (from >= 0.0) != (to >= 0.0) {
                seen.push(self.seen_px(a + (b - a) * (from / (from - to))));
            }
            if to >= 0.0 {
                seen.push(self.seen_px(b));
            }
        })
    }

    /// How much is drawn of the line round an outline, by its size in the picture: none where it is a pixel or two.
    fn outline_share(&self, cap: &Cap) -> f64 {
        // Its place nearest to the one straight below or above.
        let cos = (cap.angle_to(self.up) - cap.radius).max(0.0).cos();
        let distance = self.camera.place.length();
        let way = (distance * distance + 1.0 - 2.0 * distance * cos).sqrt();
        let way = way.max(f64::EPSILON);
        let slant = ((distance * cos - 1.0) / way).abs();
        // What is seen aslant is as large as a disc of its area.
        let radius_px = cap.radius * self.camera.focal_px / way * slant.sqrt();
        ((radius_px - LEAST_OUTLINE_PX) / (WHOLE_OUTLINE_PX - LEAST_OUTLINE_PX)).clamp(0.0, 1.0)
    }

    pub(super) fn shores(&self, land: &[Ring], lakes: &[Ring]) -> Vec<Line> {
        let rings = |rings: &[Ring], pen: Pen| -> Vec<Line> {
            let seen = rings.par_iter().filter_map(move |ring| {
                let share = self.outline_share(&ring.cap);
                (share > 0.0 && !self.is_hidden(&ring.cap)).then_some((ring, share))
            });
            let lines = seen.flat_map_iter(|(ring, share)| {
                let pen = Pen {
                    strength: pen.strength * share,
                    ..pen
                };
                let runs = ring.runs.iter().filter(|run| self.is_near(run));
                runs.flat_map(move |run| {
                    let edges = ring.edges(run).zip(&ring.is_shore[run.edges.clone()]);
                    let shores = edges.filter(|(_, is_shore)| **is_shore);
                    shores.filter_map(move |((a, b), _)| self.line(pen, [a, b]))
                })
            });
            lines.collect()
        };
        let (land, lakes) = rayon::join(|| rings(land, Pen::COAST), || rings(lakes, LAKE_PEN));
        [land, lakes].concat()
    }

    pub(super) fn borders(&self, borders: &[Border]) -> Vec<Line> {
        let seen = borders.par_iter();
        let seen = seen.filter(|border| !self.is_hidden(&border.cap));
        let lines = seen.flat_map_iter(|border| {
            let runs = border.runs.iter().filter(|run| self.is_near(run));
            let corners = runs.map(|run| &border.corners[run.edges.start..=run.edges.end]);
            let pairs = corners.flat_map(|corners| corners.windows(2));
            pairs.filter_map(|pair| self.line(BORDER_PEN, [pair[0], pair[1]]))
        });
        lines.collect()
    }

    /// The part of a line that is seen.
    fn line(&self, pen: Pen, ends: [DVec3; 2]) -> Option<Line> {
        let seen = clipped(ends, |place| self.above(place))?;
        let [a, b] = clipped(seen, |place| self.camera.ahead(place))?;
        Some((pen, [self.seen_px(a), self.seen_px(b)]))
    }
}

/// Where the line of sight of a camera in the globe leaves it backwards.
fn behind(camera: &Camera) -> DVec3 {
    let backwards = -camera.forward;
    let nearest = -camera.place.dot(backwards);
    let half_chord = (1.0 - camera.place.length_squared() + nearest * nearest)
        .max(0.0)
        .sqrt();
    (camera.place + backwards * (nearest + half_chord)).normalize_or(DVec3::Z)
}

/// How often an outline goes round a place, anticlockwise seen from above; it does not hold the place opposite as well.
fn turns_round(place: DVec3, ring: &Ring) -> i32 {
    // The axes of eq. 4 (docs/method.md) are left-handed: their pair goes round clockwise.
    let (along, across) = place.any_orthonormal_pair();
    let azimuth = |corner: DVec3| corner.dot(along).atan2(corner.dot(across));
    let ends = ring.corners.iter().zip(ring.corners.iter().cycle().skip(1));
    let steps = ends.map(|(a, b)| short_way(azimuth(*b) - azimuth(*a)));
    (steps.sum::<f64>() / TAU).round() as i32
}

/// A difference of angles the short way round, -pi to pi.
fn short_way(angle: f64) -> f64 {
    angle - (angle / TAU).round() * TAU
}

/// The part of a line whose coordinate, which changes evenly along it, is not negative.
fn clipped([a, b]: [DVec3; 2], coordinate: impl Fn(DVec3) -> f64) -> Option<[DVec3; 2]> {
    let [at_a, at_b] = [a, b].map(coordinate);
    let crossing = || a + (b - a) * (at_a / (at_a - at_b));
    match (at_a >= 0.0, at_b >= 0.0) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, crossing()]),
        (false, true) => Some([crossing(), b]),
        (false, false) => None,
    }
}
