//! The camera of a globe view: where it stands, what it sees of the globe, and where its sun stands.

use contract::camera::CameraAngles;
use contract::earth::SPHERE_RADIUS_M;
use contract::job::{RenderJob, View};
use contract::sun::{Subsolar, Sun};
use glam::{DVec2, DVec3};

use super::footprint::{self, CORE, Footprint};
use super::look;
use crate::stages::params::ViewParams;

/// What is nearer to the camera than this share of twice its height is not drawn; `project.wgsl` has the same.
const NEAR_SHARE: f64 = 0.01;

/// Flattest angle between a sight line and the normal of slices, radians.
const MOST_SLANT_RAD: f64 = 1.48;

/// A camera over a place, or below it in the sea; lengths in earth radii.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    pub place: DVec3,
    /// East, north and up at the place below it.
    pub ground: [DVec3; 3],
    /// Towards the right and the upper edge of the picture, and along the line of sight.
    pub right: DVec3,
    pub top: DVec3,
    pub forward: DVec3,
    pub focal_px: f64,
    pub height: f64,
    /// To the nearest ground in the picture; from below to the sea surface, or to the core.
    pub nearest: f64,
    /// Between the line of sight and straight down, and between it and a corner of the picture, radians.
    tilt: f64,
    corner: f64,
}

/// East, north and up at a place, in the axes of eq. 4 (docs/method.md): x towards 90 E, y towards 0 E, z towards the north pole.
pub(super) fn axes_at(lon_deg: f64, lat_deg: f64) -> [DVec3; 3] {
    let (sin_lon, cos_lon) = lon_deg.to_radians().sin_cos();
    let (sin_lat, cos_lat) = lat_deg.to_radians().sin_cos();
    let east = DVec3::new(cos_lon, -sin_lon, 0.0);
    let north = DVec3::new(-sin_lat * sin_lon, -sin_lat * cos_lon, cos_lat);
    let up = DVec3::new(cos_lat * sin_lon, cos_lat * cos_lon, sin_lat);
    [east, north, up]
}

/// Towards the sun over a place.
pub(super) fn overhead(subsolar: Subsolar) -> DVec3 {
    let [_east, _north, up] = axes_at(subsolar.lon_deg, subsolar.lat_deg);
    up
}

/// Towards a sun that is the same everywhere: east, north and up.
pub(super) fn local_sun(sun: &Sun) -> DVec3 {
    let (sin_azimuth, cos_azimuth) = sun.azimuth_deg.to_radians().sin_cos();
    let (sin_elevation, cos_elevation) = sun.elevation_deg.to_radians().sin_cos();
    DVec3::new(
        sin_azimuth * cos_elevation,
        cos_azimuth * cos_elevation,
        sin_elevation,
    )
}

impl Camera {
    /// That of a globe view; none of any other.
    pub(super) fn of(view: &View) -> Option<Self> {
        match *view {
            View::Tile { .. } => None,
            View::Globe {
                lon_deg,
                lat_deg,
                height_m,
                angles,
                ..
            } => Some(Self::over(
                [lon_deg, lat_deg],
                height_m,
                &angles,
                view.size_px(),
            )),
        }
    }

    fn over(
        [lon_deg, lat_deg]: [f64; 2],
        height_m: f64,
        angles: &CameraAngles,
        size_px: [u32; 2],
    ) -> Self {
        let ground @ [east, north, up] = axes_at(lon_deg, lat_deg);
        let (sin_heading, cos_heading) = angles.heading_deg.to_radians().sin_cos();
        let (sin_tilt, cos_tilt) = angles.tilt_deg.to_radians().sin_cos();
        let (sin_roll, cos_roll) = angles.roll_deg.to_radians().sin_cos();
        let ahead = east * sin_heading + north * cos_heading;
        let level = east * cos_heading - north * sin_heading;
        let upright = up * sin_tilt + ahead * cos_tilt;
        let half_side_px = f64::from(size_px[0].min(size_px[1])) / 2.0;
        let focal_px = half_side_px / (angles.field_of_view_deg / 2.0).to_radians().tan();
        let corner_px = f64::from(size_px[0]).hypot(f64::from(size_px[1])) / 2.0;
        let height = height_m / SPHERE_RADIUS_M;
        let tilt = angles.tilt_deg.to_radians();
        let corner = (corner_px / focal_px).atan();
        Self {
            place: up * (1.0 + height),
            ground,
            right: level * cos_roll - upright * sin_roll,
            top: upright * cos_roll + level * sin_roll,
            forward: ahead * sin_tilt - up * cos_tilt,
            focal_px,
            height,
            nearest: if height < 0.0 {
                footprint::nearest_from_below(height, [tilt - corner, tilt + corner])
            } else {
                footprint::nearest_ground(height, (tilt - corner).max(0.0))
            },
            tilt,
            corner,
        }
    }

    /// Sets what the stages need of it.
    pub(super) fn write(&self, view: &mut ViewParams) {
        view.focal_px = self.focal_px as f32;
        view.eye = self.place.as_vec3();
        view.right = self.right.as_vec3();
        view.up = self.top.as_vec3();
        view.forward = self.forward.as_vec3();
    }

    /// Places with a coordinate of at least 0 are far enough ahead to be drawn.
    pub(super) fn ahead(&self, place: DVec3) -> f64 {
        let least = NEAR_SHARE * (self.place.length_squared() - 1.0).abs();
        (place - self.place).dot(self.forward) - least
    }

    /// Where a place in front of it is seen, pixels east and south of the picture's middle.
    pub(super) fn seen_px(&self, place: DVec3) -> DVec2 {
        let sight = place - self.place;
        let per_px = self.focal_px / sight.dot(self.forward);
        DVec2::new(sight.dot(self.right), -sight.dot(self.top)) * per_px
    }

    /// Towards the sun: the real one, or one that keeps its place in the frame of the camera.
    pub(super) fn sun(&self, job: &RenderJob) -> DVec3 {
        if let Some(subsolar) = job.style.sun.subsolar {
            return overhead(subsolar);
        }
        let (sin_azimuth, cos_azimuth) = job.style.sun.azimuth_deg.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = job.style.sun.elevation_deg.to_radians().sin_cos();
        let [east, north, up] = self.ground;
        (east * sin_azimuth + north * cos_azimuth) * cos_elevation + up * sin_elevation
    }

    /// The part of the globe within which particles between two heights can be seen, and can shadow what is seen;
    /// `margin` is how far they are drawn from their places, radians.
    pub(super) fn footprint(&self, job: &RenderJob, heights: [f64; 2], margin: f64) -> Footprint {
        let [_east, _north, up] = self.ground;
        let elevation_deg = match job.style.sun.subsolar {
            None => job.style.sun.elevation_deg,
            Some(subsolar) => {
                let sine = overhead(subsolar).dot(up);
                sine.clamp(-1.0, 1.0).asin().to_degrees()
            }
        };
        let elevation = elevation_deg.max(look::LOWEST_SUN_DEG).to_radians();
        let shadow = (heights[1] - heights[0]) / elevation.tan();
        if self.is_upright() {
            return Footprint::below(up, self.height, self.corner, heights, [margin, shadow]);
        }
        let level = self.forward - up * self.forward.dot(up);
        let ahead = level.try_normalize().unwrap_or(self.top);
        let cone = [self.tilt, self.corner];
        Footprint::ahead([up, ahead], self.height, cone, heights, [margin, shadow])
    }

    /// Largest angle between the line of sight and the half-way vector at which slices are met in one order all over the
    /// picture, radians.
    pub(super) fn most_half_angle(&self) -> f64 {
        MOST_SLANT_RAD - self.corner
    }

    /// Looks straight down from above?
    pub(super) fn is_upright(&self) -> bool {
        self.tilt == 0.0 && !self.is_below()
    }

    /// Stands below the sea surface?
    pub(super) fn is_below(&self) -> bool {
        self.height < 0.0
    }

    /// Radius of the sphere that hides what lies beyond it: the ground, or from below the core.
    pub(super) fn hides(&self) -> f64 {
        if self.is_below() { CORE } else { 1.0 }
    }

    /// From the place below or above it to the farthest ground that it sees, radians.
    pub(super) fn horizon(&self) -> f64 {
        let hides = self.hides();
        (hides / self.place.length()).clamp(-1.0, 1.0).acos() + hides.acos()
    }
}
