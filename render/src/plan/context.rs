//! What surrounds the particles, for the stages: sun, sea, terrain, coast lines, the plain globe, day and night.

use std::sync::Arc;

use contract::earth::SPHERE_RADIUS_M;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::tile::{Tile, mercator_lat_deg};
use glam::DVec2;

use super::camera::{Camera, local_sun, overhead};
use super::{Later, Plan, ground, masks, tile};
use crate::coast::{self, Corner, Mask, Pen, sea_floor};
use crate::scene::Scene;
use crate::stages::compose::base_map::{self, BaseMapParams};
use crate::stages::layout::GroundAxis;
use crate::stages::params::{GridParams, Params};

/// Coast lines of tiles over what is dark, or over nothing.
const LIGHT_LINE: [f32; 2] = [0.88, 0.6];
/// Coast lines of tiles over what is light: terrain, or a thematic map.
const DARK_LINE: [f32; 2] = [0.06, 0.75];
/// How much larger heights of the coarse relief are taken than they are, where slopes are shaded: means of half a degree
/// are flat.
const FLOOR_EXAGGERATION: f64 = 25.0;

/// Extinction of the water that a camera below the sea surface looks through where no sea is asked for, m⁻¹: plumes of the
/// sea around stand out, and what is half round the globe is lost.
const PLAIN_WATER_PER_M: f64 = 1.0 / 4.0e6;
/// Share of what lies above the sea surface that is seen through it from below.
const CEILING_KEPT: f32 = 0.35;

/// Completes the plan of a view.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    sun(plan, job);
    let camera = Camera::of(&job.view);
    if !camera.as_ref().is_some_and(Camera::is_below) {
        sea_and_terrain(plan, job, scene);
    }
    match (job.view, camera) {
        (View::Tile { tile, size_px }, _) if job.style.context.coastlines => {
            coast_on_tile(plan, job, tile, size_px);
        }
        (View::Globe { .. }, Some(camera)) => plain_globe(plan, job, &camera),
        _ => (),
    }
    let params = &mut plan.params;
    let context = &mut params.context;
    context.has_water = u32::from(params.particles.sea_per_m > 0.0);
    context.trails_on = u32::from(job.trails.is_some());
    let parts = [
        context.surface,
        context.coast_on,
        context.night_on,
        context.lines_on,
        context.trails_on,
        context.land_masked,
    ];
    params.in_context = parts.contains(&1);
    if let View::Tile { tile, size_px } = job.view
        && params.in_context
    {
        plan.ground_axes = ground_axes(scene, tile, size_px);
    }
}

/// The sun of tiles, which their own plan does not need; night.
fn sun(plan: &mut Plan, job: &RenderJob) {
    let params = &mut plan.params;
    let subsolar = job.style.sun.subsolar;
    let is_map = job.mode == Mode::Map;
    params.context.night_on = u32::from(subsolar.is_some() && is_map);
    if let View::Tile { .. } = job.view {
        params.view.sun_is_local = u32::from(subsolar.is_none());
        params.projection.day_on = u32::from(subsolar.is_some() && !is_map);
        let sun = subsolar.map_or_else(|| local_sun(&job.style.sun), overhead);
        params.view.sun = sun.as_vec3();
    }
}

fn sea_and_terrain(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    let params = &mut plan.params;
    let (Some(relief), Some(terrain)) = (&job.relief, &scene.terrain) else {
        return;
    };
    let is_tile = matches!(job.view, View::Tile { .. });
    if !is_tile && !job.style.globe_surface {
        return;
    }
    params.terrain_grid = GridParams::whole(&terrain.grid);
    let context = &mut params.context;
    context.surface = 1;
    context.terrain_on = 1;
    context.terrain_slope = (relief.exaggeration / (8.0 * SPHERE_RADIUS_M)) as f32;
    let extinction_per_m = job.style.context.sea_extinction_per_m();
    context.seabed_per_m = (extinction_per_m * relief.exaggeration) as f32;
}

/// Where every pixel column and row of a tile lies: between cell centres of the terrain, and on the earth.
fn ground_axes(scene: &Scene, tile: Tile, size_px: u32) -> Vec<GroundAxis> {
    let world_px = tile::world_px(tile, size_px);
    let grid = scene
        .terrain
        .as_ref()
        .map_or(&scene.grid, |terrain| &terrain.grid);
    let share = |tile_index: u32, pixel: u32| {
        (f64::from(tile_index) * f64::from(size_px) + f64::from(pixel) + 0.5) / world_px
    };
    let pixels = 0..size_px;
    let col = |pixel: u32| col_axis(grid, share(tile.x, pixel) * 360.0 - 180.0);
    let row = |pixel: u32| row_axis(grid, mercator_lat_deg(share(tile.y, pixel)));
    pixels
        .clone()
        .map(col)
        .chain(pixels.clone().map(row))
        .collect()
}

fn col_axis(grid: &Grid, lon_deg: f64) -> GroundAxis {
    let cols = (lon_deg - grid.west_deg).rem_euclid(360.0) / grid.dlon_deg - 0.5;
    ground_axis(cols, lon_deg)
}

fn row_axis(grid: &Grid, lat_deg: f64) -> GroundAxis {
    ground_axis((grid.north_deg - lat_deg) / grid.dlat_deg - 0.5, lat_deg)
}

fn ground_axis(cells: f64, angle_deg: f64) -> GroundAxis {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    GroundAxis {
        index: cells.floor() as i32,
        fraction: (cells - cells.floor()) as f32,
        sin: sin as f32,
        cos: cos as f32,
    }
}

fn coast_on_tile(plan: &mut Plan, job: &RenderJob, tile: Tile, size_px: u32) {
    plan.coast = Later::ready(Arc::new(on_tile(tile, size_px).into_words()));
    let context = &mut plan.params.context;
    context.coast_on = 1;
    // On a map the lines would vanish below the colours.
    context.coast_above = u32::from(job.mode == Mode::Map);
    context.coast_row_words = Mask::row_words(size_px);
    let is_light = job.mode == Mode::Map || context.terrain_on == 1;
    let [grey, alpha] = if is_light { DARK_LINE } else { LIGHT_LINE };
    (context.coast_grey, context.coast_alpha) = (base_map::composed_grey(grey), alpha);
}

/// Land and lakes of the globe, its lines, its colours and its relief.
fn plain_globe(plan: &mut Plan, job: &RenderJob, camera: &Camera) {
    let size_px = job.view.size_px();
    let (style, around) = (&job.style, &job.style.context);
    let wanted = ground::Wanted {
        land: style.globe_surface || around.mask_land,
        coasts: around.coastlines,
        borders: around.borders,
    };
    let params = &mut plan.params;
    params.base_map = BaseMapParams::of(around.base_map, around.background);
    if camera.is_below() {
        below_the_sea(params, job, camera);
    }
    let context = &mut params.context;
    context.land_masked = u32::from(around.mask_land);
    // The sea floor is nowhere in a picture from below: plumes hang where it would be.
    let has_floor = around.sea_floor && !camera.is_below();
    if has_floor && style.globe_surface && context.terrain_on == 0 {
        context.sea_floor_on = 1;
        context.terrain_slope = (FLOOR_EXAGGERATION / (8.0 * SPHERE_RADIUS_M)) as f32;
        params.terrain_grid = GridParams::whole(&sea_floor::GRID);
    }
    if wanted.land || wanted.coasts || wanted.borders {
        let camera = *camera;
        plan.coast = masks::of(&job.view, wanted, move |memory| {
            ground::mask(&camera, size_px, wanted, memory)
        });
        context.coast_row_words = size_px[0];
    }
    context.land_hides = u32::from(style.globe_surface);
    context.coast_on = u32::from(wanted.coasts || wanted.borders);
    // On a map the lines would vanish below the colours.
    context.coast_above = u32::from(job.mode == Mode::Map);
    let coast = if camera.is_below() {
        base_map::coast_from_below(around.base_map)
    } else {
        base_map::coast(around.base_map)
    };
    (context.coast_grey, context.coast_alpha) = (base_map::composed_grey(coast.grey), coast.alpha);
}

/// The water that a camera below the sea surface looks through, and the surface from underneath.
fn below_the_sea(params: &mut Params, job: &RenderJob, camera: &Camera) {
    let (style, around) = (&job.style, &job.style.context);
    // Seen along the whole way to the camera, not as deep as it lies.
    params.particles.sea_per_m = 0.0;
    let per_m = if around.sea_opacity > 0.0 {
        around.sea_extinction_per_m()
    } else if style.globe_surface {
        PLAIN_WATER_PER_M
    } else {
        0.0
    };
    params.base_map = BaseMapParams::from_below(around.base_map, around.background);
    let sun_share = params.base_map.sun_share;
    let [_east, _north, up] = camera.ground;
    let sun = up.dot(params.view.sun.as_dvec3()).clamp(0.0, 1.0) as f32;
    let day = 1.0 + sun_share * (sun - 0.75);
    let [water, deep] = base_map::water(around.base_map).map(|colour| colour * day);
    let view = &mut params.view;
    (view.water, view.deep) = (water, deep);
    view.water_per_unit = (per_m * SPHERE_RADIUS_M) as f32;
    view.ceiling = params.base_map.sea;
    view.ceiling_kept = if style.globe_surface {
        CEILING_KEPT
    } else {
        1.0
    };
    view.sun_share = sun_share;
}

/// Lines in absolute pixels of the tile's level, on both sides of the date line.
fn on_tile(tile: Tile, size_px: u32) -> Mask {
    let world_px = tile::world_px(tile, size_px);
    let origin_px = [tile.x, tile.y].map(|index| f64::from(index) * f64::from(size_px));
    let mut mask = Mask::new(origin_px, [size_px; 2]);
    for line in coast::lines(world_px / 360.0) {
        for turn in [-1.0, 0.0, 1.0] {
            let place =
                |corner: &Corner| DVec2::new(corner.share[0] + turn, corner.share[1]) * world_px;
            for pair in line.windows(2) {
                mask.draw(Pen::COAST, place(&pair[0]), place(&pair[1]));
            }
        }
    }
    mask
}
