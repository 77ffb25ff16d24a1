//! The part of the globe that a camera sees: a cap round a place, and places all over it. Lengths in earth radii, angles
//! in radians.

use std::f64::consts::{PI, TAU};

use contract::camera::CORE_DEPTH_M;
use contract::earth::SPHERE_RADIUS_M;
use glam::DVec3;

/// Radius of the sphere below all particles that hides what lies beyond it from a camera below the sea surface.
pub(super) const CORE: f64 = 1.0 - CORE_DEPTH_M / SPHERE_RADIUS_M;
/// Sight lines round the edge of what a tilted camera sees, and round each circle within it.
const EDGE_RAYS: u32 = 64;
/// Circles of sight lines from the middle of what it sees to the edge.
const CIRCLES: u32 = 8;
/// How suddenly what is seen last rises from the lowest to the highest as the limb comes near.
const LIMB_POWER: i32 = 8;
/// What lies between two of them reaches no farther than this beyond them.
const SLACK: f64 = 1.02;
/// The same from below the sea surface, where what is farthest is seen along one line that touches the core.
const SLACK_BELOW: f64 = 1.05;
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
    /// Above the sea surface.
    height: f64,
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

/// From a camera below the sea surface to the nearest of the surface and of the core, with sight lines between two
/// angles from straight down. The core's outline counts in sight or not, so that nothing jumps when it comes into sight.
pub(super) fn nearest_from_below(height: f64, [lowest, highest]: [f64; 2]) -> f64 {
    let distance = 1.0 + height;
    let (sin_up, cos_up) = (PI - highest).max(0.0).sin_cos();
    let ceiling = (1.0 - (distance * sin_up).powi(2)).max(0.0).sqrt() - distance * cos_up;
    let limb = (CORE / distance).min(1.0).asin();
    let (sin_down, cos_down) = lowest.clamp(0.0, limb).sin_cos();
    let core = distance * cos_down
        - (CORE * CORE - (distance * sin_down).powi(2))
            .max(0.0)
            .sqrt();
    ceiling.min(core)
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
        let mut spots = circle(height, [tilt, corner], heights);
        if height < 0.0 {
            spots.extend(limb_on_edge(height, [tilt, corner], heights));
        }
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
        let slack = if height < 0.0 { SLACK_BELOW } else { SLACK };
        let seen = reach(middle) * slack + margin;
        let (sin_m, cos_m) = middle.sin_cos();
        let side = ahead.cross(up);
        let place = |spot: Spot| {
            let (sin_a, cos_a) = spot.away.sin_cos();
            let (sin_z, cos_z) = spot.azimuth.sin_cos();
            (up * cos_a + (ahead * cos_z + side * sin_z) * sin_a) * (1.0 + spot.height)
        };
        let corners = (0..=CIRCLES).map(|step| corner * f64::from(step) / f64::from(CIRCLES));
        let places = corners
            .flat_map(|corner| circle(height, [tilt, corner], heights))
            .flatten()
            .map(place);
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

/// How far from below the camera what is highest is seen behind the limb of a sphere.
fn farthest(height: f64, inner: f64, outer: f64) -> f64 {
    (inner / (1.0 + height)).min(1.0).acos() + (inner / outer).acos()
}

/// Where sight lines round a cone leave what is drawn and where they come to it.
fn circle(height: f64, [tilt, corner]: [f64; 2], heights: [f64; 2]) -> Vec<[Spot; 2]> {
    let (sin_t, cos_t) = tilt.sin_cos();
    let (sin_c, cos_c) = corner.sin_cos();
    let spots = (0..EDGE_RAYS).map(|ray| {
        let (sin_r, cos_r) = (f64::from(ray) / f64::from(EDGE_RAYS) * TAU).sin_cos();
        // A sight line's parts down, ahead and sideways.
        let down = cos_t * cos_c - sin_t * sin_c * cos_r;
        let forth = sin_t * cos_c + cos_t * sin_c * cos_r;
        let off_nadir = down.clamp(-1.0, 1.0).acos();
        let azimuth = (sin_c * sin_r).atan2(forth);
        let ends = if height < 0.0 {
            ends_from_below(height, off_nadir, heights)
        } else {
            ends_from_above(height, off_nadir, heights)
        };
        ends.map(|[away, height]| Spot {
            away,
            azimuth,
            height,
        })
    });
    spots.collect()
}

/// The sight lines round the edge of a cone that touch the core: what is farthest from below the sea surface is seen along
/// these, if there are any.
fn limb_on_edge(height: f64, [tilt, corner]: [f64; 2], heights: [f64; 2]) -> Vec<[Spot; 2]> {
    let limb = (CORE / (1.0 + height)).min(1.0).asin();
    let (sin_t, cos_t) = tilt.sin_cos();
    let (sin_c, cos_c) = corner.sin_cos();
    let cos_r = (cos_t * cos_c - limb.cos()) / (sin_t * sin_c);
    if !(-1.0..=1.0).contains(&cos_r) {
        return vec![];
    }
    let forth = sin_t * cos_c + cos_t * sin_c * cos_r;
    let azimuth = (sin_c * cos_r.acos().sin()).atan2(forth);
    let ends = ends_from_below(height, limb, heights);
    let at = |azimuth: f64| {
        ends.map(|[away, height]| Spot {
            away,
            azimuth,
            height,
        })
    };
    [azimuth, -azimuth].map(at).to_vec()
}

/// Where a sight line at an angle from straight down leaves what is drawn and where it comes to it: how far from below the
/// camera, and the height.
fn ends_from_above(height: f64, off_nadir: f64, heights: [f64; 2]) -> [[f64; 2]; 2] {
    let distance = 1.0 + height;
    let (inner, outer) = (1.0 + heights[0], 1.0 + heights[1]);
    let limb = (inner / distance).min(1.0).acos();
    let farthest = farthest(height, inner, outer);
    let sine = distance * off_nadir.sin() / inner;
    let left = if off_nadir >= PI / 2.0 || sine >= 1.0 {
        farthest
    } else {
        (sine.asin() - off_nadir) * farthest / limb
    };
    let sine = distance * off_nadir.sin() / outer;
    let entered = if distance <= outer {
        0.0
    } else if off_nadir >= PI / 2.0 || sine >= 1.0 {
        farthest
    } else {
        sine.asin() - off_nadir
    };
    [
        [left, last_height(left / farthest, heights)],
        [entered, heights[1].min(height)],
    ]
}

/// The same from below the sea surface: a sight line ends at the core or leaves at the top, farther round the globe.
fn ends_from_below(height: f64, off_nadir: f64, heights: [f64; 2]) -> [[f64; 2]; 2] {
    let (distance, outer) = (1.0 + height, 1.0 + heights[1]);
    let miss = distance * off_nadir.sin();
    let left = if off_nadir < PI / 2.0 && miss < CORE {
        let limb = (CORE / distance).acos();
        let share = ((miss / CORE).asin() - off_nadir) / limb;
        let farthest = farthest(height, CORE, outer);
        [share * farthest, last_height(share, heights)]
    } else {
        [PI - (miss / outer).asin() - off_nadir, heights[1]]
    };
    [left, [0.0, height]]
}

/// A sight line that passes the limb leaves at the top; the nearer one comes to that, the higher is what it sees last.
fn last_height(share_of_farthest: f64, heights: [f64; 2]) -> f64 {
    let share = share_of_farthest.clamp(0.0, 1.0).powi(LIMB_POWER);
    heights[0] + (heights[1] - heights[0]) * share
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
                    let deepest = if height < 0.0 { CORE } else { 1.0 + HEIGHTS[0] };
                    if far < deepest {
                        break;
                    }
                    if !(1.0 + HEIGHTS[0]..=1.0 + HEIGHTS[1]).contains(&far) {
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
    fn what_a_camera_below_the_sea_sees_lies_in_its_footprint() {
        for height in [-0.001, -0.01, -0.06, -0.15] {
            for tilt_deg in [45.0f64, 70.0, 90.0, 110.0, 150.0, 180.0] {
                for corner_deg in [5.0f64, 30.0, 60.0] {
                    // What looks at the core alone sees no particles.
                    if (tilt_deg + corner_deg).to_radians() > (CORE / (1.0 + height)).asin() + 0.1 {
                        holds(height, tilt_deg.to_radians(), corner_deg.to_radians());
                    }
                }
            }
        }
        // All of it moves without a jump, over the limb of the core too, and looking up is seeing little of it.
        let at = |tilt_deg: f64| {
            let cone = [tilt_deg.to_radians(), 0.5];
            Footprint::ahead([DVec3::Z, DVec3::X], -0.06, cone, HEIGHTS, [0.0, 0.0])
        };
        assert!(at(180.0).seen < 0.35 * at(80.0).seen, "{}", at(180.0).seen);
        let mut before = at(0.0);
        for step in 1..1800 {
            let now = at(f64::from(step) * 0.1);
            let moved = now.center.distance(before.center) + (now.seen - before.seen).abs();
            assert!(moved < 0.08, "{step}: {moved}");
            before = now;
        }
    }

    #[test]
    fn from_below_the_nearest_is_the_surface_above_or_the_core() {
        let near =
            |tilt: f64, corner: f64| nearest_from_below(-0.06, [tilt - corner, tilt + corner]);
        assert!((near(PI, 0.3) - 0.06).abs() < 1e-12);
        assert!((near(0.0, 0.3) - (0.94 - CORE)).abs() < 1e-12);
        // Level: 1 - 0.94² is the square of half a chord; the limb of the core is as far away as Pythagoras has it.
        assert!((near(PI / 2.0, 0.0) - (1.0f64 - 0.94 * 0.94).sqrt()).abs() < 1e-12);
        let limb = (CORE / 0.94).asin();
        assert!((near(limb, 0.0) - (0.94f64 * 0.94 - CORE * CORE).sqrt()).abs() < 1e-12);
        let mut before = near(0.0, 0.1);
        for step in 1..3142 {
            let now = near(f64::from(step) * 1e-3, 0.1);
            assert!((now - before).abs() < 0.05, "{step}: {before} {now}");
            before = now;
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
