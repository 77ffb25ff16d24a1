//! CPU twin of `compose.wgsl` in its surroundings (`in_context.wgsl`).

mod ceiling;

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec4};

use super::cpu::bytes_of;
use super::globe::{WATER, beside, daylight, hazy, is_hatched, plain, rim, sunlight};
use super::terrain::{Ground, ground_at, tint};
use crate::coast::sea_floor;
use crate::plan::Plan;
use crate::scene::{Scene, Terrain};
use crate::stages::colour::linear_of;
use crate::stages::layout::{Axis, GroundAxis, VIEW_GLOBE, VIEW_TILE};
use crate::stages::params::Params;
use crate::stages::project::cpu::smoothstep;
use crate::stages::sphere::{self, ground_below, line_share};
use crate::stages::water::{is_submerged, mix};
use ceiling::from_below;

/// Light on a thematic map where it is night.
const NIGHT: f32 = 0.14;

/// What lies around the particles.
pub struct Surroundings<'a> {
    pub domain: &'a [u32],
    /// Height of every cell of the terrain, m; empty without one.
    pub terrain: &'a [f32],
    /// Columns, then rows of a tile.
    pub ground_axes: &'a [GroundAxis],
    /// Words of the mask of the whole picture.
    pub coast: &'a [u32],
    /// Isolines of the part that is drawn; not read where there are none.
    pub lines: &'a [u32],
    /// Trails of the whole picture; not read where there are none.
    pub trails: &'a [u32],
}

impl<'a> Surroundings<'a> {
    /// Those of a planned picture with these isolines.
    pub fn of(plan: &'a Plan, scene: &'a Scene, lines: &'a [u32]) -> Self {
        let landed = scene.terrain.as_ref().map(Terrain::heights_m);
        let terrain = if plan.params.context.sea_floor_on == 1 {
            &sea_floor::HEIGHTS_M
        } else {
            landed.unwrap_or_default()
        };
        Self {
            domain: scene.domain.content(),
            terrain,
            ground_axes: &plan.ground_axes,
            coast: &plan.coast,
            lines,
            trails: &plan.trails,
        }
    }
}

/// What a pixel shows of the earth: its place in the terrain, and the sun from there in east, north and up.
#[derive(Default)]
struct Spot {
    on_ground: bool,
    x: Axis,
    y: Axis,
    cos_lat: f32,
    sun: Vec3,
    cover: f32,
    ground: sphere::Ground,
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
            ground,
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
        cover,
        ground,
    }
}

/// Terrain in the light of the sun, what lies below the sea through its water.
fn lit_terrain(params: &Params, ground: &Ground, sun: Vec3) -> Vec3 {
    let facing = Vec3::new(-ground.slope.x, -ground.slope.y, 1.0);
    let facing = facing / facing.length();
    // Slopes that still look at a sun below the horizon lie in the shadow of the earth.
    let day = (sun.z * 10.0 + 0.5).clamp(0.0, 1.0);
    let floor_colour = linear_of(tint(ground.height_m)) * sunlight(facing.dot(sun) * day);
    if ground.height_m >= 0.0 || params.context.seabed_per_m <= 0.0 {
        return floor_colour;
    }
    let kept = (params.context.seabed_per_m * ground.height_m).exp();
    mix(WATER * sunlight(sun.z), floor_colour, kept)
}

fn lit_plain(
    params: &Params,
    around: &Surroundings<'_>,
    spot: &Spot,
    floor: Option<&Ground>,
    pixel: [u32; 2],
) -> Vec3 {
    let [land, lake, ..] = ground_mask(params, around.coast, pixel);
    let place = [spot.ground.lon_rad, spot.ground.lat_rad];
    let colour = plain(params, around.domain, place, [land, lake], floor, pixel);
    let colour = colour * daylight(params, spot.sun.z);
    let Some(floor) = floor else {
        return colour;
    };
    let facing = Vec3::new(-floor.slope.x, -floor.slope.y, 1.0);
    let facing = facing / facing.length();
    let day = (spot.sun.z * 10.0 + 0.5).clamp(0.0, 1.0);
    let slanted = sunlight(facing.dot(spot.sun) * day) / sunlight(spot.sun.z * day);
    colour * (1.0 + params.base_map.shading * (slanted - 1.0))
}

/// Terrain of a globe view in the light of the sun, its sea hatched where the product has no data.
fn lit_relief(
    params: &Params,
    around: &Surroundings<'_>,
    spot: &Spot,
    ground: &Ground,
    pixel: [u32; 2],
) -> Vec3 {
    let lit = lit_terrain(params, ground, spot.sun);
    let place = [spot.ground.lon_rad, spot.ground.lat_rad];
    if !is_hatched(params, around.domain, place, pixel) {
        return lit;
    }
    let [land, lake, ..] = ground_mask(params, around.coast, pixel);
    let sea = (1.0 - land) * (1.0 - lake);
    lit + params.base_map.hatch_over_relief * (sunlight(spot.sun.z) * sea)
}

fn ground_colour(params: &Params, around: &Surroundings<'_>, spot: &Spot, pixel: [u32; 2]) -> Vec4 {
    let context = &params.context;
    if context.surface == 0 {
        return Vec4::ZERO;
    }
    let ground = if spot.on_ground && context.terrain_on + context.sea_floor_on > 0 {
        ground_at(params, around.terrain, spot.x, spot.y, spot.cos_lat)
    } else {
        None
    };
    if params.view.kind == VIEW_TILE {
        let lit = ground.map(|ground| lit_terrain(params, &ground, spot.sun));
        return lit.map_or(Vec4::ZERO, |lit| lit.extend(1.0));
    }
    let mut seen = Vec4::ZERO;
    if spot.cover < 1.0 {
        seen = beside(params, &spot.ground) * (1.0 - spot.cover);
    }
    if spot.cover <= 0.0 {
        return seen;
    }
    let lit = match &ground {
        _ if !spot.on_ground => rim(params, &spot.ground),
        Some(ground) if context.terrain_on == 1 => {
            let lit = lit_relief(params, around, spot, ground, pixel);
            hazy(params, lit, &spot.ground)
        }
        floor => {
            let lit = lit_plain(params, around, spot, floor.as_ref(), pixel);
            hazy(params, lit, &spot.ground)
        }
    };
    seen + lit.extend(1.0) * spot.cover
}

fn trail_word(params: &Params, trails: &[u32], pixel: [u32; 2]) -> u32 {
    let [x, y] = in_picture(params, pixel);
    trails[(y * params.context.trails_row_px + x) as usize]
}

fn trail_colour(params: &Params, trails: &[u32], pixel: [u32; 2]) -> Vec4 {
    if params.context.trails_on == 0 {
        return Vec4::ZERO;
    }
    let [red, green, blue, alpha] = trail_word(params, trails, pixel).to_le_bytes();
    let srgb = Vec3::from([red, green, blue].map(f32::from)) / 255.0;
    linear_of(srgb).extend(1.0) * (f32::from(alpha) / 255.0)
}

/// Share of what lies beyond the sea surface that land and trails hide in a pixel, in 255 parts.
pub fn hidden_share(params: &Params, coast: &[u32], trails: &[u32], pixel: [u32; 2]) -> u32 {
    let mut kept = 255;
    if params.context.land_hides == 1 {
        kept -= land_share(params, coast, pixel);
    }
    if params.context.trails_on == 1 {
        let clear = 255 - (trail_word(params, trails, pixel) >> 24);
        kept = (kept * clear * clear + 32512) / 65025;
    }
    255 - kept
}

/// Share of land in a pixel of a globe view in 255 parts.
fn land_share(params: &Params, coast: &[u32], pixel: [u32; 2]) -> u32 {
    let [x, y] = in_picture(params, pixel);
    coast[(y * params.context.coast_row_words + x) as usize] & 255
}

/// Share of a pixel that shows values: what is not land, where land is masked.
fn unmasked_share(params: &Params, coast: &[u32], pixel: [u32; 2]) -> f32 {
    if params.context.land_masked == 0 {
        return 1.0;
    }
    (255 - land_share(params, coast, pixel)) as f32 / 255.0
}

/// What lies in a pixel of a globe view: shares of land, lakes, shores and borders.
fn ground_mask(params: &Params, mask: &[u32], pixel: [u32; 2]) -> [f32; 4] {
    let [x, y] = in_picture(params, pixel);
    let word = mask[(y * params.context.coast_row_words + x) as usize];
    word.to_le_bytes().map(|byte| f32::from(byte) / 255.0)
}

/// Place of a pixel of the part in the whole picture.
fn in_picture(params: &Params, pixel: [u32; 2]) -> [u32; 2] {
    let origin = params.view.origin_px;
    [pixel[0] + origin.x as u32, pixel[1] + origin.y as u32]
}

fn coast_colour(
    params: &Params,
    coast: &[u32],
    spot: &Spot,
    pixel: [u32; 2],
    covered: f32,
) -> Vec4 {
    let context = &params.context;
    if context.coast_on == 0 {
        return Vec4::ZERO;
    }
    let grey = |grey: f32| Vec3::splat(grey).extend(1.0);
    if params.view.kind == VIEW_GLOBE {
        let map = &params.base_map;
        let seen = line_share(&spot.ground);
        let [.., shore, border] = ground_mask(params, coast, pixel).map(|share| share * seen);
        let mix = |a: f32, b: f32| a * (1.0 - covered) + b * covered;
        let shore = shore * mix(context.coast_alpha, map.over_coast_alpha);
        let border = border * mix(map.border_alpha, map.over_border_alpha);
        return grey(mix(context.coast_grey, map.over_grey)) * shore
            + grey(mix(map.border_grey, map.over_grey)) * (border * (1.0 - shore));
    }
    let [x, y] = in_picture(params, pixel);
    let word = coast[(y * context.coast_row_words + x / 4) as usize];
    let cover = ((word >> (x % 4 * 8)) & 255) as f32 / 255.0 * context.coast_alpha;
    grey(context.coast_grey) * cover
}

fn over(line: Vec4, colour: Vec4, is_above: bool) -> Vec4 {
    if is_above {
        line + colour * (1.0 - line.w)
    } else {
        colour + line * (1.0 - colour.w)
    }
}

/// Isoline and graticule of a pixel on the sea surface.
fn surface_lines(
    params: &Params,
    around: &Surroundings<'_>,
    pixel: [u32; 2],
    covered: f32,
) -> [Vec4; 2] {
    let context = &params.context;
    if context.lines_on == 0 {
        return [Vec4::ZERO; 2];
    }
    let word = around.lines[(pixel[1] * params.view.size_px.x + pixel[0]) as usize];
    let grey = |grey: f32| Vec3::splat(grey).extend(1.0);
    let cover = (word & 4095) as f32 / 4095.0 * unmasked_share(params, around.coast, pixel);
    let isoline = grey((word >> 12 & 255) as f32 / 255.0) * cover;
    let own = context.graticule_grey * (1.0 - covered) + params.base_map.over_grey * covered;
    let graticule = grey(own) * ((word >> 20) as f32 / 4095.0 * context.graticule_alpha);
    [isoline, graticule]
}

fn with_lines(
    params: &Params,
    around: &Surroundings<'_>,
    pixel: [u32; 2],
    colour: Vec4,
    covered: f32,
) -> Vec4 {
    let [isoline, graticule] = surface_lines(params, around, pixel, covered);
    let through = over(isoline * params.context.isolines_through, colour, true);
    let shown = over(isoline, through, false);
    over(graticule, shown, params.context.coast_above == 1)
}

/// Bytes of every pixel, red lowest, from the blended colours.
pub fn compose(params: &Params, picture: &[Vec4], around: &Surroundings<'_>, image: &mut [u32]) {
    for y in 0..params.view.size_px.y {
        for x in 0..params.view.size_px.x {
            let at = (y * params.view.size_px.x + x) as usize;
            let (colour, is_beside) = composed(params, picture[at], around, [x, y]);
            image[at] = bytes_of(params, colour, [x, y], is_beside);
        }
    }
}

/// A blended colour in its surroundings, and whether it is smoother than bytes: seen beside the globe, or through water.
fn composed(
    params: &Params,
    blended: Vec4,
    around: &Surroundings<'_>,
    pixel: [u32; 2],
) -> (Vec4, bool) {
    let spot = if params.view.kind == VIEW_TILE {
        spot_on_tile(params, around.ground_axes, pixel)
    } else {
        spot_on_globe(params, pixel)
    };
    let mut colour = blended * unmasked_share(params, around.coast, pixel);
    if params.context.night_on == 1 {
        let day = smoothstep(-0.15, 0.35, spot.sun.z);
        colour = (colour.truncate() * (NIGHT * (1.0 - day) + day)).extend(colour.w);
    }
    if is_submerged(params) {
        return (from_below(params, around, &spot, pixel, colour), true);
    }
    let mut covered = params.context.terrain_on as f32;
    if params.context.coast_above == 1 {
        covered = covered.max(colour.w);
    }
    let trail = trail_colour(params, around.trails, pixel);
    if params.context.coast_above == 1 {
        colour = over(trail, colour, true);
    }
    colour = with_lines(params, around, pixel, colour, covered);
    let line = coast_colour(params, around.coast, &spot, pixel, covered);
    colour = over(line, colour, params.context.coast_above == 1);
    if params.context.coast_above == 0 {
        colour = over(trail, colour, false);
    }
    colour += ground_colour(params, around, &spot, pixel) * (1.0 - colour.w);
    (colour, spot.cover < 1.0)
}
