//! What lies in every pixel of a globe view, by the outlines of land, lakes and borders: exact shares of areas, and lines.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use glam::{DVec2, DVec3};

use super::camera::Camera;
use crate::coast::ring::{BORDERS, Cap, LAKE_RINGS, LAND_RINGS, Ring};
use crate::coast::{Cover, Mask, Pen};

/// Cores that a mask is made on at most: more gain little, and others want some.
const MOST_CORES: usize = 8;
/// Shores of lakes, fainter than those of the sea.
const LAKE_PEN: Pen = Pen {
    half_width_px: 0.5,
    strength: 0.45,
};
const BORDER_PEN: Pen = Pen {
    half_width_px: 0.4,
    strength: 1.0,
};
/// Outlines that reach no farther than this from their middle are land without a line: it would be all there is to see.
const LEAST_OUTLINE_PX: f64 = 1.5;
/// Farthest beyond the globe's outline that hidden corners are led round it, seen from the camera, radians.
const BEYOND_RAD: f64 = 0.05;
/// Longest step of that, radians: straight lines between them pass the globe.
const STEP_RAD: f64 = 0.35;

/// How far outside corners behind a camera in the globe are led round the picture, half diagonals.
const OUTSIDE: f64 = 4.0;

/// What is wanted of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) land: bool,
    pub(super) coasts: bool,
    pub(super) borders: bool,
}

/// A word for every pixel: shares of land, lakes, shores and borders, 0 to 255, the first in the lowest bits. Made on as
/// many cores as are of use: a camera that moves needs one for every picture.
pub(super) fn mask(camera: &Camera, size_px: [u32; 2], wanted: Wanted) -> Vec<u32> {
    let sight = &Sight::new(camera, size_px);
    let (land, lakes, shores, borders) = thread::scope(|scope| {
        let cover = |rings: &'static [Ring]| scope.spawn(move || sight.cover(rings));
        let land = wanted
            .land
            .then(|| [&**LAND_RINGS, &**LAKE_RINGS].map(cover));
        let shores = wanted.coasts.then(|| scope.spawn(|| sight.shores()));
        let borders = wanted.borders.then(|| scope.spawn(|| sight.borders()));
        let [land, lakes] = land.map_or([None, None], |both| both.map(|one| Some(ended(one))));
        (land, lakes, shores.map(ended), borders.map(ended))
    });
    let mut words = vec![0; size_px[0] as usize * size_px[1] as usize];
    let rows = (size_px[1] as usize).div_ceil(cores());
    thread::scope(|scope| {
        for (number, words) in words.chunks_mut(rows * size_px[0] as usize).enumerate() {
            let first_row = number * rows;
            let (covers, lines) = ([(&land, 0), (&lakes, 8)], [(&shores, 16), (&borders, 24)]);
            scope.spawn(move || {
                for (cover, shift) in covers {
                    if let Some(cover) = cover {
                        cover.write(first_row, words, shift);
                    }
                }
                for (mask, shift) in lines {
                    if let Some(mask) = mask {
                        mask.write(first_row, words, shift);
                    }
                }
            });
        }
    });
    words
}

/// Cores that one mask is made on at most.
fn cores() -> usize {
    thread::available_parallelism().map_or(1, |count| count.get().min(MOST_CORES))
}

fn ended<T>(thread: thread::ScopedJoinHandle<'_, T>) -> T {
    match thread.join() {
        Ok(value) => value,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// What one ring covers.
struct Covered {
    /// All of the picture, so many times.
    everywhere: i32,
    outline: Vec<DVec2>,
}

/// The ground from a camera: the globe from outside or, below the sea surface, from inside.
struct Sight<'a> {
    camera: &'a Camera,
    size_px: [u32; 2],
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
    fn new(camera: &'a Camera, size_px: [u32; 2]) -> Self {
        let distance = camera.place.length();
        let horizon = (1.0 / distance).clamp(-1.0, 1.0).acos();
        // The outline is seen so far from straight down; what is led round it stays below the level of the eye, so that
        // the circle is convex.
        let outline = FRAC_PI_2 - horizon;
        let angle = BEYOND_RAD.min((FRAC_PI_2 - outline) / 2.0);
        Self {
            camera,
            size_px,
            middle_px: DVec2::new(f64::from(size_px[0]), f64::from(size_px[1])) / 2.0,
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

    /// Is all of it beyond the horizon?
    fn is_hidden(&self, cap: &Cap) -> bool {
        self.behind.is_none() && cap.angle_to(self.up) - cap.radius > self.horizon
    }

    /// May it reach the place opposite the camera?
    fn may_be_opposite(&self, cap: &Cap) -> bool {
        PI - cap.angle_to(self.up) <= cap.radius + 1e-6
    }

    /// What rings cover, added up in their order however many cores there are.
    fn cover(&self, rings: &[Ring]) -> Cover {
        let next = AtomicUsize::new(0);
        let all: Vec<OnceLock<Covered>> = rings.iter().map(|_ring| OnceLock::new()).collect();
        let work = || {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(ring) = rings.get(number) else {
                    return;
                };
                if let Some(covered) = self.covered(ring) {
                    // Set once: a number is taken by one thread.
                    drop(all[number].set(covered));
                }
            }
        };
        thread::scope(|scope| {
            for _other in 1..cores() {
                scope.spawn(work);
            }
            work();
        });
        let mut cover = Cover::new(self.size_px);
        for covered in all.iter().filter_map(OnceLock::get) {
            cover.add_everywhere(covered.everywhere);
            cover.add(&covered.outline);
        }
        cover
    }

    /// What one ring covers; none if it cannot be seen.
    fn covered(&self, ring: &Ring) -> Option<Covered> {
        if let Some(behind) = self.behind {
            // All of the globe is round the camera, and what holds the place behind it covers all but what it leaves out.
            let is_all_round = ring.cap.angle_to(behind) <= ring.cap.radius + 1e-6
                && turns_round(behind, ring) == ring.sign;
            return Some(Covered {
                everywhere: if is_all_round { ring.sign } else { 0 },
                outline: self.outline_from_inside(ring),
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
            outline: self.outline(ring),
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
        let ends = ring.corners.iter().zip(ring.corners.iter().cycle().skip(1));
        let steps = ends.map(|(a, b)| short_way(self.azimuth(*b) - self.azimuth(*a)));
        (steps.sum::<f64>() / TAU).round() as i32
    }

    /// An outline as it is seen, hidden parts led round the globe, what lies behind the camera cut off.
    fn outline(&self, ring: &Ring) -> Vec<DVec2> {
        let mut path = Vec::with_capacity(ring.corners.len() + 16);
        let ends = ring.corners.iter().zip(ring.corners.iter().cycle().skip(1));
        for (&a, &b) in ends {
            let (from, to) = (self.above(a), self.above(b));
            let crossing = || a + (b - a) * (from / (from - to));
            match (from >= 0.0, to >= 0.0) {
                (true, true) => path.push(b),
                (true, false) => {
                    let edge = crossing();
                    path.push(edge);
                    self.lead_round(&mut path, edge, b);
                }
                (false, true) => {
                    let edge = crossing();
                    self.lead_round(&mut path, a, edge);
                    path.extend([edge, b]);
                }
                (false, false) => self.lead_round(&mut path, a, b),
            }
        }
        self.ahead(&path)
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
        let mut seen = Vec::with_capacity(path.len() + 4);
        let ends = path.iter().zip(path.iter().cycle().skip(1));
        for (&a, &b) in ends {
            let (from, to) = (self.camera.ahead(a), self.camera.ahead(b));
            if (from >= 0.0) != (to >= 0.0) {
                seen.push(self.seen_px(a + (b - a) * (from / (from - to))));
            }
            if to >= 0.0 {
                seen.push(self.seen_px(b));
            }
        }
        seen
    }

    fn shores(&self) -> Mask {
        let mut mask = Mask::new([0.0; 2], self.size_px);
        let per_rad = self.camera.focal_px / self.camera.nearest;
        for (rings, pen) in [(&*LAND_RINGS, Pen::COAST), (&*LAKE_RINGS, LAKE_PEN)] {
            for ring in rings {
                if self.is_hidden(&ring.cap) || ring.cap.radius * per_rad < LEAST_OUTLINE_PX {
                    continue;
                }
                let ends = ring.corners.iter().zip(ring.corners.iter().cycle().skip(1));
                for ((a, b), _) in ends.zip(&ring.is_shore).filter(|(_, is_shore)| **is_shore) {
                    self.draw(&mut mask, pen, [*a, *b]);
                }
            }
        }
        mask
    }

    fn borders(&self) -> Mask {
        let mut mask = Mask::new([0.0; 2], self.size_px);
        for border in BORDERS.iter().filter(|border| !self.is_hidden(&border.cap)) {
            for pair in border.corners.windows(2) {
                self.draw(&mut mask, BORDER_PEN, [pair[0], pair[1]]);
            }
        }
        mask
    }

    /// Draws the part of a line that is seen.
    fn draw(&self, mask: &mut Mask, pen: Pen, ends: [DVec3; 2]) {
        let seen = clipped(ends, |place| self.above(place))
            .and_then(|ends| clipped(ends, |place| self.camera.ahead(place)));
        if let Some([a, b]) = seen {
            mask.draw(pen, self.seen_px(a), self.seen_px(b));
        }
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
    // The axes of eq. 4 are left-handed: their pair goes round clockwise.
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
