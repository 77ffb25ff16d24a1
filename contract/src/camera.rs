//! How the camera of a globe view is turned: heading, tilt, roll and field of view, as globes on the web have them.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::earth::SPHERE_RADIUS_M;

/// Field of view across the shorter side of a picture unless told otherwise, degrees.
pub const FIELD_OF_VIEW_DEG: f64 = 45.0;
/// Narrowest and widest field of view, degrees.
pub const FIELD_OF_VIEW_LIMITS_DEG: [f64; 2] = [1.0, 120.0];
/// Nearest camera to the ground or, from below, to the sea surface, m.
pub const MIN_CAMERA_HEIGHT_M: f64 = 1e3;
/// Farthest camera above the ground, m.
pub const MAX_CAMERA_HEIGHT_M: f64 = 1e9;
/// Deepest camera below the sea surface, m: amid what sinks, whose depth is exaggerated.
pub const MAX_CAMERA_DEPTH_M: f64 = 1e6;
/// Depth of the core, a sphere below all particles that hides what lies beyond it from a camera below the sea surface, m.
pub const CORE_DEPTH_M: f64 = 1.3e6;
/// Height above the ground within which there may be particles, m.
const HIGHEST_PARTICLE_M: f64 = 1.25e6;

/// Checks the height of a camera above the sea surface, or its depth below as a negative one, m.
///
/// # Errors
/// A height out of both ranges.
pub(crate) fn check_height(height_m: f64) -> Result<(), ContractError> {
    let is_above = (MIN_CAMERA_HEIGHT_M..=MAX_CAMERA_HEIGHT_M).contains(&height_m);
    let is_below = (-MAX_CAMERA_DEPTH_M..=-MIN_CAMERA_HEIGHT_M).contains(&height_m);
    if is_above || is_below {
        return Ok(());
    }
    let text = format!("{} km", height_m / 1e3);
    let reason = "the camera stands 1 km to 1 million km above the ground, or 1 km to 1000 km below the sea surface \
                  (-1 to -1000)";
    Err(ContractError::invalid(
        "height of the camera",
        &text,
        reason,
    ))
}

/// Which way a camera looks and how much it takes in; nothing of it is in the name of a picture taken straight down with
/// north up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraAngles {
    /// Direction of view, and what is up in a picture taken straight down: clockwise from north, degrees.
    #[serde(with = "crate::exact")]
    pub heading_deg: f64,
    /// 0 looks straight down, 90 along the ground below the camera or the sea surface above it, 180 straight up; degrees.
    #[serde(with = "crate::exact")]
    pub tilt_deg: f64,
    /// Lean to the right about the line of sight, degrees: the horizon turns to the left.
    #[serde(with = "crate::exact")]
    pub roll_deg: f64,
    /// Across the shorter side of the picture, degrees.
    #[serde(with = "crate::exact")]
    pub field_of_view_deg: f64,
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
    pub fn most_tilt_deg(&self, height_m: f64, size_px: [u32; 2]) -> f64 {
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

    #[test]
    fn cameras_stand_above_or_below_the_sea_surface_and_never_at_it() {
        for height_m in [1e3, 1e9, -1e3, -4e5, -1e6] {
            check_height(height_m).unwrap();
        }
        for height_m in [0.0, 999.0, -999.0, 1.1e9, -1.001e6, -1e9, f64::NAN] {
            let text = check_height(height_m).unwrap_err().to_string();
            assert!(
                text.contains("1 km to 1 million km above") && text.contains("1000 km below"),
                "{text}"
            );
        }
        // The core lies below the deepest camera, which may look any way.
        const { assert!(CORE_DEPTH_M > MAX_CAMERA_DEPTH_M) };
        angles(0.0, 180.0).validate(-1e6, [640, 480]).unwrap();
        angles(0.0, 0.0).validate(-1e3, [640, 480]).unwrap();
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
    }
}
