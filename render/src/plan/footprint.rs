//! The part of the globe that a camera sees: a cap round a place, and places all over it. Lengths in earth radii, angles
//! in radians.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Sight lines round the edge of what a tilted camera sees, and round each circle within it.
const EDGE_RAYS: u32 = 64;
/// Circles of sight lines from the middle of what it sees to the edge.
const CIRCLES: u32 = 8;
/// How suddenly what is seen last rises from the lowest to the highest as the limb comes near.
const LIMB_POWER: i32 = 8;
/// What lies between two of them reaches no farther than this beyond them.
const SLACK: f64 = 1.02;
/// Halvings of the search for the cap's middle.
const SEARCH_STEPS: u32 = 40;

/// A cap within which particles can be seen, in another within which they can shadow what is seen.
pub(super) struct Footprint {
    /// Both caps' middle, length 1.
    pub center: DVec3,
    pub seen: f64,
    pub drawn: f64,
    /// Where sight lines all over the picture enter and leave what is drawn; empty for a camera that looks straight down,
    /// whose cap says as much.
    pub places: Vec<DVec3>,
}

/// A place over the globe, seen from the point below the camera: angle from there, and direction against the heading.
#[derive(Clone, Copy)]
struct Spot {
    away: f64,
    azimuth: f64,
}

/// From a camera at a height to the nearest ground with sight lines of at least this angle from straight down.
pub(super) fn nearest_ground(height: f64, angle: f64) -> f64 {
    let distance = 1.0 + height;
    let limb = (1.0 / distance).asin();
    let angle = angle.min(limb);
    if angle == 0.0 {
        return height;
    }
    let along = distance * angle.cos();
    along - (1.0 - (distance * angle.sin()).powi(2)).max(0.0).sqrt()
}

impl Footprint {
    /// That of a camera at a height that looks straight down, `corner` from the middle of its picture to the corner.
    pub(super) fn below(
        up: DVec3,
        height: f64,
        corner: f64,
        heights: [f64; 2],
        [margin, shadow]: [f64; 2],
    ) -> Self {
        let distance = 1.0 + height;
        let deepest = 1.0 + heights[0];
        let horizon = (1.0 / distance).acos() + (1.0 / (1.0 + heights[1])).acos() + margin;
        let sine = distance * corner.sin() / deepest;
        let [seen, drawn] = if sine >= 1.0 {
            // What is behind the horizon shadows what is on it.
            [horizon, horizon + shadow].map(|angle| angle.min(PI))
        } else {
            let seen = (sine.asin() - corner + margin).min(horizon);
            [seen, seen + 2.0 * margin + shadow].map(|angle| angle.min(PI))
        };
        Self {
            center: up,
            seen,
            drawn,
            places: vec![],
        }
    }

    /// That of a camera whose sight lines lie within a cone: `tilt` is the angle of its axis from straight down, towards
    /// `ahead`, `corner` the one between axis and edge. Changes without a jump as the camera moves.
    pub(super) fn ahead(
        [up, ahead]: [DVec3; 2],
        height: f64,
        [tilt, corner]: [f64; 2],
        heights: [f64; 2],
        [margin, shadow]: [f64; 2],
    ) -> Self {
        let spots = circle(height, [tilt, corner], heights);
        let reach = |middle: f64| {
            let (sin_m, cos_m) = middle.sin_cos();
            let cosines = spots.iter().flatten().map(|spot| {
                let (sin_a, cos_a) = spot.away.sin_cos();
                cos_m * cos_a + sin_m * sin_a * spot.azimuth.cos()
            });
            cosines.fold(1.0, f64::min).clamp(-1.0, 1.0).acos()
        };
        // The farthest of places is nearest from one middle along the heading: its distance falls before and grows behind.
        let mut span = [0.0, PI / 2.0];
        for _ in 0..SEARCH_STEPS {
            let third = (span[1] - span[0]) / 3.0;
            let inner = [span[0] + third, span[1] - third];
            if reach(inner[0]) <= reach(inner[1]) {
                span[1] = inner[1];
            } else {
                span[0] = inner[0];
            }
        }
        let middle = f64::midpoint(span[0], span[1]);
        let seen = reach(middle) * SLACK + margin;
        let (sin_m, cos_m) = middle.sin_cos();
        let side = ahead.cross(up);
        let place = |spot: Spot, height: f64| {
            let (sin_a, cos_a) = spot.away.sin_cos();
            let (sin_z, cos_z) = spot.azimuth.sin_cos();
            (up * cos_a + (ahead * cos_z + side * sin_z) * sin_a) * (1.0 + height)
        };
        let corners = (0..=CIRCLES).map(|step| corner * f64::from(step) / f64::from(CIRCLES));
        // A sight line that passes the limb leaves at the top; the nearer one comes to that, the higher is what it sees last.
        let farthest = farthest(height, heights);
        let last = |away: f64| {
            let share = (away / farthest).clamp(0.0, 1.0).powi(LIMB_POWER);
            heights[0] + (heights[1] - heights[0]) * share
        };
        let places = corners
            .flat_map(|corner| circle(height, [tilt, corner], heights))
            .flat_map(|[left, entered]| {
                let first = heights[1].min(height);
                [place(left, last(left.away)), place(entered, first)]
            });
        Self {
            center: up * cos_m + ahead * sin_m,
            seen: seen.min(PI),
            drawn: (seen + 2.0 * margin + shadow).min(PI),
            places: places.collect(),
        }
    }

    /// Least and largest coordinate of the places along a direction.
    pub(super) fn along(&self, direction: DVec3) -> Option<[f64; 2]> {
        let reach = self.places.iter().map(|place| place.dot(direction));
        reach.fold(None, |range: Option<[f64; 2]>, at| {
            let [low, high] = range.unwrap_or([at; 2]);
            Some([low.min(at), high.max(at)])
        })
    }
}

/// How far from below the camera what is highest is seen behind the limb.
fn farthest(height: f64, heights: [f64; 2]) -> f64 {
    let (inner, outer) = (1.0 + heights[0], 1.0 + heights[1]);
    (inner / (1.0 + height)).min(1.0).acos() + (inner / outer).acos()
}

/// Where sight lines round a cone leave what is drawn and where they come to it.
fn circle(height: f64, [tilt, corner]: [f64; 2], heights: [f64; 2]) -> Vec<[Spot; 2]> {
    let distance = 1.0 + height;
    let (inner, outer) = (1.0 + heights[0], 1.0 + heights[1]);
    let limb = (inner / distance).min(1.0).acos();
    let farthest = farthest(height, heights);
    let ground = |off_nadir: f64| {
        let sine = distance * off_nadir.sin() / inner;
        if off_nadir >= PI / 2.0 || sine >= 1.0 {
            return farthest;
        }
        (sine.asin() - off_nadir) * farthest / limb
    };
    let entry = |off_nadir: f64| {
        let sine = distance * off_nadir.sin() / outer;
        if distance <= outer {
            0.0
        } else if off_nadir >= PI / 2.0 || sine >= 1.0 {
            farthest
        } else {
            sine.asin() - off_nadir
        }
    };
    let (sin_t, cos_t) = tilt.sin_cos();
    let (sin_c, cos_c) = corner.sin_cos();
    let spots = (0..EDGE_RAYS).map(|ray| {
        let (sin_r, cos_r) = (f64::from(ray) / f64::from(EDGE_RAYS) * TAU).sin_cos();
        // A sight line's parts down, ahead and sideways.
        let down = cos_t * cos_c - sin_t * sin_c * cos_r;
        let forth = sin_t * cos_c + cos_t * sin_c * cos_r;
        let off_nadir = down.clamp(-1.0, 1.0).acos();
        let azimuth = (sin_c * sin_r).atan2(forth);
        [ground(off_nadir), entry(off_nadir)].map(|away| Spot { away, azimuth })
    });
    spots.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEIGHTS: [f64; 2] = [-0.02, 0.15];

    /// Does the footprint hold every place between the heights along sight lines all over the cone?
    fn holds(height: f64, tilt: f64, corner: f64) {
        let (up, ahead, side) = (DVec3::Z, DVec3::X, DVec3::Y);
        let footprint = Footprint::ahead([up, ahead], height, [tilt, corner], HEIGHTS, [0.0, 0.0]);
        let camera = up * (1.0 + height);
        let axis = ahead * tilt.sin() - up * tilt.cos();
        let across = up * tilt.sin() + ahead * tilt.cos();
        let mut seen = 0;
        for out in 0..=12 {
            for round in 0..48 {
                let angle = corner * f64::from(out) / 12.0;
                let (sin_r, cos_r) = (f64::from(round) / 48.0 * TAU + 0.01).sin_cos();
                let sight = axis * angle.cos() + (across * cos_r + side * sin_r) * angle.sin();
                for step in 1..4000 {
                    let place = camera + sight * (f64::from(step) * 1e-3 * (1.0 + height));
                    let far = place.length();
                    if far < 1.0 + HEIGHTS[0] {
                        break;
                    }
                    if far > 1.0 + HEIGHTS[1] {
                        continue;
                    }
                    seen += 1;
                    let off = (place / far).dot(footprint.center).clamp(-1.0, 1.0).acos();
                    assert!(
                        off <= footprint.seen + 1e-9,
                        "{height} {tilt} {corner}: {off} beyond {}",
                        footprint.seen
                    );
                }
            }
        }
        assert!(seen > 0, "{height} {tilt} {corner} sees nothing");
    }

    #[test]
    fn what_a_tilted_camera_sees_lies_in_its_footprint() {
        for height in [0.01, 0.1, 0.5, 2.0] {
            for tilt_deg in [1.0f64, 20.0, 45.0, 70.0, 85.0] {
                for corner_deg in [5.0f64, 30.0, 45.0] {
                    let limb = (1.15f64 / (1.0 + height)).min(1.0).asin();
                    if tilt_deg.to_radians() - corner_deg.to_radians() < limb {
                        holds(height, tilt_deg.to_radians(), corner_deg.to_radians());
                    }
                }
            }
        }
    }

    #[test]
    fn a_footprint_is_hardly_larger_than_what_is_seen_and_changes_without_a_jump() {
        let at = |tilt_deg: f64| {
            let cone = [tilt_deg.to_radians(), 0.5];
            Footprint::ahead([DVec3::Z, DVec3::X], 0.1, cone, HEIGHTS, [0.0, 0.0])
        };
        // Half of the way to where the highest is seen behind the limb, or a little more.
        let farthest = (0.98f64 / 1.1).acos() + (0.98f64 / 1.15).acos();
        assert!(at(60.0).seen < 0.75 * farthest, "{}", at(60.0).seen);
        let mut before = at(1.0);
        for step in 1..800 {
            let now = at(1.0 + f64::from(step) * 0.1);
            let moved = now.center.distance(before.center) + (now.seen - before.seen).abs();
            // Steep where the limb comes into sight, as the ground runs away there.
            assert!(moved < 0.08, "{step}: {moved}");
            before = now;
        }
    }

    #[test]
    fn the_nearest_ground_is_below_or_at_the_limb() {
        assert!((nearest_ground(0.1, 0.0) - 0.1).abs() < 1e-15);
        let limb = (1.0f64 / 1.1).asin();
        let tangent = (1.1f64 * 1.1 - 1.0).sqrt();
        assert!((nearest_ground(0.1, limb) - tangent).abs() < 1e-6);
        assert!((nearest_ground(0.1, 2.0) - tangent).abs() < 1e-6);
        assert!(nearest_ground(0.1, 0.5) > 0.1);
    }
}
