//! The camera of a globe view: where it stands, what it sees of the globe, and where its sun stands.

use std::f64::consts::PI;

use contract::earth::SPHERE_RADIUS_M;
use contract::job::RenderJob;
use contract::sun::{Subsolar, Sun};
use glam::{DVec2, DVec3};

use super::look;
use crate::stages::params::ViewParams;

/// Vertical opening of the camera (of the shorter side), degrees.
const OPENING_DEG: f64 = 45.0;

/// A camera above a place; lengths in earth radii.
pub(super) struct Camera {
    pub place: DVec3,
    pub east: DVec3,
    pub north: DVec3,
    pub up: DVec3,
    pub focal_px: f64,
    pub height: f64,
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
    /// Above a place, looking down, north up; `size_px` is the picture's width and height.
    pub(super) fn above(lon_deg: f64, lat_deg: f64, height_m: f64, size_px: [u32; 2]) -> Self {
        let [east, north, up] = axes_at(lon_deg, lat_deg);
        let height = height_m / SPHERE_RADIUS_M;
        let side_px = f64::from(size_px[0].min(size_px[1]));
        let focal_px = side_px / 2.0 / (OPENING_DEG / 2.0).to_radians().tan();
        Self {
            place: up * (1.0 + height),
            east,
            north,
            up,
            focal_px,
            height,
        }
    }

    /// Sets what the stages need of it.
    pub(super) fn write(&self, view: &mut ViewParams) {
        view.focal_px = self.focal_px as f32;
        view.eye = self.place.as_vec3();
        view.right = self.east.as_vec3();
        view.up = self.north.as_vec3();
        view.forward = (-self.up).as_vec3();
    }

    /// Where a place in front of it is seen, pixels east and south of the picture's middle.
    pub(super) fn seen_px(&self, place: DVec3) -> DVec2 {
        let sight = place - self.place;
        let per_px = self.focal_px / sight.dot(-self.up);
        DVec2::new(sight.dot(self.east), -sight.dot(self.north)) * per_px
    }

    /// Towards the sun: the real one, or one that keeps its place in the frame of the camera.
    pub(super) fn sun(&self, job: &RenderJob) -> DVec3 {
        if let Some(subsolar) = job.style.sun.subsolar {
            return overhead(subsolar);
        }
        let (sin_azimuth, cos_azimuth) = job.style.sun.azimuth_deg.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = job.style.sun.elevation_deg.to_radians().sin_cos();
        (self.east * sin_azimuth + self.north * cos_azimuth) * cos_elevation
            + self.up * sin_elevation
    }

    /// Angles round the point below the camera within which particles can be seen, and can shadow what is seen.
    pub(super) fn cap_rad(
        &self,
        size_px: [u32; 2],
        job: &RenderJob,
        heights: [f64; 2],
        margin: f64,
    ) -> [f64; 2] {
        let distance = 1.0 + self.height;
        let deepest = 1.0 + heights[0];
        let horizon = (1.0 / distance).acos() + (1.0 / (1.0 + heights[1])).acos() + margin;
        let corner_px = f64::from(size_px[0]).hypot(f64::from(size_px[1])) / 2.0;
        let corner = (corner_px / self.focal_px).atan();
        let sine = distance * corner.sin() / deepest;
        if sine >= 1.0 {
            return [horizon.min(PI); 2];
        }
        let elevation_deg = match job.style.sun.subsolar {
            None => job.style.sun.elevation_deg,
            Some(subsolar) => {
                let sine = overhead(subsolar).dot(self.up);
                sine.clamp(-1.0, 1.0).asin().to_degrees()
            }
        };
        let elevation = elevation_deg.max(look::LOWEST_SUN_DEG).to_radians();
        let shadow = (heights[1] - heights[0]) / elevation.tan();
        let seen = sine.asin() - corner + margin;
        [seen, seen + 2.0 * margin + shadow].map(|angle| angle.min(horizon).min(PI))
    }
}
