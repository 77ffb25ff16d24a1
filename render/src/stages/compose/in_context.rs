//! CPU twin of `compose.wgsl` in its surroundings (`in_context.wgsl`).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec4};

use super::cpu::{AIR, LAND, SEA, bytes_of, hazy, is_land, sunlight};
use super::terrain::{Ground, ground_at, tint};
use crate::stages::layout::{Axis, GroundAxis, VIEW_TILE, WATER_BLUE, WATER_GREEN, WATER_RED};
use crate::stages::params::Params;
use crate::stages::project::cpu::smoothstep;
use crate::stages::sphere::ground_below;

/// Light on a thematic map where it is night.
const NIGHT: f32 = 0.4;
const WATER: Vec3 = Vec3::new(WATER_RED, WATER_GREEN, WATER_BLUE);

/// What lies around the particles.
pub struct Surroundings<'a> {
    pub domain: &'a [u32],
    /// Height of every cell of the terrain, m; empty without one.
    pub terrain: &'a [f32],
    /// Columns, then rows of a tile.
    pub ground_axes: &'a [GroundAxis],
    /// Words of the coast mask of the whole picture.
    pub coast: &'a [u32],
}

/// What a pixel shows of the earth: its place in the terrain, and the sun from there in east, north and up.
#[derive(Default)]
struct Spot {
    on_ground: bool,
    x: Axis,
    y: Axis,
    cos_lat: f32,
    sun: Vec3,
    lon_rad: f32,
    lat_rad: f32,
    normal: Vec3,
    cover: f32,
}

fn axis_at(place: f32) -> Axis {
    Axis {
        index: place.floor() as i32,
        fraction: place - place.floor(),
    }
}

/// `lon` and `lat` are sines and cosines.
fn sun_from(params: &Params, lon: Vec2, lat: Vec2) -> Vec3 {
    let sun = params.view.sun;
    if params.view.sun_is_local == 1 {
        return sun;
    }
    let outward = sun.x * lon.x + sun.y * lon.y;
    Vec3::new(
        sun.x * lon.y - sun.y * lon.x,
        sun.z * lat.y - outward * lat.x,
        sun.z * lat.x + outward * lat.y,
    )
}

fn spot_on_tile(params: &Params, ground_axes: &[GroundAxis], pixel: [u32; 2]) -> Spot {
    let col = ground_axes[pixel[0] as usize];
    let row = ground_axes[(params.view.size_px.x + pixel[1]) as usize];
    let axis = |ground: GroundAxis| Axis {
        index: ground.index,
        fraction: ground.fraction,
    };
    Spot {
        on_ground: true,
        cover: 1.0,
        x: axis(col),
        y: axis(row),
        cos_lat: row.cos,
        sun: sun_from(
            params,
            Vec2::new(col.sin, col.cos),
            Vec2::new(row.sin, row.cos),
        ),
        ..Spot::default()
    }
}

fn spot_on_globe(params: &Params, pixel: [u32; 2]) -> Spot {
    let ground = ground_below(params, pixel);
    let cover = (ground.rim_px + 0.5).clamp(0.0, 1.0);
    if !ground.on_ground {
        return Spot {
            cover,
            ..Spot::default()
        };
    }
    let equatorial = ground.normal.truncate();
    let cos_lat = equatorial.length();
    let east = ground.lon_rad - params.terrain_grid.west_rad;
    let x = (east - (east / TAU).floor() * TAU) * params.terrain_grid.cols_per_rad - 0.5;
    let y =
        (params.terrain_grid.north_rad - ground.lat_rad) * params.terrain_grid.rows_per_rad - 0.5;
    Spot {
        on_ground: true,
        x: axis_at(x),
        y: axis_at(y),
        cos_lat,
        sun: sun_from(
            params,
            equatorial / cos_lat.max(1.0e-6),
            Vec2::new(ground.normal.z, cos_lat),
        ),
        lon_rad: ground.lon_rad,
        lat_rad: ground.lat_rad,
        normal: ground.normal,
        cover,
    }
}

fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}

/// Terrain in the light of the sun, what lies below the sea through its water.
fn lit_terrain(params: &Params, ground: &Ground, sun: Vec3) -> Vec3 {
    let facing = Vec3::new(-ground.slope.x, -ground.slope.y, 1.0);
    let facing = facing / facing.length();
    // Slopes that still look at a sun below the horizon lie in the shadow of the earth.
    let day = (sun.z * 10.0 + 0.5).clamp(0.0, 1.0);
    let floor_color = tint(ground.height_m) * sunlight(facing.dot(sun) * day);
    if ground.height_m >= 0.0 || params.context.seabed_per_m <= 0.0 {
        return floor_color;
    }
    let kept = (params.context.seabed_per_m * ground.height_m).exp();
    mix(WATER * sunlight(sun.z), floor_color, kept)
}

fn ground_color(params: &Params, around: &Surroundings<'_>, spot: &Spot) -> Vec4 {
    if params.context.surface == 0 {
        return Vec4::ZERO;
    }
    if !spot.on_ground {
        return (AIR * 0.5).extend(1.0) * spot.cover;
    }
    let ground = if params.context.terrain_on == 1 {
        ground_at(params, around.terrain, spot.x, spot.y, spot.cos_lat)
    } else {
        None
    };
    if params.view.kind == VIEW_TILE {
        let lit = ground.map(|ground| lit_terrain(params, &ground, spot.sun));
        return lit.map_or(Vec4::ZERO, |lit| lit.extend(1.0));
    }
    let lit = if let Some(ground) = ground {
        lit_terrain(params, &ground, spot.sun)
    } else {
        let color = if is_land(params, around.domain, spot.lon_rad, spot.lat_rad) {
            LAND
        } else if params.context.has_water == 1 {
            WATER
        } else {
            SEA
        };
        color * sunlight(spot.sun.z)
    };
    hazy(params, lit, spot.normal).extend(1.0) * spot.cover
}

fn coast_color(params: &Params, coast: &[u32], pixel: [u32; 2]) -> Vec4 {
    let (view, context) = (&params.view, &params.context);
    if context.coast_on == 0 {
        return Vec4::ZERO;
    }
    let [x, y] = [
        pixel[0] + view.origin_px.x as u32,
        pixel[1] + view.origin_px.y as u32,
    ];
    let word = coast[(y * context.coast_row_words + x / 4) as usize];
    let cover = ((word >> (x % 4 * 8)) & 255) as f32 / 255.0 * context.coast_alpha;
    Vec3::splat(context.coast_grey).extend(1.0) * cover
}

/// Bytes of every pixel, red lowest, from the blended colours.
pub fn compose(params: &Params, picture: &[Vec4], around: &Surroundings<'_>, image: &mut [u32]) {
    for y in 0..params.view.size_px.y {
        for x in 0..params.view.size_px.x {
            let at = (y * params.view.size_px.x + x) as usize;
            image[at] = bytes_of(composed(params, picture[at], around, [x, y]));
        }
    }
}

fn composed(params: &Params, blended: Vec4, around: &Surroundings<'_>, pixel: [u32; 2]) -> Vec4 {
    let spot = if params.view.kind == VIEW_TILE {
        spot_on_tile(params, around.ground_axes, pixel)
    } else {
        spot_on_globe(params, pixel)
    };
    let mut color = blended;
    if params.context.night_on == 1 {
        let day = smoothstep(-0.15, 0.35, spot.sun.z);
        color = (color.truncate() * (NIGHT * (1.0 - day) + day)).extend(color.w);
    }
    let line = coast_color(params, around.coast, pixel);
    if params.context.coast_above == 1 {
        color = line + color * (1.0 - line.w);
    } else {
        color += line * (1.0 - color.w);
    }
    color + ground_color(params, around, &spot) * (1.0 - color.w)
}
