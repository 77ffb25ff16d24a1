//! How a camera stands at an instant: what it looks at from how far, or where it is itself, and how it is turned.

use anyhow::Result;
use contract::camera::{CameraAngles, MAX_CAMERA_DEPTH_M, MIN_CAMERA_HEIGHT_M};
use contract::grid::{LonLatDeg, wrap_lon_deg};
use contract::job::View;
use contract::look_at::LookAt;
use glam::DVec3;

use super::curve::{Place, slerp};

/// A picture that shows least beside what is in its middle.
const SMALLEST_PX: [u32; 2] = [1, 1];

/// Which place a pose names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    /// What is in the middle of the picture; how far is the distance from there.
    LookAt,
    /// What is below the camera; how far is its height above the sea surface.
    Camera,
}

/// How a camera stands; angles are degrees, of any number of turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    pub(super) anchor: Anchor,
    /// Longitude and latitude, degrees.
    pub(super) place: [f64; 2],
    /// From there to the camera.
    pub(super) away_km: f64,
    pub(super) heading: f64,
    /// At the place: of the line of sight against the vertical.
    pub(super) tilt: f64,
    pub(super) roll: f64,
    pub(super) fov: f64,
}

impl Pose {
    pub(super) fn view(&self, size_px: [u32; 2]) -> Result<View> {
        Ok(match self.anchor {
            Anchor::LookAt => self.look_at().view(size_px)?,
            Anchor::Camera => self.standing(size_px),
        })
    }

    /// The same, turned or moved as far as is needed that the camera stands clear of the sea surface and has something of
    /// the earth in sight, as a way between two that do may lead elsewhere.
    pub(super) fn clear(self) -> Self {
        match self.anchor {
            Anchor::LookAt => Self {
                tilt: self.look_at().clear_of_surface().angles.tilt_deg,
                ..self
            },
            Anchor::Camera => {
                let height_m = (self.away_km * 1000.0).max(-MAX_CAMERA_DEPTH_M);
                let height_m = if height_m.abs() < MIN_CAMERA_HEIGHT_M {
                    MIN_CAMERA_HEIGHT_M.copysign(height_m)
                } else {
                    height_m
                };
                let most = self.angles().most_tilt_deg(height_m, SMALLEST_PX);
                Self {
                    away_km: height_m / 1000.0,
                    tilt: self.tilt.min(most),
                    ..self
                }
            }
        }
    }

    /// Places along the great circle, distances by a constant factor, everything else evenly.
    pub(super) fn between(&self, after: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        let away_km = match self.anchor {
            Anchor::LookAt => self.away_km * (after.away_km / self.away_km).powf(share),
            Anchor::Camera => self.away_of(mix(self.scaled_away(), after.scaled_away())),
        };
        Self {
            place: along(self.place, after.place, share),
            away_km,
            heading: mix(self.heading, after.heading),
            tilt: mix(self.tilt, after.tilt),
            roll: mix(self.roll, after.roll),
            fov: mix(self.fov, after.fov),
            ..*self
        }
    }

    /// How far on a scale of factors; through the sea surface it goes evenly.
    pub(super) fn scaled_away(&self) -> f64 {
        match self.anchor {
            Anchor::LookAt => self.away_km.ln(),
            Anchor::Camera => self.away_km.asinh(),
        }
    }

    /// How far a place on that scale is, km.
    pub(super) fn away_of(&self, scaled: f64) -> f64 {
        match self.anchor {
            Anchor::LookAt => scaled.exp(),
            Anchor::Camera => scaled.sinh(),
        }
    }

    /// The same camera by where it stands itself.
    pub(super) fn by_camera(&self) -> Result<Self> {
        let View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            angles,
            ..
        } = self.view(SMALLEST_PX)?
        else {
            unreachable!("a camera makes globe views");
        };
        let turns = ((self.heading - angles.heading_deg) / 360.0).round();
        Ok(Self {
            anchor: Anchor::Camera,
            place: [lon_deg, lat_deg],
            away_km: height_m / 1000.0,
            heading: angles.heading_deg + 360.0 * turns,
            tilt: angles.tilt_deg,
            ..*self
        })
    }

    /// What a picture of any size asks of a camera.
    pub(super) fn validate(&self) -> Result<()> {
        LonLatDeg::new(self.place[0], self.place[1])?;
        self.view(SMALLEST_PX)?.validate()?;
        Ok(())
    }

    fn look_at(&self) -> LookAt {
        let [lon, lat] = self.place;
        LookAt {
            target: LonLatDeg {
                lon: wrap_lon_deg(lon),
                lat,
            },
            distance_m: self.away_km * 1000.0,
            angles: self.angles(),
        }
    }

    fn standing(&self, [width_px, height_px]: [u32; 2]) -> View {
        let [lon, lat] = self.place;
        View::Globe {
            lon_deg: wrap_lon_deg(lon),
            lat_deg: lat,
            height_m: self.away_km * 1000.0,
            width_px,
            height_px,
            angles: self.angles(),
        }
    }

    fn angles(&self) -> CameraAngles {
        CameraAngles {
            heading_deg: wrap_lon_deg(self.heading),
            tilt_deg: self.tilt,
            roll_deg: wrap_lon_deg(self.roll),
            field_of_view_deg: self.fov,
        }
    }
}

/// A place on the shorter great circle between two, degrees.
fn along(a: [f64; 2], b: [f64; 2], share: f64) -> [f64; 2] {
    let [from, to]: [DVec3; 2] = [a, b].map(|place| Place::of(place).vector());
    if share == 0.0 || from.distance(to) < 1e-9 {
        return a;
    }
    Place::at(slerp(from, to, share)).degrees()
}
