//! CPU twin of `compose.wgsl` over the plain globe (`globe.wgsl`, `composed.wgsl`).

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use crate::stages::params::Params;
use crate::stages::sphere::ground_below;

pub(super) const LAND: Vec3 = Vec3::new(0.36, 0.38, 0.40);
pub(super) const SEA: Vec3 = Vec3::new(0.035, 0.075, 0.14);
pub(super) const AIR: Vec3 = Vec3::new(0.30, 0.50, 0.80);

pub(super) fn is_land(params: &Params, domain: &[u32], lon_rad: f32, lat_rad: f32) -> bool {
    let grid = &params.grid;
    let east = lon_rad - grid.west_rad;
    let col = ((east - (east / TAU).floor() * TAU) * grid.cols_per_rad).floor() as i32;
    let row = ((grid.north_rad - lat_rad) * grid.rows_per_rad).floor() as i32;
    let inside = row >= 0 && row < grid.rows as i32 && col < grid.cols as i32;
    inside && domain[row as usize * grid.cols as usize + col as usize] == 0
}

pub(super) fn sunlight(sun: f32) -> f32 {
    0.45 + 0.75 * sun.clamp(0.0, 1.0)
}

pub(super) fn hazy(params: &Params, color: Vec3, normal: Vec3) -> Vec3 {
    let toward = params.view.eye - normal;
    let facing = normal.dot(toward / toward.length()).clamp(0.0, 1.0);
    let haze = (1.0 - facing) * (1.0 - facing) * (1.0 - facing);
    color * (1.0 - 0.55 * haze) + AIR * (0.55 * haze)
}

fn surface_below(params: &Params, domain: &[u32], pixel: [u32; 2]) -> Vec4 {
    let ground = ground_below(params, pixel);
    let cover = (ground.rim_px + 0.5).clamp(0.0, 1.0);
    if !ground.on_ground {
        return (AIR * 0.5).extend(1.0) * cover;
    }
    let color = if is_land(params, domain, ground.lon_rad, ground.lat_rad) {
        LAND
    } else {
        SEA
    };
    let sun = ground.normal.dot(params.view.sun);
    hazy(params, color * sunlight(sun), ground.normal).extend(1.0) * cover
}

/// Bytes of every pixel, red lowest, from the blended colours.
pub fn compose(params: &Params, picture: &[Vec4], domain: &[u32], image: &mut [u32]) {
    for y in 0..params.view.size_px.y {
        for x in 0..params.view.size_px.x {
            let at = (y * params.view.size_px.x + x) as usize;
            let mut color = picture[at];
            if params.context.surface == 1 {
                color += surface_below(params, domain, [x, y]) * (1.0 - color.w);
            }
            image[at] = bytes_of(color);
        }
    }
}

pub(super) fn bytes_of(color: Vec4) -> u32 {
    let alpha = (color.w.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
    if alpha == 0 {
        return 0;
    }
    let rgb = (color.truncate() / color.w).clamp(Vec3::ZERO, Vec3::ONE) * 255.0 + 0.5;
    rgb.x as u32 | (rgb.y as u32) << 8 | (rgb.z as u32) << 16 | alpha << 24
}
