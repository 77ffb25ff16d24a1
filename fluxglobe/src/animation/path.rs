//! The way of a camera through an animation: key frames in, a view at any instant of the film out.

mod curve;
mod flight;
mod key_frame;
mod monotone;
mod pose;

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use contract::job::View;
use contract::look_at::LookAt;
use serde::{Deserialize, Serialize};

use flight::Flight;
use key_frame::{Easing, KeyFrame};
use pose::{Anchor, Pose};

/// Most key frames of an animation.
const MOST_KEY_FRAMES: usize = 1000;
/// Largest file of key frames, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// Key frames in order of time, two at least, and the way between each of them and the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<KeyFrame>", into = "Vec<KeyFrame>")]
pub(super) struct CameraPath {
    frames: Vec<KeyFrame>,
    /// One fewer than key frames.
    legs: Vec<Leg>,
    flights: Vec<Flight>,
}

/// How the camera comes from a key frame to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Leg {
    /// By a way that leads through others: its number.
    Through(usize),
    /// From one to the other, at rest at both.
    InOut([Pose; 2]),
    /// From one to the other, evenly.
    Evenly([Pose; 2]),
}

impl TryFrom<Vec<KeyFrame>> for CameraPath {
    type Error = String;

    fn try_from(frames: Vec<KeyFrame>) -> Result<Self, String> {
        Self::new(frames).map_err(|error| format!("{error:#}"))
    }
}

impl From<CameraPath> for Vec<KeyFrame> {
    fn from(path: CameraPath) -> Self {
        path.frames
    }
}

impl CameraPath {
    /// Key frames from a JSON file, checked.
    pub(super) fn read(file: &Path) -> Result<Self> {
        let shown = file.display();
        let length = std::fs::metadata(file)
            .with_context(|| format!("cannot read the key frames of {shown}"))?
            .len();
        ensure!(
            length <= MOST_BYTES,
            "{shown} has {length} bytes, key frames at most {MOST_BYTES}"
        );
        let text = std::fs::read_to_string(file)
            .with_context(|| format!("cannot read the key frames of {shown}"))?;
        let frames: Vec<KeyFrame> = serde_json::from_str(&text).with_context(|| {
            format!(
                "{shown} is no list of key frames such as \
                 [{{\"seconds\": 0, \"look_at\": [-95, 0], \"distance_km\": 6000, \"tilt\": 40}}, ...] or \
                 [{{\"seconds\": 0, \"camera\": [-95, 0], \"height_km\": 6000, \"tilt\": 40}}, ...]"
            )
        })?;
        Self::new(frames).with_context(|| shown.to_string())
    }

    /// Round the place that is looked at, evenly, so many degrees in so many seconds; clockwise seen from above.
    pub(super) fn orbit(look_at: &LookAt, turn_deg: f64, seconds: f64) -> Result<Self> {
        let pose = Pose {
            anchor: Anchor::LookAt,
            place: [look_at.target.lon, look_at.target.lat],
            away_km: look_at.distance_m / 1000.0,
            heading: look_at.angles.heading_deg,
            tilt: look_at.angles.tilt_deg,
            roll: look_at.angles.roll_deg,
            fov: look_at.angles.field_of_view_deg,
        };
        let first = KeyFrame {
            seconds: 0.0,
            pose,
            easing: Easing::Linear,
        };
        let turned = Pose {
            heading: pose.heading + turn_deg,
            ..pose
        };
        let last = KeyFrame {
            seconds,
            pose: turned,
            ..first
        };
        Self::new(vec![first, last]).context("the orbit")
    }

    fn new(frames: Vec<KeyFrame>) -> Result<Self> {
        let count = frames.len();
        ensure!(
            (2..=MOST_KEY_FRAMES).contains(&count),
            "there are {count} key frames; 2 to {MOST_KEY_FRAMES} make a way"
        );
        let mut before = None;
        for (number, frame) in (1..).zip(&frames) {
            frame
                .validate(before)
                .with_context(|| format!("key frame {number} of {count}"))?;
            before = Some(frame.seconds);
        }
        let (mut legs, mut flights) = (vec![], vec![]);
        while legs.len() + 1 < count {
            let rest = &frames[legs.len()..];
            let alone = || alike(vec![rest[0].pose, rest[1].pose]).map(|ends| [ends[0], ends[1]]);
            match rest[0].easing {
                Easing::InOut => legs.push(Leg::InOut(alone()?)),
                Easing::Linear => legs.push(Leg::Evenly(alone()?)),
                Easing::Through => {
                    let through = rest
                        .iter()
                        .take_while(|frame| frame.easing == Easing::Through);
                    // The last key frame of all goes on to none.
                    let length = through.count().min(rest.len() - 1);
                    let flown = &rest[..=length];
                    let poses = alike(flown.iter().map(|frame| frame.pose).collect())?;
                    let instants = flown.iter().map(|frame| frame.seconds);
                    let flown: Vec<_> = instants.zip(poses).collect();
                    legs.extend(std::iter::repeat_n(Leg::Through(flights.len()), length));
                    flights.push(Flight::through(&flown));
                }
            }
        }
        Ok(Self {
            frames,
            legs,
            flights,
        })
    }

    /// Length of the film that shows all of it, seconds.
    pub(super) fn seconds(&self) -> f64 {
        self.frames.last().map_or(0.0, |frame| frame.seconds)
    }

    /// The view at an instant of the film; before the first key frame that of the first, after the last that of the last.
    pub(super) fn view(&self, seconds: f64, size_px: [u32; 2]) -> Result<View> {
        self.pose(seconds).view(size_px)
    }

    fn pose(&self, seconds: f64) -> Pose {
        let after = self
            .frames
            .partition_point(|frame| frame.seconds <= seconds);
        let leg = after.saturating_sub(1);
        let before = self.frames[leg];
        let (Some(way), true) = (self.legs.get(leg), seconds > before.seconds) else {
            return before.pose;
        };
        let length = self.frames[after].seconds - before.seconds;
        let share = (seconds - before.seconds) / length;
        let pose = match way {
            Leg::Through(flight) => self.flights[*flight].pose(seconds),
            Leg::InOut([from, to]) => {
                let share = share * share * share * (share * (share * 6.0 - 15.0) + 10.0);
                from.between(to, share)
            }
            Leg::Evenly([from, to]) => from.between(to, share),
        };
        // A way from above to below the sea, or back, leads through its surface.
        pose.clear()
    }
}

/// The same cameras by one anchor: where some look at places and others stand at some, all by where they stand.
fn alike(poses: Vec<Pose>) -> Result<Vec<Pose>> {
    if poses
        .windows(2)
        .all(|pair| pair[0].anchor == pair[1].anchor)
    {
        return Ok(poses);
    }
    poses.iter().map(Pose::by_camera).collect()
}

#[cfg(test)]
mod tests;
