//! How far apart meridians and parallels of a graticule are.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::camera::{CORE_DEPTH_M, CameraAngles};
use crate::earth::SPHERE_RADIUS_M;

/// Least and largest distance of lines, degrees.
pub const GRATICULE_LIMITS_DEG: [f64; 2] = [0.01, 90.0];
/// Distances that are chosen unless one is given, degrees.
const ROUND_DEG: [f64; 11] = [30.0, 15.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02];
/// Lines across the shorter side of a picture, about.
const LINES: f64 = 3.5;

/// Meridians and parallels at equal distances, from the prime meridian and the equator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Graticule {
    /// Distance of neighbouring lines, degrees.
    #[serde(with = "crate::exact")]
    pub step_deg: f64,
}

impl Graticule {
    /// Lines at a distance in degrees.
    ///
    /// # Errors
    /// A distance out of [`GRATICULE_LIMITS_DEG`].
    pub fn every(step_deg: f64) -> Result<Self, ContractError> {
        let graticule = Self { step_deg };
        graticule.validate().map(|()| graticule)
    }

    /// The one that suits a camera at a height in metres and a picture of `size_px`: a few lines each way on the ground in
    /// the middle of the picture.
    pub fn suited(height_m: f64, angles: &CameraAngles) -> Self {
        let from_center = 1.0 + height_m / SPHERE_RADIUS_M;
        let down = from_center * angles.tilt_deg.to_radians().cos();
        // Below the sea surface, to where the line of sight leaves through it.
        let to_horizon_squared = from_center * from_center - 1.0;
        let (distance, seen_at_most) = if to_horizon_squared < 0.0 {
            let core = 1.0 - CORE_DEPTH_M / SPHERE_RADIUS_M;
            let seen = (core / from_center).acos() + core.acos();
            (down + (down * down - to_horizon_squared).sqrt(), 2.0 * seen)
        } else if down > 0.0 && down * down >= to_horizon_squared {
            // To the ground in the middle of the picture; to the horizon where the middle is above it.
            let near = down - (down * down - to_horizon_squared).sqrt();
            (near, 2.0 * (1.0 / from_center).acos())
        } else {
            let far = to_horizon_squared.sqrt();
            (far, 2.0 * (1.0 / from_center).acos())
        };
        let across = 2.0 * distance * (angles.field_of_view_deg / 2.0).to_radians().tan();
        let wanted_deg = across.min(seen_at_most).to_degrees() / LINES;
        let found = ROUND_DEG.into_iter().find(|step| *step <= wanted_deg);
        let [finest, _] = GRATICULE_LIMITS_DEG;
        Self {
            step_deg: found.unwrap_or(finest),
        }
    }

    pub(crate) fn validate(self) -> Result<(), ContractError> {
        let [least, most] = GRATICULE_LIMITS_DEG;
        if (least..=most).contains(&self.step_deg) {
            return Ok(());
        }
        let reason = format!("degrees between its lines, {least} to {most}, such as 15");
        let text = self.step_deg.to_string();
        Err(ContractError::invalid("graticule", &text, reason))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn distances_that_mean_nothing_are_refused_with_what_would() {
        for step in [0.0, -10.0, 0.001, 90.1, 1000.0, f64::NAN, f64::INFINITY] {
            let refused = Graticule::every(step).unwrap_err().to_string();
            assert!(refused.contains("0.01 to 90"), "{refused}");
        }
        for step in [0.01, 7.5, 90.0] {
            assert!(Graticule::every(step).is_ok_and(|g| g.step_deg == step));
        }
    }

    #[test]
    fn the_nearer_the_camera_the_closer_the_lines() {
        let down = CameraAngles::NADIR;
        let step = |height_km: f64| Graticule::suited(height_km * 1000.0, &down).step_deg;
        assert_eq!(step(15_000.0), 30.0);
        assert_eq!(step(1e6), 30.0);
        // 2 x 500 km x tan 22.5° are 3.7 degrees.
        assert_eq!(step(500.0), 1.0);
        assert_eq!(step(1.0), 0.01);
        let heights: Vec<f64> = (0..60).map(|i| 1.3f64.powi(i)).collect();
        assert!(
            heights
                .windows(2)
                .all(|pair| step(pair[0]) <= step(pair[1]))
        );
        // Towards and above the horizon.
        for tilt_deg in [60.0, 85.0, 90.0, 120.0, 180.0] {
            let angles = CameraAngles { tilt_deg, ..down };
            let step = Graticule::suited(300e3, &angles).step_deg;
            assert!((1.0..=10.0).contains(&step), "{tilt_deg}: {step}");
        }
    }
}
