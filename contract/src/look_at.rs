//! A camera that looks at a place, and where that is in the end.

use std::f64::consts::PI;

use crate::ContractError;
use crate::camera::{CameraAngles, MAX_CAMERA_HEIGHT_M, MIN_CAMERA_HEIGHT_M};
use crate::earth::SPHERE_RADIUS_M;
use crate::grid::{LonLatDeg, wrap_lon_deg};
use crate::job::View;

/// A camera that looks at a place, instead of one that stands over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAt {
    /// What is in the middle of the picture.
    pub target: LonLatDeg,
    /// From the target to the camera, m.
    pub distance_m: f64,
    /// Angles at the target: `tilt_deg` is that of the line of sight against the vertical there, 0 to 90.
    pub angles: CameraAngles,
}

impl LookAt {
    /// The view of a picture of `size_px`.
    ///
    /// # Errors
    /// A tilt or a distance out of its limits.
    pub fn view(&self, [width_px, height_px]: [u32; 2]) -> Result<View, ContractError> {
        let (tilt, distance) = (self.angles.tilt_deg, self.distance_m);
        if !(0.0..=90.0).contains(&tilt) {
            let reason = "degrees from the vertical of the place that is looked at, 0 to 90";
            return Err(ContractError::invalid("tilt", &tilt.to_string(), reason));
        }
        if !(MIN_CAMERA_HEIGHT_M..=MAX_CAMERA_HEIGHT_M).contains(&distance) {
            let reason = "1 km to 1 million km from the place that is looked at";
            let text = format!("{} km", distance / 1e3);
            return Err(ContractError::invalid("distance", &text, reason));
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

    #[test]
    fn a_place_cannot_be_looked_at_from_below() {
        for tilt in [-1.0, 91.0, f64::NAN] {
            let look_at = LookAt {
                target: LonLatDeg { lon: 0.0, lat: 0.0 },
                distance_m: 1e6,
                angles: angles(0.0, tilt),
            };
            look_at.view([640, 480]).unwrap_err();
        }
    }
}
