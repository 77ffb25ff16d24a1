//! A key frame as it is written: an instant of the film, a camera, and how it goes on from there.

use anyhow::{Result, ensure};
use contract::camera::FIELD_OF_VIEW_DEG;
use serde::{Deserialize, Serialize};

use super::pose::{Anchor, Pose};

/// Most degrees that a heading or roll has before it is taken round the circle: a hundred turns.
const MOST_TURN_DEG: f64 = 36_000.0;

/// A camera at an instant of the film.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub(super) struct KeyFrame {
    /// From the start of the film.
    pub(super) seconds: f64,
    pub(super) pose: Pose,
    /// How the camera goes on to the next key frame.
    pub(super) easing: Easing,
}

/// How a camera goes from a key frame to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Easing {
    /// Flies on without a halt: at rest only where key frames with this easing begin and end.
    #[default]
    Through,
    /// Starts and ends at rest.
    InOut,
    /// Goes evenly.
    Linear,
}

/// Its JSON.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    seconds: f64,
    /// Longitude and latitude of the middle of the picture, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    look_at: Option<[f64; 2]>,
    /// From there to the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distance_km: Option<f64>,
    /// Instead of these, longitude and latitude of the camera, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera: Option<[f64; 2]>,
    /// Of the camera above the sea surface; below it negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    height_km: Option<f64>,
    /// Clockwise from north at the place, degrees; followed as a number, so that 350 to 370 turns by 20.
    #[serde(default)]
    heading: f64,
    /// Of the line of sight against the vertical at the place, degrees. At what is looked at 0 to 90, or more from below the
    /// sea surface; at the camera 0 is straight down, 90 level.
    #[serde(default)]
    tilt: f64,
    /// Degrees, followed as a number.
    #[serde(default)]
    roll: f64,
    /// Across the shorter side of the picture, degrees.
    #[serde(default = "usual_fov")]
    fov: f64,
    #[serde(default)]
    easing: Easing,
}

fn usual_fov() -> f64 {
    FIELD_OF_VIEW_DEG
}

impl TryFrom<Written> for KeyFrame {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let Written {
            look_at,
            distance_km,
            camera,
            height_km,
            ..
        } = written;
        let (anchor, place, away_km) = match (look_at, distance_km, camera, height_km) {
            (Some(place), Some(away_km), None, None) => (Anchor::LookAt, place, away_km),
            (None, None, Some(place), Some(away_km)) => (Anchor::Camera, place, away_km),
            _ => {
                let seconds = written.seconds;
                return Err(format!(
                    "the key frame at {seconds} s says what it looks at by look_at and distance_km, or where the camera \
                     stands by camera and height_km: one of these pairs, and no part of the other"
                ));
            }
        };
        Ok(Self {
            seconds: written.seconds,
            pose: Pose {
                anchor,
                place,
                away_km,
                heading: written.heading,
                tilt: written.tilt,
                roll: written.roll,
                fov: written.fov,
            },
            easing: written.easing,
        })
    }
}

impl From<KeyFrame> for Written {
    fn from(frame: KeyFrame) -> Self {
        let pose = frame.pose;
        let of = |anchor| pose.anchor == anchor;
        Self {
            seconds: frame.seconds,
            look_at: of(Anchor::LookAt).then_some(pose.place),
            distance_km: of(Anchor::LookAt).then_some(pose.away_km),
            camera: of(Anchor::Camera).then_some(pose.place),
            height_km: of(Anchor::Camera).then_some(pose.away_km),
            heading: pose.heading,
            tilt: pose.tilt,
            roll: pose.roll,
            fov: pose.fov,
            easing: frame.easing,
        }
    }
}

impl KeyFrame {
    /// Checks it by itself and against the instant of the one before.
    pub(super) fn validate(&self, before: Option<f64>) -> Result<()> {
        match before {
            None => ensure!(
                self.seconds == 0.0,
                "the first one is at 0 seconds, not at {}",
                self.seconds
            ),
            Some(before) => ensure!(
                self.seconds > before && self.seconds.is_finite(),
                "they go forward in time: {} s does not come after {before} s",
                self.seconds
            ),
        }
        for (what, angle) in [("heading", self.pose.heading), ("roll", self.pose.roll)] {
            ensure!(
                angle.abs() <= MOST_TURN_DEG,
                "{what} {angle}: degrees, at most {MOST_TURN_DEG}"
            );
        }
        self.pose.validate()
    }
}
