//! CPU twin of `water.wgsl`: what an eye below the sea surface looks through.

use glam::Vec3;

use crate::stages::params::Params;

/// Does the eye stand below the sea surface? The core hides then, in the place of the ground.
pub fn is_submerged(params: &Params) -> bool {
    params.view.hides < 1.0
}

/// Light of the water itself where nothing else is seen: dark towards the deep. `up` is the cosine of the way against the
/// vertical at the eye.
pub fn water_light(params: &Params, up: f32) -> Vec3 {
    let t = ((up + 0.9) / 1.3).clamp(0.0, 1.0);
    mix(params.view.deep, params.view.water, t * t * (3.0 - 2.0 * t))
}

/// Share of light that a way through the water leaves, earth radii (Beer-Lambert).
pub fn kept_over(params: &Params, way: f32) -> f32 {
    (-params.view.water_per_unit * way).exp()
}

/// Light of the surface from underneath, at a sine of the sun's elevation.
pub fn ceiling_light(params: &Params, sun: f32) -> Vec3 {
    params.view.ceiling * (1.0 + params.view.sun_share * (sun.clamp(0.0, 1.0) - 0.75))
}

/// A share `t` of the way from one light to another.
pub fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}
