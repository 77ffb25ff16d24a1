//! The space that clouds are in: which way the eye looks through it, and where its sun is.
//!
//! Globe views: earth radii, in the axes of eq. 4 (docs/method.md) (x towards 90 E, y towards 0 E, z towards the north pole). Map tiles:
//! pixels east and south on the screen and up; what is higher is already moved north by the slope of the view, so that
//! the eye looks straight down and the sun stands askew.

use std::f64::consts::TAU;

use contract::camera::CORE_DEPTH_M;
use contract::earth::{SPHERE_RADIUS_M, WGS84_EQUATORIAL_RADIUS_M};
use contract::job::{RenderJob, View};
use contract::tile::{mercator_x, mercator_y};
use glam::{DVec2, DVec3};

/// Pixels north for each pixel of height: the slope of the view of map tiles.
const SLOPE: f64 = 0.35;
/// The sun of map tiles stands no lower, degrees.
const LOWEST_SUN_DEG: f64 = 20.0;
/// Share of the eye's optical depth that dims light.
const LIGHT_DEPTH: f64 = 0.6;

pub(super) struct Space {
    eye: Eye,
    /// Towards the sun, length 1.
    pub(super) sun: DVec3,
    /// Depth that dims light over the depth along a line of this space.
    pub(super) light_depth: f64,
}

enum Eye {
    Globe {
        place: DVec3,
        /// Radius of what hides: the sea surface, or the core from below it.
        hides: f64,
        /// Right and up in the picture, and from it towards the camera.
        axes: [DVec3; 3],
        focal_px: f64,
        center_px: DVec2,
    },
    Map {
        /// Pixels round the world.
        world_px: f64,
        origin_px: DVec2,
    },
}

/// A sight line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) start: DVec3,
    /// Length 1.
    pub(super) ahead: DVec3,
}

/// East, north and up at a place.
fn axes(lon: f64, lat: f64) -> [DVec3; 3] {
    let ((sin_lon, cos_lon), (sin_lat, cos_lat)) = (lon.sin_cos(), lat.sin_cos());
    [
        DVec3::new(cos_lon, -sin_lon, 0.0),
        DVec3::new(-sin_lat * sin_lon, -sin_lat * cos_lon, cos_lat),
        DVec3::new(cos_lat * sin_lon, cos_lat * cos_lon, sin_lat),
    ]
}

impl Space {
    pub(super) fn of(job: &RenderJob) -> Self {
        let azimuth = job.style.sun.azimuth_deg.to_radians();
        let elevation = job.style.sun.elevation_deg.to_radians();
        match job.view {
            View::Globe {
                lon_deg,
                lat_deg,
                height_m,
                width_px,
                height_px,
                angles,
            } => {
                let [east, north, up] = axes(lon_deg.to_radians(), lat_deg.to_radians());
                let size_px = DVec2::new(f64::from(width_px), f64::from(height_px));
                let half_opening = (angles.field_of_view_deg / 2.0).to_radians();
                // Turned about the vertical, then about the picture's level axis, then about the line of sight.
                let turned = |[a, b]: [DVec3; 2], angle_deg: f64| {
                    let (sin, cos) = angle_deg.to_radians().sin_cos();
                    [a * cos - b * sin, b * cos + a * sin]
                };
                let [right, ahead] = turned([east, north], angles.heading_deg);
                let [back, top] = turned([up, ahead], angles.tilt_deg);
                let [right, top] = turned([right, top], angles.roll_deg);
                Self {
                    eye: Eye::Globe {
                        place: up * (1.0 + height_m / SPHERE_RADIUS_M),
                        hides: if height_m < 0.0 {
                            1.0 - CORE_DEPTH_M / SPHERE_RADIUS_M
                        } else {
                            1.0
                        },
                        axes: [right, top, back],
                        focal_px: size_px.min_element() / 2.0 / half_opening.tan(),
                        center_px: size_px / 2.0,
                    },
                    sun: (east * azimuth.sin() + north * azimuth.cos()) * elevation.cos()
                        + up * elevation.sin(),
                    light_depth: LIGHT_DEPTH,
                }
            }
            View::Tile { tile, size_px } => {
                let elevation = elevation.max(LOWEST_SUN_DEG.to_radians());
                let size_px = f64::from(size_px);
                // A pixel up the beam of light goes this far across the ground; south is down the screen, and height
                // moves what is seen north.
                let across = elevation.tan().recip();
                let beam = DVec3::new(azimuth.sin() * across, -azimuth.cos() * across - SLOPE, 1.0);
                Self {
                    eye: Eye::Map {
                        world_px: size_px * f64::from(1u32 << tile.z),
                        origin_px: DVec2::new(f64::from(tile.x), f64::from(tile.y)) * size_px,
                    },
                    sun: beam / beam.length(),
                    // Depth is that of straight up; light crosses it at the sun's elevation.
                    light_depth: LIGHT_DEPTH / (beam.length() * elevation.sin()),
                }
            }
        }
    }

    /// The place of what is `height_m` above the ground; angles in degrees, `turn` whole turns east.
    pub(super) fn place(&self, lon_deg: f64, lat_deg: f64, turn: f64, height_m: f64) -> DVec3 {
        match self.eye {
            Eye::Globe { .. } => {
                let [_, _, up] = axes(lon_deg.to_radians(), lat_deg.to_radians());
                up * (1.0 + height_m / SPHERE_RADIUS_M)
            }
            Eye::Map {
                world_px,
                origin_px,
            } => {
                let height_px = height_m * world_px / (TAU * WGS84_EQUATORIAL_RADIUS_M);
                DVec3::new(
                    (mercator_x(lon_deg) + turn) * world_px - origin_px.x,
                    mercator_y(lat_deg) * world_px - origin_px.y - SLOPE * height_px,
                    height_px,
                )
            }
        }
    }

    /// Whole turns east at which the map shows a longitude at a pixel, to the nearest.
    pub(super) fn turn(&self, lon_deg: f64, at_px: f64) -> f64 {
        match self.eye {
            Eye::Globe { .. } => 0.0,
            Eye::Map {
                world_px,
                origin_px,
            } => ((at_px + origin_px.x) / world_px - mercator_x(lon_deg)).round(),
        }
    }

    /// Is a place hidden by the sea surface (from below it, by the core), or by its own depth beyond the horizon when it is below it?
    pub(super) fn is_hidden(&self, place: DVec3) -> bool {
        let Eye::Globe {
            place: camera,
            hides,
            ..
        } = self.eye
        else {
            return false;
        };
        let sight = place - camera;
        let nearest = -camera.dot(sight) / sight.length_squared();
        let foot = camera + sight * nearest.clamp(0.0, 1.0);
        nearest < 1.0 && foot.length() < place.length().min(hides)
    }

    /// The sight line through a place of the picture, pixels from its upper left corner.
    pub(super) fn ray(&self, pixel: DVec2) -> Ray {
        match self.eye {
            Eye::Globe {
                place,
                axes: [right, top, back],
                focal_px,
                center_px,
                ..
            } => {
                let off = (pixel - center_px) / focal_px;
                let sight = right * off.x - top * off.y - back;
                Ray {
                    start: place,
                    ahead: sight / sight.length(),
                }
            }
            Eye::Map { .. } => Ray {
                start: pixel.extend(0.0),
                ahead: DVec3::NEG_Z,
            },
        }
    }

    /// Where a ball is seen, pixels, and a distance from there that it does not reach beyond; none if the camera is in
    /// it or before it.
    pub(super) fn seen(&self, center: DVec3, radius: f64) -> Option<(DVec2, f64)> {
        match self.eye {
            Eye::Globe {
                place,
                axes: [right, top, back],
                focal_px,
                center_px,
                ..
            } => {
                let sight = center - place;
                let ahead = -sight.dot(back);
                let nearest = ahead - radius;
                if nearest <= 0.0 {
                    return None;
                }
                let off = DVec2::new(sight.dot(right), -sight.dot(top));
                // Any point of the ball is within a radius sideways and in depth.
                let reach = radius / nearest * (1.0 + off.length() / ahead);
                Some((center_px + off / ahead * focal_px, reach * focal_px))
            }
            Eye::Map { .. } => Some((center.truncate(), radius)),
        }
    }

    /// Share of direct light that the ground at a place gets, 0 at night.
    pub(super) fn day(&self, place: DVec3) -> f64 {
        match self.eye {
            Eye::Globe { .. } => {
                let up = place.dot(self.sun) / place.length();
                let t = ((up + 0.15) / 0.5).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            }
            Eye::Map { .. } => 1.0,
        }
    }
}
