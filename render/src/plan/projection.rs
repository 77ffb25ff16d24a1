//! Where places are seen in a globe view, for what is drawn over finished pictures: the camera is the one that draws them.

use contract::earth::SPHERE_RADIUS_M;
use contract::grid::LonLatDeg;
use contract::job::View;
use glam::{DVec2, DVec3};

use super::camera::{self, Camera};

/// Halvings of the way between two corners of a line on which it goes out of sight: to a billionth of it.
const HALVINGS: u32 = 30;

/// Half of a length of ground that is measured, earth radii: metres are small for any camera, and large for the numbers.
const STEP: f64 = 1e-6;

/// From places to pixels of a globe view.
pub struct Projection {
    camera: Camera,
    middle_px: DVec2,
}

/// A place ahead of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Pixels from the left edge of the picture to the right; the middle of its first pixel is at 0.5.
    pub x_px: f64,
    /// Pixels from the upper edge of the picture down.
    pub y_px: f64,
    /// Is the globe not in between?
    pub is_visible: bool,
}

impl Projection {
    /// That of a globe view; none of a map tile.
    pub fn of(view: &View) -> Option<Self> {
        let [width, height] = view.size_px().map(f64::from);
        Some(Self {
            camera: Camera::of(view)?,
            middle_px: DVec2::new(width, height) / 2.0,
        })
    }

    /// The place below the camera, and how far it is from the globe's middle, earth radii.
    pub fn stands(&self) -> (LonLatDeg, f64) {
        let from_middle = self.camera.place.length();
        (degrees(self.camera.place / from_middle), from_middle)
    }

    /// Where a place at a height in metres above the sphere is seen; none behind the camera or closer to it than
    /// anything is drawn.
    pub fn seen(&self, place: LonLatDeg, height_m: f64) -> Option<Seen> {
        let place = normal(place) * (1.0 + height_m / SPHERE_RADIUS_M);
        if self.camera.ahead(place) < 0.0 {
            return None;
        }
        let DVec2 { x, y } = self.px(place);
        Some(Seen {
            x_px: x,
            y_px: y,
            is_visible: self.is_clear(place),
        })
    }

    /// How much the ground at a place faces the camera: the cosine between the vertical there and the way to the camera,
    /// 1 below it, 0 at the horizon, negative behind. From below the sea surface the same of its underside.
    pub fn facing(&self, place: LonLatDeg) -> f64 {
        let up = normal(place);
        let facing = (self.camera.place - up).normalize_or_zero().dot(up);
        if self.camera.is_below() {
            -facing
        } else {
            facing
        }
    }

    /// Does the camera stand below the sea surface?
    pub fn is_below(&self) -> bool {
        self.camera.is_below()
    }

    /// From the place below or above the camera to the farthest ground that it sees, radians.
    pub fn horizon(&self) -> f64 {
        self.camera.horizon()
    }

    /// The parts of a line on the ground that are seen, pixels; a line is straight in degrees from corner to corner.
    /// Where it goes behind the globe or the camera it ends there, to a millionth of a pixel for corners that are close.
    pub fn lines(&self, corners: &[LonLatDeg]) -> Vec<Vec<[f64; 2]>> {
        let mut parts = vec![];
        let mut part = vec![];
        let mut last: Option<LonLatDeg> = None;
        for &corner in corners {
            let is_seen = self.clearance(corner) >= 0.0;
            if let Some(from) = last {
                match (self.clearance(from) >= 0.0, is_seen) {
                    (true, false) => {
                        part.push(self.ground_px(self.edge(from, corner)));
                        parts.push(std::mem::take(&mut part));
                    }
                    (false, true) => part.push(self.ground_px(self.edge(corner, from))),
                    (true, true) | (false, false) => (),
                }
            }
            if is_seen {
                part.push(self.ground_px(corner));
            }
            last = Some(corner);
        }
        parts.push(part);
        parts.retain(|part| part.len() > 1);
        parts
    }

    /// The ground seen at a pixel; none where the sky is.
    pub fn ground_at(&self, [x_px, y_px]: [f64; 2]) -> Option<LonLatDeg> {
        let Camera {
            place,
            right,
            top,
            forward,
            focal_px,
            ..
        } = self.camera;
        let from_middle = DVec2::new(x_px, y_px) - self.middle_px;
        let sight = forward * focal_px + right * from_middle.x - top * from_middle.y;
        let sight = sight.normalize_or_zero();
        let along = -place.dot(sight);
        let miss_sq = place.length_squared() - along * along;
        let half_chord = (1.0 - miss_sq).max(0.0).sqrt();
        let hides = self.camera.hides();
        let way = match (self.camera.is_below(), along > 0.0, miss_sq < hides * hides) {
            // The core, or the sky.
            (true, true, true) | (false, false, _) | (false, true, false) => return None,
            (true, _, _) => along + half_chord,
            (false, true, true) => along - half_chord,
        };
        let ground = place + sight * way;
        Some(degrees(ground))
    }

    /// Pixels of a metre of ground at a place, across the picture (x to the right of it) and up the slope of the ground
    /// away from the camera: the two sides of a small square. None where the place is not seen.
    pub fn px_per_m(&self, place: LonLatDeg) -> Option<[f64; 2]> {
        if self.clearance(place) < 0.0 {
            return None;
        }
        let up = normal(place);
        let level = self.camera.right - up * self.camera.right.dot(up);
        let across = level.try_normalize()?;
        let away = across.cross(up);
        let length = |way: DVec3| {
            let apart = self.px(up + way * STEP) - self.px(up - way * STEP);
            apart.length() / (2.0 * STEP * SPHERE_RADIUS_M)
        };
        Some([length(across), length(away)])
    }

    /// Where the globe's middle is seen; none behind the camera.
    pub fn middle_of_globe(&self) -> Option<[f64; 2]> {
        let is_ahead = self.camera.place.dot(self.camera.forward) < 0.0;
        is_ahead.then(|| self.px(DVec3::ZERO).to_array())
    }

    fn px(&self, place: DVec3) -> DVec2 {
        self.middle_px + self.camera.seen_px(place)
    }

    fn ground_px(&self, place: LonLatDeg) -> [f64; 2] {
        self.px(normal(place)).to_array()
    }

    /// Is nothing of the globe between the camera and a place? Of one below the ground, nothing that lies deeper; for a
    /// camera below the sea surface, nothing of the core.
    fn is_clear(&self, place: DVec3) -> bool {
        let sight = place - self.camera.place;
        let nearest = -self.camera.place.dot(sight) / sight.length_squared();
        // All of the way leads away from the globe, or towards it.
        if nearest <= 0.0 || nearest >= 1.0 {
            return true;
        }
        let from_middle = self.camera.place + sight * nearest;
        let hides = self.camera.hides();
        from_middle.length_squared() >= hides * hides
    }

    /// At least 0 where ground is before the horizon and ahead of the camera; lengths in earth radii.
    fn clearance(&self, place: LonLatDeg) -> f64 {
        let ground = normal(place);
        let least = if self.camera.is_below() {
            self.camera.place.length() * self.camera.horizon().cos()
        } else {
            1.0
        };
        (self.camera.place.dot(ground) - least).min(self.camera.ahead(ground))
    }

    /// The last place that is seen on the way from one that is to one that is not.
    fn edge(&self, seen: LonLatDeg, unseen: LonLatDeg) -> LonLatDeg {
        let at = |share: f64| LonLatDeg {
            lon: seen.lon + (unseen.lon - seen.lon) * share,
            lat: seen.lat + (unseen.lat - seen.lat) * share,
        };
        let (mut near, mut far) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (near + far);
            if self.clearance(at(middle)) >= 0.0 {
                near = middle;
            } else {
                far = middle;
            }
        }
        at(near)
    }
}

fn degrees(normal: DVec3) -> LonLatDeg {
    LonLatDeg {
        lon: normal.x.atan2(normal.y).to_degrees(),
        lat: normal.z.clamp(-1.0, 1.0).asin().to_degrees(),
    }
}

fn normal(place: LonLatDeg) -> DVec3 {
    let [_east, _north, up] = camera::axes_at(place.lon, place.lat);
    up
}

#[cfg(test)]
mod tests;
