//! CPU twin of `compose.wgsl` over the plain globe (`globe.wgsl`, `composed.wgsl`).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec4};

use crate::coast::land;

use crate::stages::params::Params;
use crate::stages::sphere::ground_below;

pub(super) const LAND: Vec3 = Vec3::new(0.36, 0.38, 0.40);
pub(super) const SEA: Vec3 = Vec3::new(0.035, 0.075, 0.14);
pub(super) const AIR: Vec3 = Vec3::new(0.30, 0.50, 0.80);
const HATCH: Vec3 = Vec3::new(0.05, 0.06, 0.07);
const HATCH_PX: i32 = 8;
const HATCH_LINE_PX: i32 = 2;

/// Share of a place that is land, between four cells of the plan's level.
fn land_share(params: &Params, lon_rad: f32, lat_rad: f32) -> f32 {
    let size = params.context.land_size.as_ivec2();
    let level = land::level_of(params.context.land_size.x);
    let words = &land::COVER[land::words(level)];
    let cell = |col: i32, row: i32| {
        let at = row.clamp(0, size.y - 1) * size.x + col.rem_euclid(size.x);
        ((words[at as usize / 4] >> (at % 4 * 8)) & 255) as f32 / 255.0
    };
    let place = Vec2::new(lon_rad, -lat_rad) * params.context.land_per_rad
        + params.context.land_size.as_vec2() * 0.5
        - 0.5;
    let index = place.floor();
    let part = place - index;
    let (x, y) = (index.x as i32, index.y as i32);
    let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
    let north = mix(cell(x, y), cell(x + 1, y), part.x);
    let south = mix(cell(x, y + 1), cell(x + 1, y + 1), part.x);
    mix(north, south, part.y)
}

/// The plain globe in even light: land where land is, sea of a colour, hatched where the product has no data.
pub(super) fn plain(
    params: &Params,
    domain: &[u32],
    [lon_rad, lat_rad]: [f32; 2],
    water: Vec3,
    pixel: [u32; 2],
) -> Vec3 {
    let place = pixel[0] as i32 + pixel[1] as i32 + params.view.origin_px.element_sum();
    let is_hatched =
        place % HATCH_PX < HATCH_LINE_PX && is_unsampled(params, domain, lon_rad, lat_rad);
    let sea = if is_hatched { water + HATCH } else { water };
    let share = land_share(params, lon_rad, lat_rad);
    sea * (1.0 - share) + LAND * share
}

fn is_unsampled(params: &Params, domain: &[u32], lon_rad: f32, lat_rad: f32) -> bool {
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
    let place = [ground.lon_rad, ground.lat_rad];
    let color = plain(params, domain, place, SEA, pixel);
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
