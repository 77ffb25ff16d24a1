//! What surrounds the particles, for the stages: sun, sea, terrain, coast lines, day and night.

use contract::earth::SPHERE_RADIUS_M;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::tile::{Tile, mercator_lat_deg};
use glam::{DVec2, DVec3};

use super::camera::{Camera, local_sun, overhead};
use super::{Plan, tile};
use crate::coast::{self, Corner, Mask};
use crate::scene::Scene;
use crate::stages::layout::GroundAxis;
use crate::stages::params::GridParams;

/// Coast lines over what is dark: a plain globe, or nothing.
const LIGHT_LINE: [f32; 2] = [0.88, 0.6];
/// Coast lines over what is light: terrain, or a thematic map.
const DARK_LINE: [f32; 2] = [0.06, 0.75];

/// Completes the plan of a view.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    sun(plan, job);
    sea_and_terrain(plan, job, scene);
    if job.style.context.coastlines {
        coast_lines(plan, job);
    }
    let params = &mut plan.params;
    let context = &mut params.context;
    context.has_water = u32::from(params.particles.sea_per_m > 0.0);
    let is_sea_seen = context.surface == 1 && context.has_water == 1;
    let parts = [context.terrain_on, context.coast_on, context.night_on];
    params.in_context = is_sea_seen || parts.contains(&1);
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

fn coast_lines(plan: &mut Plan, job: &RenderJob) {
    let mask = match job.view {
        View::Tile { tile, size_px } => on_tile(tile, size_px),
        View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            width_px,
            height_px,
        } => {
            let size_px = [width_px, height_px];
            on_globe(&Camera::above(lon_deg, lat_deg, height_m, size_px), size_px)
        }
    };
    plan.coast = mask.into_words();
    let context = &mut plan.params.context;
    context.coast_on = 1;
    // On a map the lines would vanish below the colours.
    context.coast_above = u32::from(job.mode == Mode::Map);
    context.coast_row_words = Mask::row_words(job.view.size_px()[0]);
    let is_light = job.mode == Mode::Map || context.terrain_on == 1;
    [context.coast_grey, context.coast_alpha] = if is_light { DARK_LINE } else { LIGHT_LINE };
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
                mask.draw(place(&pair[0]), place(&pair[1]));
            }
        }
    }
    mask
}

/// Lines in front of the horizon.
fn on_globe(camera: &Camera, size_px: [u32; 2]) -> Mask {
    let mut mask = Mask::new([0.0; 2], size_px);
    let px_per_deg = camera.focal_px / camera.height * 1f64.to_radians();
    let middle_px = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1])) / 2.0;
    for line in coast::lines(px_per_deg) {
        for pair in line.windows(2) {
            if let Some([a, b]) = before_horizon(camera, &pair[0], &pair[1]) {
                let seen = |place| camera.seen_px(place) + middle_px;
                mask.draw(seen(a), seen(b));
            }
        }
    }
    mask
}

/// The part of a line between two corners that the camera sees.
fn before_horizon(camera: &Camera, a: &Corner, b: &Corner) -> Option<[DVec3; 2]> {
    let (a, b) = (a.normal, b.normal);
    // Places of the unit sphere are seen where the camera is above their horizon.
    let [above_a, above_b] = [a, b].map(|place| place.dot(camera.place) - 1.0);
    let crossing = || a + (b - a) * (above_a / (above_a - above_b));
    match (above_a >= 0.0, above_b >= 0.0) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, crossing()]),
        (false, true) => Some([crossing(), b]),
        (false, false) => None,
    }
}
