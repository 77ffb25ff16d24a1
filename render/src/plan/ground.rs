//! What lies in every pixel of a globe view, by the outlines of land, lakes and borders: exact shares of areas, and lines.

use std::cell::RefCell;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::camera::Camera;
use crate::coast::ring::{BORDERS, Border, Cap, LAKE_RINGS, LAND_RINGS, Ring, Run};
use crate::coast::{Cover, Mask, Pen};

/// Rows of a mask that are made as one, in memory that stays near a core; so few that cores end together.
const BAND_PX: usize = 16;
/// Edges of an outline that one core goes along at once.
const EDGES_AT_ONCE: usize = 1024;
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

/// Runs of an outline that one core goes along at once.
const RUNS_AT_ONCE: usize = 16;
/// What is farther outside the picture than this is not seen, nor is any of a line there, pixels.
const ASIDE_PX: f64 = 4.0;

/// How far outside corners behind a camera in the globe are led round the picture, half diagonals.
const OUTSIDE: f64 = 4.0;

/// What is wanted of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) land: bool,
    pub(super) coasts: bool,
    pub(super) borders: bool,
}

/// A word for every pixel: shares of land, lakes, shores and borders, 0 to 255, the first in the lowest bits. Made on all
/// cores, band by band: a camera that moves needs one for every picture. The same words however many cores there are,
/// whatever was in the memory that is given for them.
pub(super) fn mask(
    camera: &Camera,
    size_px: [u32; 2],
    wanted: Wanted,
    words: Vec<u32>,
) -> Vec<u32> {
    let all = Ground {
        land: &LAND_RINGS,
        lakes: &LAKE_RINGS,
        borders: &BORDERS,
    };
    all.mask(camera, size_px, wanted, words)
}

/// What is on the ground.
struct Ground<'a> {
    land: &'a [Ring],
    lakes: &'a [Ring],
    borders: &'a [Border],
}

impl Ground<'_> {
    fn mask(
        &self,
        camera: &Camera,
        size_px: [u32; 2],
        wanted: Wanted,
        mut words: Vec<u32>,
    ) -> Vec<u32> {
        let sight = &Sight::new(camera, size_px);
        let outlines = |rings| {
            wanted
                .land
                .then(|| Outlines::of(&sight.outlines(rings), size_px[1]))
        };
        let lines = |lines: Vec<Line>| ByBand::of(&lines, size_px[1], reached_px);
        let ((land, lakes), (shores, borders)) = rayon::join(
            || rayon::join(|| outlines(self.land), || outlines(self.lakes)),
            || {
                rayon::join(
                    || wanted.coasts.then(|| lines(sight.shores(self))),
                    || wanted.borders.then(|| lines(sight.borders(self.borders))),
                )
            },
        );
        let areas = [(land, 0), (lakes, 8)];
        let lines = [(shores, 16), (borders, 24)];
        let [width, height] = size_px.map(|px| px as usize);
        words.resize(width * height, 0);
        let bands = words.par_chunks_mut(BAND_PX * width).enumerate();
        bands.for_each(|(number, words)| {
            words.fill(0);
            let first_row = (number * BAND_PX) as u32;
            let size_px = [size_px[0], (words.len() / width) as u32];
            SUMS.with_borrow_mut(|sums| {
                for (outlines, shift) in &areas {
                    let Some(outlines) = outlines else {
                        continue;
                    };
                    let mut cover = Cover::within(std::mem::take(sums), first_row, size_px);
                    cover.add_everywhere(outlines.everywhere);
                    for [a, b] in outlines.edges.of_band(number) {
                        cover.add_edge(*a, *b);
                    }
                    cover.write(words, *shift);
                    *sums = cover.into_memory();
                }
            });
            for (lines, shift) in &lines {
                let lines = lines
                    .as_ref()
                    .map_or(&[][..], |lines| lines.of_band(number));
                if lines.is_empty() {
                    continue;
                }
                let mut mask = Mask::new([0.0, f64::from(first_row)], size_px);
                for (pen, [a, b]) in lines {
                    mask.draw(*pen, *a, *b);
                }
                mask.write(words, *shift);
            }
        });
        words
    }
}

/// What outlines cover together.
struct Outlines {
    /// All of the picture, so many times.
    everywhere: i32,
    edges: ByBand<[DVec2; 2]>,
}

impl Outlines {
    fn of(covered: &[Covered], height_px: u32) -> Self {
        let edges: Vec<_> = covered
            .iter()
            .flat_map(|one| one.edges.iter().copied())
            .collect();
        Self {
            everywhere: covered.iter().map(|one| one.everywhere).sum(),
            edges: ByBand::of(&edges, height_px, |[a, b]| [a.y.min(b.y), a.y.max(b.y)]),
        }
    }
}

/// Rows that a line reaches, pixels.
fn reached_px((pen, [a, b]): &Line) -> [f64; 2] {
    let reach_px = pen.reach_px() + 1.0;
    [a.y.min(b.y) - reach_px, a.y.max(b.y) + reach_px]
}

/// What is drawn, by the bands of rows that it reaches; in each in the order it was given in, since sums of numbers round.
struct ByBand<T> {
    /// For each band the end of its items.
    ends: Vec<usize>,
    items: Vec<T>,
}

impl<T: Copy> ByBand<T> {
    /// `reached`: the first and the last row that an item reaches, pixels; what is no number reaches none.
    fn of(given: &[T], height_px: u32, reached: impl Fn(&T) -> [f64; 2]) -> Self {
        let count = (height_px as usize).div_ceil(BAND_PX);
        let bands = |item: &T| {
            let [first, last] = reached(item).map(|row| row / BAND_PX as f64);
            let is_seen = last >= 0.0 && first < count as f64;
            let end = if is_seen { last as usize + 1 } else { 0 };
            (first.max(0.0) as usize)..end.min(count)
        };
        // Where the items of each band begin, and then, as they are laid there, end.
        let mut ends = vec![0; count + 1];
        for item in given {
            for band in bands(item) {
                ends[band + 1] += 1;
            }
        }
        for band in 1..=count {
            ends[band] += ends[band - 1];
        }
        let mut items = match given.first() {
            Some(any) => vec![*any; ends[count]],
            None => vec![],
        };
        for item in given {
            for band in bands(item) {
                items[ends[band]] = *item;
                ends[band] += 1;
            }
        }
        ends.truncate(count);
        Self { ends, items }
    }

    fn of_band(&self, number: usize) -> &[T] {
        let first = if number == 0 {
            0
        } else {
            self.ends[number - 1]
        };
        &self.items[first..self.ends[number]]
    }
}

thread_local! {
    /// Memory for the sums of one band: fresh memory costs more than what is done in it.
    static SUMS: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// A line as it is seen, pixels.
type Line = (Pen, [DVec2; 2]);

/// What one ring covers.
struct Covered {
    /// All of the picture, so many times.
    everywhere: i32,
    /// Of its outline, those that reach rows of the picture, in their order.
    edges: Vec<[DVec2; 2]>,
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
struct Sight<'a> {
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
    fn new(camera: &'a Camera, size_px: [u32; 2]) -> Self {
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
    fn outlines(&self, rings: &[Ring]) -> Vec<Covered> {
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

    fn shores(&self, ground: &Ground<'_>) -> Vec<Line> {
        let per_rad = self.camera.focal_px / self.camera.nearest;
        let rings = |rings: &[Ring], pen: Pen| -> Vec<Line> {
            let seen = rings.par_iter().filter(move |ring| {
                !self.is_hidden(&ring.cap) && ring.cap.radius * per_rad >= LEAST_OUTLINE_PX
            });
            let lines = seen.flat_map_iter(|ring| {
                let runs = ring.runs.iter().filter(|run| self.is_near(run));
                runs.flat_map(move |run| {
                    let edges = ring.edges(run).zip(&ring.is_shore[run.edges.clone()]);
                    let shores = edges.filter(|(_, is_shore)| **is_shore);
                    shores.filter_map(move |((a, b), _)| self.line(pen, [a, b]))
                })
            });
            lines.collect()
        };
        let (land, lakes) = rayon::join(
            || rings(ground.land, Pen::COAST),
            || rings(ground.lakes, LAKE_PEN),
        );
        [land, lakes].concat()
    }

    fn borders(&self, borders: &[Border]) -> Vec<Line> {
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

#[cfg(test)]
mod tests {
    use contract::camera::CameraAngles;
    use contract::job::View;

    use super::*;

    /// Is the middle of a pixel on the globe?
    fn is_on_globe(camera: &Camera, size_px: [u32; 2], at: usize) -> bool {
        let place = DVec2::new(
            f64::from(at as u32 % size_px[0]) + 0.5,
            f64::from(at as u32 / size_px[0]) + 0.5,
        );
        let [east, south] = (place - DVec2::from(size_px.map(f64::from)) / 2.0).to_array();
        let ray = camera.forward * camera.focal_px + camera.right * east - camera.top * south;
        let along = camera.place.dot(ray / ray.length());
        along < 0.0 && along * along > camera.place.length_squared() - 1.0
    }

    #[test]
    fn where_a_run_lies_decides_as_all_of_its_edges_do() {
        let single = |rings: &[Ring]| rings.iter().map(Ring::in_single_edges).collect::<Vec<_>>();
        let (land, lakes) = (single(&LAND_RINGS), single(&LAKE_RINGS));
        let borders: Vec<_> = BORDERS.iter().map(Border::in_single_edges).collect();
        let edge_by_edge = Ground {
            land: &land,
            lakes: &lakes,
            borders: &borders,
        };
        let wanted = Wanted {
            land: true,
            coasts: true,
            borders: true,
        };
        let size_px = [240, 135];
        // From afar, tilted low over coasts, at the pole, with Jamaica and with Eurasia opposite, and from below the sea.
        for (lon_deg, lat_deg, height_m, tilt_deg, heading_deg) in [
            (120.0, -10.0, 2e7, 0.0, 0.0),
            (-70.0, 20.0, 9e5, 60.0, 90.0),
            (170.0, 60.0, 3e5, 75.0, 200.0),
            (5.0, 52.0, 1e5, 70.0, 30.0),
            (0.0, 89.0, 3e6, 30.0, 10.0),
            (102.7, -18.1, 2e7, 0.0, 0.0),
            (-95.0, -50.0, 5e7, 0.0, 0.0),
            (-30.0, 10.0, -4e5, 60.0, 45.0),
        ] {
            let view = View::Globe {
                lon_deg,
                lat_deg,
                height_m,
                width_px: size_px[0],
                height_px: size_px[1],
                angles: CameraAngles {
                    tilt_deg,
                    heading_deg,
                    ..CameraAngles::NADIR
                },
            };
            let camera = Camera::of(&view).unwrap();
            let by_runs = mask(&camera, size_px, wanted, vec![]);
            let expected = edge_by_edge.mask(&camera, size_px, wanted, vec![]);
            // Beside the globe it says nothing: hidden outlines are led round there.
            let is_seen = |at: &usize| camera.is_below() || is_on_globe(&camera, size_px, *at);
            let seen: Vec<usize> = (0..expected.len()).filter(is_seen).collect();
            assert!(
                seen.iter().any(|at| expected[*at] != 0),
                "{view:?} has no land"
            );
            // Sums of other parts of the same whole round in another way.
            let share = |word: u32, shift: u32| (word >> shift) & 255;
            let is_apart = |at: usize| {
                [0, 8, 16, 24]
                    .map(|shift| share(by_runs[at], shift).abs_diff(share(expected[at], shift)))
                    .into_iter()
                    .max()
                    > Some(1)
            };
            let apart = seen.iter().filter(|at| is_apart(**at)).count();
            assert_eq!(apart, 0, "{view:?}");
        }
    }

    #[test]
    fn what_was_in_the_memory_of_a_mask_does_not_show() {
        let view = View::Globe {
            lon_deg: 10.0,
            lat_deg: 45.0,
            height_m: 4e6,
            width_px: 90,
            height_px: 50,
            angles: CameraAngles::NADIR,
        };
        let camera = Camera::of(&view).unwrap();
        let wanted = Wanted {
            land: true,
            coasts: true,
            borders: true,
        };
        let of = |memory: Vec<u32>| mask(&camera, [90, 50], wanted, memory);
        let fresh = of(vec![]);
        assert!(fresh.iter().any(|word| *word != 0));
        for memory in [vec![u32::MAX; 4500], vec![7; 10], vec![7; 9999]] {
            assert!(of(memory) == fresh);
        }
    }
}
