//! The way of a camera through an animation: key frames that look at places, and what lies between them.

use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use contract::camera::{CameraAngles, FIELD_OF_VIEW_DEG};
use contract::grid::{LonLatDeg, wrap_lon_deg};
use contract::job::View;
use contract::look_at::LookAt;
use serde::{Deserialize, Serialize};

/// Most key frames of an animation.
const MOST_KEY_FRAMES: usize = 1000;
/// Largest file of key frames, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// Most degrees that a heading or roll has before it is taken round the circle: a hundred turns.
const MOST_TURN_DEG: f64 = 36_000.0;

/// Key frames in order of time, two at least.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct CameraPath(Vec<KeyFrame>);

/// What the camera looks at, and from where, at an instant of the film.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyFrame {
    /// From the start of the film.
    seconds: f64,
    /// Longitude and latitude of the middle of the picture, degrees.
    look_at: [f64; 2],
    /// From there to the camera.
    distance_km: f64,
    /// Clockwise from north, degrees; followed as a number, so that 350 to 370 turns by 20.
    #[serde(default)]
    heading: f64,
    /// Of the line of sight against the vertical at the place, degrees: 0 to 90, or more from below the sea surface.
    #[serde(default)]
    tilt: f64,
    /// Degrees, followed as a number.
    #[serde(default)]
    roll: f64,
    /// Across the shorter side of the picture, degrees.
    #[serde(default = "usual_fov")]
    fov: f64,
    /// How the camera goes on to the next key frame.
    #[serde(default)]
    easing: Easing,
}

/// How much of the way between two key frames is done when.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Easing {
    /// Starts and ends at rest.
    #[default]
    InOut,
    /// Goes evenly.
    Linear,
}

fn usual_fov() -> f64 {
    FIELD_OF_VIEW_DEG
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
        let path: Self = serde_json::from_str(&text).with_context(|| {
            format!(
                "{shown} is no list of key frames such as \
                 [{{\"seconds\": 0, \"look_at\": [-95, 0], \"distance_km\": 6000, \"tilt\": 40}}, ...]"
            )
        })?;
        path.validate().with_context(|| shown.to_string())?;
        Ok(path)
    }

    /// Round the place that is looked at, evenly, so many degrees in so many seconds; clockwise seen from above.
    pub(super) fn orbit(look_at: &LookAt, turn_deg: f64, seconds: f64) -> Result<Self> {
        let first = KeyFrame {
            seconds: 0.0,
            look_at: [look_at.target.lon, look_at.target.lat],
            distance_km: look_at.distance_m / 1000.0,
            heading: look_at.angles.heading_deg,
            tilt: look_at.angles.tilt_deg,
            roll: look_at.angles.roll_deg,
            fov: look_at.angles.field_of_view_deg,
            easing: Easing::Linear,
        };
        let last = KeyFrame {
            seconds,
            heading: first.heading + turn_deg,
            ..first
        };
        let path = Self(vec![first, last]);
        path.validate().context("the orbit")?;
        Ok(path)
    }

    /// Length of the film that shows all of it, seconds.
    pub(super) fn seconds(&self) -> f64 {
        self.0.last().map_or(0.0, |frame| frame.seconds)
    }

    fn validate(&self) -> Result<()> {
        let count = self.0.len();
        ensure!(
            (2..=MOST_KEY_FRAMES).contains(&count),
            "there are {count} key frames; 2 to {MOST_KEY_FRAMES} make a way"
        );
        let mut before = None;
        for (number, frame) in (1..).zip(&self.0) {
            frame
                .validate(before)
                .with_context(|| format!("key frame {number} of {count}"))?;
            before = Some(frame.seconds);
        }
        Ok(())
    }

    /// The view at an instant of the film; before the first key frame that of the first, after the last that of the last.
    pub(super) fn view(&self, seconds: f64, size_px: [u32; 2]) -> Result<View> {
        let after = self.0.partition_point(|frame| frame.seconds <= seconds);
        let (Some(first), Some(last)) = (self.0.first(), self.0.last()) else {
            bail!("a camera needs key frames");
        };
        let look_at = match (after.checked_sub(1).map(|at| self.0[at]), self.0.get(after)) {
            (None, _) => first.look_at(),
            (_, None) => last.look_at(),
            (Some(before), Some(after)) => {
                let share = (seconds - before.seconds) / (after.seconds - before.seconds);
                let between = before.between(after, before.easing.of(share));
                // A way from above to below the sea, or back, leads through its surface.
                between.look_at().clear_of_surface()
            }
        };
        Ok(look_at.view(size_px)?)
    }
}

impl Easing {
    fn of(self, share: f64) -> f64 {
        match self {
            Self::InOut => share * share * share * (share * (share * 6.0 - 15.0) + 10.0),
            Self::Linear => share,
        }
    }
}

impl KeyFrame {
    fn validate(&self, before: Option<f64>) -> Result<()> {
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
        for (what, angle) in [("heading", self.heading), ("roll", self.roll)] {
            ensure!(
                angle.abs() <= MOST_TURN_DEG,
                "{what} {angle}: degrees, at most {MOST_TURN_DEG}"
            );
        }
        LonLatDeg::new(self.look_at[0], self.look_at[1])?;
        // What a picture of any size asks of a camera.
        self.look_at().view([1, 1])?.validate()?;
        Ok(())
    }

    /// Places along the great circle, distances by a constant factor, everything else evenly.
    fn between(&self, after: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        Self {
            look_at: along(self.look_at, after.look_at, share),
            distance_km: self.distance_km * (after.distance_km / self.distance_km).powf(share),
            heading: mix(self.heading, after.heading),
            tilt: mix(self.tilt, after.tilt),
            roll: mix(self.roll, after.roll),
            fov: mix(self.fov, after.fov),
            ..*self
        }
    }

    fn look_at(&self) -> LookAt {
        let [lon, lat] = self.look_at;
        LookAt {
            target: LonLatDeg {
                lon: wrap_lon_deg(lon),
                lat,
            },
            distance_m: self.distance_km * 1000.0,
            angles: CameraAngles {
                heading_deg: wrap_lon_deg(self.heading),
                tilt_deg: self.tilt,
                roll_deg: wrap_lon_deg(self.roll),
                field_of_view_deg: self.fov,
            },
        }
    }
}

/// A place on the shorter great circle between two, degrees.
fn along(a: [f64; 2], b: [f64; 2], share: f64) -> [f64; 2] {
    let place = |[lon, lat]: [f64; 2]| {
        let (sin_lon, cos_lon) = lon.to_radians().sin_cos();
        let (sin_lat, cos_lat) = lat.to_radians().sin_cos();
        glam::DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    };
    let (from, to) = (place(a), place(b));
    let angle = from.cross(to).length().atan2(from.dot(to));
    if angle < 1e-9 || share == 0.0 {
        return a;
    }
    // Opposite places have no shortest way: over the pole, or wherever rounding leads.
    let at = from * ((1.0 - share) * angle).sin() + to * (share * angle).sin();
    let at = at.try_normalize().unwrap_or(from);
    [at.y.atan2(at.x).to_degrees(), at.z.asin().to_degrees()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(json: &str) -> Result<CameraPath> {
        let path: CameraPath = serde_json::from_str(json)?;
        path.validate()?;
        Ok(path)
    }

    fn said(json: &str) -> String {
        format!("{:#}", path(json).unwrap_err())
    }

    const FLIGHT: &str = r#"[
        {"seconds": 0, "look_at": [170, 0], "distance_km": 1000, "heading": 90},
        {"seconds": 4, "look_at": [-170, 0], "distance_km": 4000, "heading": 450, "tilt": 60}
    ]"#;

    fn state(path: &CameraPath, seconds: f64) -> LookAt {
        let before = path.0[0];
        let share = before.easing.of(seconds / 4.0);
        before.between(&path.0[1], share).look_at()
    }

    #[test]
    fn between_key_frames_the_camera_takes_the_short_way_and_rests_at_both() {
        let path = path(FLIGHT).unwrap();
        let half = state(&path, 2.0);
        assert!(
            (half.target.lon.abs() - 180.0).abs() < 1e-9,
            "{}",
            half.target.lon
        );
        // Twice as far and twice as far again; a whole turn is half done.
        assert!((half.distance_m - 2e6).abs() < 1e-3, "{}", half.distance_m);
        assert_eq!(
            (half.angles.heading_deg, half.angles.tilt_deg),
            (-90.0, 30.0)
        );
        // At rest at both ends.
        for (a, b) in [(0.0, 0.01), (4.0, 3.99)] {
            let moved = (state(&path, a).distance_m / state(&path, b).distance_m).ln();
            assert!(moved.abs() < 1e-6, "{moved}");
        }
        // What is asked for beyond the ends is the ends'.
        let size = [8, 6];
        assert_eq!(path.view(9.0, size).unwrap(), path.view(4.0, size).unwrap());
        assert_ne!(path.view(1.0, size).unwrap(), path.view(2.0, size).unwrap());
    }

    #[test]
    fn an_orbit_goes_evenly_round_and_closes() {
        let look_at = LookAt {
            target: LonLatDeg {
                lon: 10.0,
                lat: 50.0,
            },
            distance_m: 2e6,
            angles: CameraAngles {
                heading_deg: 30.0,
                tilt_deg: 60.0,
                ..CameraAngles::NADIR
            },
        };
        let path = CameraPath::orbit(&look_at, 360.0, 8.0).unwrap();
        let size = [8, 6];
        let close = |a: View, b: View| match (a, b) {
            (
                View::Globe {
                    lon_deg: a,
                    lat_deg: c,
                    ..
                },
                View::Globe {
                    lon_deg: b,
                    lat_deg: d,
                    ..
                },
            ) => (a - b).abs() < 1e-9 && (c - d).abs() < 1e-9,
            _ => false,
        };
        let first = path.view(0.0, size).unwrap();
        assert_eq!(first, look_at.view(size).unwrap());
        assert!(close(path.view(8.0, size).unwrap(), first));
        let quarter = LookAt {
            angles: CameraAngles {
                heading_deg: 120.0,
                ..look_at.angles
            },
            ..look_at
        };
        assert!(close(
            path.view(2.0, size).unwrap(),
            quarter.view(size).unwrap()
        ));
    }

    #[test]
    fn a_way_from_above_to_below_the_sea_leads_through_its_surface() {
        let path = path(
            r#"[{"seconds": 0, "look_at": [-35, 48], "distance_km": 900, "tilt": 60},
                {"seconds": 4, "look_at": [-35, 50], "distance_km": 600, "tilt": 130}]"#,
        )
        .unwrap();
        let heights_m = (0..=400).map(|i| {
            let view = path.view(f64::from(i) * 0.01, [16, 9]).unwrap();
            view.validate().unwrap();
            match view {
                View::Globe { height_m, .. } => height_m,
                View::Tile { .. } => panic!("a globe"),
            }
        });
        let heights_m: Vec<f64> = heights_m.collect();
        assert!(heights_m[0] > 4e5 && heights_m[400] < -3e5);
        let crossings = heights_m.windows(2).filter(|w| w[0] > 0.0 && w[1] < 0.0);
        assert_eq!(crossings.count(), 1);
        assert!(heights_m.windows(2).all(|w| w[1] <= w[0] + 1e-3));
    }

    #[test]
    fn key_frames_that_make_no_way_are_refused_by_number() {
        assert!(said("[]").contains("0 key frames"));
        let frame = |seconds: f64, more: &str| {
            format!(r#"{{"seconds": {seconds}, "look_at": [0, 0], "distance_km": 1000{more}}}"#)
        };
        let two = |a: &str, b: &str| said(&format!("[{a}, {b}]"));
        let first = frame(0.0, "");
        assert!(two(&frame(1.0, ""), &frame(2.0, "")).contains("key frame 1 of 2"));
        let order = two(&first, &frame(-3.0, ""));
        assert!(
            order.contains("key frame 2 of 2") && order.contains("-3 s"),
            "{order}"
        );
        for (broken, part) in [
            (r#", "tilt": 93"#, "0 to 90 from above"),
            (r#", "fov": 0"#, "1 to 120"),
            (r#", "heading": 1e9"#, "36000"),
            (r#", "speed": 3"#, "speed"),
        ] {
            let text = two(&first, &frame(2.0, broken));
            assert!(text.contains(part), "{broken}: {text}");
        }
        let inside = said(&format!(
            r#"[{first}, {{"seconds": 2, "look_at": [0, 0], "distance_km": -5}}]"#
        ));
        assert!(inside.contains("1 km to 1 million km"), "{inside}");
    }
}
