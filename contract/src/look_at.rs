//! A camera that looks at a place, and where that is in the end.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::ContractError;
use crate::camera::{
    CORE_DEPTH_M, CameraAngles, MAX_CAMERA_DEPTH_M, MAX_CAMERA_HEIGHT_M, MIN_CAMERA_HEIGHT_M,
};
use crate::earth::SPHERE_RADIUS_M;
use crate::grid::{LonLatDeg, wrap_lon_deg};
use crate::job::View;

/// So far within the limits of heights a camera stays that is turned to them, m: more than rounding.
const WITHIN_M: f64 = 1.0;

/// A camera that looks at a place, instead of one that stands over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAt {
    /// What is in the middle of the picture.
    pub target: LonLatDeg,
    /// From the target to the camera, m.
    pub distance_m: f64,
    /// Angles at the target: `tilt_deg` is that of the line of sight against the vertical there, 0 from straight above,
    /// 180 from straight below through the sea.
    pub angles: CameraAngles,
}

impl LookAt {
    /// The view of a picture of `size_px`.
    ///
    /// # Errors
    /// A tilt or a distance out of its limits.
    pub fn view(&self, [width_px, height_px]: [u32; 2]) -> Result<View, ContractError> {
        let (tilt, distance) = (self.angles.tilt_deg, self.distance_m);
        if !(MIN_CAMERA_HEIGHT_M..=MAX_CAMERA_HEIGHT_M).contains(&distance) {
            let reason = "1 km to 1 million km from the place that is looked at";
            let text = format!("{} km", distance / 1e3);
            return Err(ContractError::invalid("distance", &text, reason));
        }
        let below = tilts_from_below(distance);
        let is_below = below.is_some_and(|[least, most]| (least..=most).contains(&tilt));
        if !is_below && !(0.0..=90.0).contains(&tilt) {
            let from = distance / 1e3;
            let reason = match below {
                Some([least, most]) => format!(
                    "degrees from the vertical of the place that is looked at: 0 to 90 from above; from below the sea \
                     surface, {from} km away, {least:.1} to {most:.1}"
                ),
                None => format!(
                    "degrees from the vertical of the place that is looked at: 0 to 90; no camera below the sea surface \
                     is {from} km away from it"
                ),
            };
            return Err(ContractError::invalid("tilt", &tilt.to_string(), reason));
        }
        let (sin_tilt, cos_tilt) = tilt.to_radians().sin_cos();
        let above = SPHERE_RADIUS_M + distance * cos_tilt;
        // Angle at the earth's centre between target and camera.
        let away = (distance * sin_tilt).atan2(above);
        let (place, heading_deg) = self.camera_place(away);
        Ok(View::Globe {
            lon_deg: place.lon,
            lat_deg: place.lat,
            height_m: above.hypot(distance * sin_tilt) - SPHERE_RADIUS_M,
            width_px,
            height_px,
            angles: CameraAngles {
                heading_deg,
                tilt_deg: tilt - away.to_degrees(),
                ..self.angles
            },
        })
    }

    /// The same, turned as far as is needed that the camera stands clear of the sea surface: for the way of a camera
    /// through it. What no turn makes valid stays as it is.
    #[must_use]
    pub fn clear_of_surface(self) -> Self {
        let tilt = self.angles.tilt_deg;
        let top = most_tilt_from_above(self.distance_m);
        let tilt_deg = match tilts_from_below(self.distance_m) {
            _ if tilt <= top => tilt,
            // Nearer to where it came from or goes to.
            Some([least, most]) if tilt - top > least - tilt => tilt.clamp(least, most),
            Some(_) | None => top,
        };
        Self {
            angles: CameraAngles {
                tilt_deg,
                ..self.angles
            },
            ..self
        }
    }

    /// The place below the camera, so far from the target against the heading, and the heading from there.
    fn camera_place(&self, away: f64) -> (LonLatDeg, f64) {
        let heading_deg = self.angles.heading_deg;
        if away == 0.0 {
            return (self.target, heading_deg);
        }
        let (sin_away, cos_away) = away.sin_cos();
        let (sin_lat, cos_lat) = self.target.lat.to_radians().sin_cos();
        let (sin_back, cos_back) = (heading_deg.to_radians() + PI).sin_cos();
        let sin_own = (sin_lat * cos_away + cos_lat * sin_away * cos_back).clamp(-1.0, 1.0);
        let east = (sin_back * sin_away * cos_lat).atan2(cos_away - sin_lat * sin_own);
        let lon = self.target.lon + east.to_degrees();
        let place = LonLatDeg {
            lon: wrap_lon_deg(lon),
            lat: sin_own.asin().to_degrees(),
        };
        // Bearing of the target from there: the other way round.
        let cos_own = (1.0 - sin_own * sin_own).sqrt();
        let north = cos_own * sin_lat - sin_own * cos_lat * east.cos();
        let bearing = (-east.sin() * cos_lat).atan2(north);
        (place, bearing.to_degrees())
    }
}

/// Cosine of the tilt at which a camera at a distance stands at a height, m: negative from below.
fn cosine_at(distance_m: f64, height_m: f64) -> f64 {
    // |camera|² = R² + 2 R D cos t + D².
    let from_middle = SPHERE_RADIUS_M + height_m;
    let squares = from_middle.powi(2) - SPHERE_RADIUS_M.powi(2) - distance_m.powi(2);
    squares / (2.0 * SPHERE_RADIUS_M * distance_m)
}

/// Largest tilt of a camera at a distance that stands above the surface, degrees.
fn most_tilt_from_above(distance_m: f64) -> f64 {
    let cosine = cosine_at(distance_m, MIN_CAMERA_HEIGHT_M + WITHIN_M).clamp(0.0, 1.0);
    cosine.acos().to_degrees()
}

/// Least and largest tilt of a camera at a distance that sees a place from below the sea surface, degrees; none if it
/// is so far that it stands above it again, or sees the core.
fn tilts_from_below(distance_m: f64) -> Option<[f64; 2]> {
    let least = cosine_at(distance_m, -MIN_CAMERA_HEIGHT_M - WITHIN_M);
    let most = cosine_at(distance_m, -MAX_CAMERA_DEPTH_M + WITHIN_M);
    let [least, mut most] = [least, most].map(|cosine| cosine.clamp(-1.0, 0.0).acos());
    let core = 1.0 - CORE_DEPTH_M / SPHERE_RADIUS_M;
    // Sight lines that touch the core do so this far from the place.
    let touching_m = (1.0 - core * core).sqrt() * SPHERE_RADIUS_M;
    if distance_m > touching_m {
        most = most.min(FRAC_PI_2 + core.acos());
    }
    (least <= most).then(|| [least, most].map(f64::to_degrees))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(heading_deg: f64, tilt_deg: f64) -> CameraAngles {
        CameraAngles {
            heading_deg,
            tilt_deg,
            ..CameraAngles::default()
        }
    }

    fn look_at(lon: f64, lat: f64, distance_m: f64, angles: CameraAngles) -> View {
        let target = LonLatDeg { lon, lat };
        let look_at = LookAt {
            target,
            distance_m,
            angles,
        };
        look_at.view([640, 480]).unwrap()
    }

    /// Where the line of sight meets the sphere, degrees: rebuilt from the view with vectors.
    fn middle(view: &View) -> [f64; 2] {
        let View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            angles,
            ..
        } = *view
        else {
            panic!("a globe")
        };
        let (sin_lon, cos_lon) = lon_deg.to_radians().sin_cos();
        let (sin_lat, cos_lat) = lat_deg.to_radians().sin_cos();
        let (sin_h, cos_h) = angles.heading_deg.to_radians().sin_cos();
        let (sin_t, cos_t) = angles.tilt_deg.to_radians().sin_cos();
        let (east, north, up) = (
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        );
        let distance = 1.0 + height_m / SPHERE_RADIUS_M;
        let sight: [f64; 3] =
            std::array::from_fn(|i| sin_t * (sin_h * east[i] + cos_h * north[i]) - cos_t * up[i]);
        let along = distance * cos_t;
        let t = along - (along * along - (distance * distance - 1.0)).sqrt();
        let hit: [f64; 3] = std::array::from_fn(|i| distance * up[i] + t * sight[i]);
        [hit[1].atan2(hit[0]), hit[2].asin()].map(f64::to_degrees)
    }

    #[test]
    fn what_is_looked_at_is_in_the_middle_of_the_picture() {
        for (lon, lat) in [
            (0.0, 0.0),
            (120.0, 25.0),
            (-179.9, -60.0),
            (10.0, 89.0),
            (30.0, -89.5),
        ] {
            for heading in [0.0, 37.0, 90.0, -135.0, 180.0] {
                for tilt in [0.0, 1e-6, 30.0, 60.0, 85.0] {
                    for distance in [2e4, 1e6, 1e7] {
                        let view = look_at(lon, lat, distance, angles(heading, tilt));
                        let [seen_lon, seen_lat] = middle(&view);
                        let east = (seen_lon - lon + 180.0).rem_euclid(360.0) - 180.0;
                        let off = (east * lat.to_radians().cos()).hypot(seen_lat - lat);
                        assert!(
                            off < 1e-5,
                            "{lon} {lat} {heading} {tilt} {distance}: {off} degrees off"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn looking_straight_down_at_a_place_is_standing_over_it() {
        let View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            angles: seen,
            ..
        } = look_at(120.0, 25.0, 5e5, angles(30.0, 0.0))
        else {
            panic!("a globe")
        };
        assert_eq!((lon_deg, lat_deg, seen), (120.0, 25.0, angles(30.0, 0.0)));
        assert!((height_m - 5e5).abs() < 1e-6, "{height_m}");
    }

    fn height_m(view: &View) -> f64 {
        let View::Globe { height_m, .. } = *view else {
            panic!("a globe")
        };
        height_m
    }

    #[test]
    fn from_below_a_place_is_looked_at_through_the_sea() {
        for (distance, tilt) in [(4e5, 180.0), (9e5, 120.0), (2e6, 105.0), (3e6, 118.0)] {
            let view = look_at(-35.0, 48.0, distance, angles(20.0, tilt));
            view.validate().unwrap();
            let height = height_m(&view);
            assert!(
                (-1e6..-1e3).contains(&height),
                "{distance} {tilt}: {height}"
            );
            let View::Globe {
                lon_deg,
                lat_deg,
                angles,
                ..
            } = view
            else {
                panic!("a globe")
            };
            // Back up the line of sight to the place, by the angle between the two at the earth's centre.
            let away = tilt - angles.tilt_deg;
            let (from, to) = ([lon_deg, lat_deg], [-35.0f64, 48.0f64]);
            let [[lon0, lat0], [lon1, lat1]] = [from, to].map(|place| place.map(f64::to_radians));
            let cosine = lat0.sin() * lat1.sin() + lat0.cos() * lat1.cos() * (lon1 - lon0).cos();
            let found = cosine.min(1.0).acos().to_degrees();
            assert!((found - away).abs() < 1e-5, "{found} {away}");
            let near = (SPHERE_RADIUS_M + height) * away.to_radians().sin();
            let across = distance * tilt.to_radians().sin();
            assert!((near - across).abs() < 1.0, "{near} {across}");
        }
    }

    #[test]
    fn a_place_that_cannot_be_seen_so_is_refused_with_what_can() {
        let refused = |distance_m: f64, tilt: f64| {
            let look_at = LookAt {
                target: LonLatDeg { lon: 0.0, lat: 0.0 },
                distance_m,
                angles: angles(0.0, tilt),
            };
            look_at.view([640, 480]).unwrap_err().to_string()
        };
        for tilt in [-1.0, 91.0, 93.0, 181.0, f64::NAN] {
            let text = refused(1e6, tilt);
            // Its own distance away the camera is at the surface at 94.5 degrees, 1 km lower a tenth beyond.
            assert!(text.contains("0 to 90 from above"), "{text}");
            assert!(text.contains("94.6 to 179.9"), "{text}");
        }
        // Too deep; and behind the core or above the sea again.
        assert!(
            refused(3e6, 160.0).contains("to 122"),
            "{}",
            refused(3e6, 160.0)
        );
        assert!(refused(9e6, 120.0).contains("no camera below"));
    }

    #[test]
    fn a_camera_goes_through_the_surface_without_standing_in_it() {
        for distance_m in [2e3, 5e4, 6e5, 3e6] {
            let mut jumps = 0;
            let mut last = f64::INFINITY;
            for step in 0..=1800 {
                let asked = LookAt {
                    target: LonLatDeg {
                        lon: 10.0,
                        lat: 50.0,
                    },
                    distance_m,
                    angles: angles(30.0, f64::from(step) * 0.1),
                };
                let view = asked.clear_of_surface().view([640, 480]).unwrap();
                view.validate().unwrap();
                let height = height_m(&view);
                assert!(height <= last + 1e-6, "{distance_m} {step}");
                jumps += u32::from(last > 0.0 && height < 0.0);
                last = height;
            }
            assert_eq!(jumps, 1, "{distance_m}");
        }
        // What is far away goes round above.
        let far = LookAt {
            target: LonLatDeg { lon: 0.0, lat: 0.0 },
            distance_m: 1e7,
            angles: angles(0.0, 120.0),
        };
        far.clear_of_surface().view([640, 480]).unwrap();
    }
}
