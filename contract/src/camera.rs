//! How the camera of a globe view is turned: heading, tilt, roll and field of view, as globes on the web have them.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::earth::SPHERE_RADIUS_M;
use crate::grid::{LonLatDeg, wrap_lon_deg};
use crate::job::View;

/// Field of view across the shorter side of a picture unless told otherwise, degrees.
pub const FIELD_OF_VIEW_DEG: f64 = 45.0;
/// Narrowest and widest field of view, degrees.
pub const FIELD_OF_VIEW_LIMITS_DEG: [f64; 2] = [1.0, 120.0];
/// Nearest camera to the ground, m.
pub const MIN_CAMERA_HEIGHT_M: f64 = 1e3;
/// Farthest camera above the ground, m.
pub const MAX_CAMERA_HEIGHT_M: f64 = 1e9;
/// Height above the ground within which there may be particles, m.
const HIGHEST_PARTICLE_M: f64 = 1.25e6;

/// Which way a camera looks and how much it takes in; nothing of it is in the name of a picture taken straight down with
/// north up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraAngles {
    /// Direction of view, and what is up in a picture taken straight down: clockwise from north, degrees.
    #[serde(with = "crate::exact")]
    pub heading_deg: f64,
    /// 0 looks straight down, 90 along the ground below the camera; degrees, 0 to 180.
    #[serde(with = "crate::exact")]
    pub tilt_deg: f64,
    /// Lean to the right about the line of sight, degrees: the horizon turns to the left.
    #[serde(with = "crate::exact")]
    pub roll_deg: f64,
    /// Across the shorter side of the picture, degrees.
    #[serde(with = "crate::exact")]
    pub field_of_view_deg: f64,
}

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

impl Default for CameraAngles {
    fn default() -> Self {
        Self::NADIR
    }
}

impl CameraAngles {
    /// Straight down, north up.
    pub const NADIR: Self = Self {
        heading_deg: 0.0,
        tilt_deg: 0.0,
        roll_deg: 0.0,
        field_of_view_deg: FIELD_OF_VIEW_DEG,
    };

    pub(crate) fn is_usual(&self) -> bool {
        *self == Self::NADIR
    }

    /// Checks every limit, for a camera at a height in metres and a picture of `size_px`.
    ///
    /// # Errors
    /// The limit that is broken, with what would be valid.
    pub(crate) fn validate(&self, height_m: f64, size_px: [u32; 2]) -> Result<(), ContractError> {
        let bad = |what: &'static str, value: f64, reason: String| {
            Err(ContractError::invalid(what, &value.to_string(), reason))
        };
        if !(-360.0..=360.0).contains(&self.heading_deg) {
            let reason = "degrees clockwise from north, -360 to 360".to_owned();
            return bad("heading", self.heading_deg, reason);
        }
        if !(-180.0..=180.0).contains(&self.roll_deg) {
            return bad("roll", self.roll_deg, "degrees, -180 to 180".to_owned());
        }
        let [narrowest, widest] = FIELD_OF_VIEW_LIMITS_DEG;
        if !(narrowest..=widest).contains(&self.field_of_view_deg) {
            let reason =
                format!("degrees across the shorter side of the picture, {narrowest} to {widest}");
            return bad("field of view", self.field_of_view_deg, reason);
        }
        if !(0.0..=180.0).contains(&self.tilt_deg) {
            let reason = "degrees from straight down, 0 to 180".to_owned();
            return bad("tilt", self.tilt_deg, reason);
        }
        let most = self.most_tilt_deg(height_m, size_px);
        if self.tilt_deg > most {
            let reason = format!(
                "from {} km above the ground the earth is seen with a tilt of 0 to {most:.1} degrees",
                height_m / 1e3
            );
            return bad("tilt", self.tilt_deg, reason);
        }
        Ok(())
    }

    /// The largest tilt with anything of the earth and what is above it in the picture, degrees.
    fn most_tilt_deg(&self, height_m: f64, size_px: [u32; 2]) -> f64 {
        if height_m <= HIGHEST_PARTICLE_M {
            return 180.0;
        }
        let limb = ((SPHERE_RADIUS_M + HIGHEST_PARTICLE_M) / (SPHERE_RADIUS_M + height_m)).asin();
        (limb + self.half_diagonal(size_px)).to_degrees().min(180.0)
    }

    /// From the middle of a picture to its corner, radians.
    pub fn half_diagonal(&self, size_px: [u32; 2]) -> f64 {
        let [width, height] = size_px.map(f64::from);
        let half_side = (self.field_of_view_deg / 2.0).to_radians().tan();
        (half_side * width.hypot(height) / width.min(height)).atan()
    }
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
    fn a_camera_that_sees_nothing_of_the_earth_is_told_what_would() {
        let size = [1600, 900];
        let high = 1.5e7;
        let usual = CameraAngles::default();
        usual.validate(high, size).unwrap();
        let most = usual.most_tilt_deg(high, size);
        angles(0.0, most - 1.0).validate(high, size).unwrap();
        let refused = angles(0.0, most + 1.0).validate(high, size).unwrap_err();
        let text = refused.to_string();
        assert!(
            text.contains("15000 km") && text.contains(&format!("{most:.1}")),
            "{text}"
        );
        // Among the particles every way has something.
        angles(0.0, 180.0).validate(1e6, size).unwrap();
        for broken in [
            CameraAngles {
                field_of_view_deg: 0.0,
                ..usual
            },
            CameraAngles {
                field_of_view_deg: 180.0,
                ..usual
            },
            CameraAngles {
                roll_deg: f64::NAN,
                ..usual
            },
            angles(361.0, 0.0),
            angles(0.0, -1.0),
        ] {
            broken.validate(high, size).unwrap_err();
        }
        for tilt in [-1.0, 91.0, f64::NAN] {
            let look_at = LookAt {
                target: LonLatDeg { lon: 0.0, lat: 0.0 },
                distance_m: 1e6,
                angles: angles(0.0, tilt),
            };
            look_at.view(size).unwrap_err();
        }
    }
}
