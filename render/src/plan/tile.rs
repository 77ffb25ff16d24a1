//! Plans of map tiles: an oblique view that leaves the ground where it is and moves height north, on the absolute
//! pixel grid of the zoom level, so that neighbouring tiles and tiles of another size agree to the byte.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use contract::grid::Grid;
use contract::heights::{kept_share, px_per_m};
use contract::job::{Mode, RenderJob};
use contract::tile::{MAX_LAT_DEG, Tile, mercator_lat_deg, mercator_x, mercator_y};
use glam::DVec2;

use super::look::{self, Look};
use super::{Plan, area_m2, cell_px, entry_shift, flow, height_range_m};
use crate::scene::Scene;
use crate::stages::interpolate::params::InterpolateParams;
use crate::stages::layout::{Axis, Col, LIGHT_OFF, LOOK, Row, SUBPIXELS, VIEW_TILE};
use crate::stages::params::Params;

/// Smallest light texel, pixels: finer than the screen is of no use.
const LEAST_TEXEL_PX: f64 = 1.5;

/// A span of the map along one axis, subpixels from the tile's edge.
type Span = [f64; 2];

struct Level {
    /// Pixels round the world.
    world_px: f64,
    /// Absolute pixel of the tile's left and top edge.
    origin_px: [f64; 2],
    size_px: f64,
    px_per_m: f64,
}

/// Pixels round the world at a tile's level: the same for a tile and its children of half the size.
pub(super) fn world_px(tile: Tile, size_px: u32) -> f64 {
    f64::from(size_px) * f64::from(1u32 << tile.z)
}

/// The plan of a tile of a number of pixels a side.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene, (tile, size_px): (Tile, u32)) {
    let world_px = world_px(tile, size_px);
    let level = Level {
        world_px,
        origin_px: [
            f64::from(tile.x) * f64::from(size_px),
            f64::from(tile.y) * f64::from(size_px),
        ],
        size_px: f64::from(size_px),
        px_per_m: px_per_m(tile, size_px),
    };
    plan.params.view.kind = VIEW_TILE;
    if job.mode == Mode::Map {
        map_axes(plan, scene, tile, size_px);
        return;
    }
    let grid = &scene.grid;
    let look = Look::of_job(job);
    let col_px = grid.dlon_deg / 360.0 * world_px;
    let cell_px = cell_px(&job.view, grid);
    let particles = look.particles_per_cell(cell_px, job.style.particles_per_cell);
    plan.params.cells.set_particles(particles);
    let style_depth = job.style.optical_depth;
    let rows_of = |grid: &Grid| rows(grid, &level, &look, col_px, (particles, style_depth));
    plan.rows = rows_of(grid);
    plan.whole_rows = scene
        .whole
        .iter()
        .flat_map(|it| rows_of(&it.grid))
        .collect();
    let heights_m = height_range_m(job, scene);
    let highest_m = heights_m[1].max(-heights_m[0]);
    let flattened = kept_share(level.px_per_m, highest_m);
    let heights_m = heights_m.map(|height_m| height_m * flattened);
    let Params {
        particles: own,
        projection,
        ..
    } = &mut plan.params;
    own.height_m_per_kg_m2 *= flattened as f32;
    own.height_limit_m *= flattened as f32;
    // What lies as deep as before is drawn less deep.
    own.sea_per_m /= flattened as f32;
    own.sheet_m *= flattened as f32;
    projection.beyond_m *= flattened as f32;
    projection.height_px_per_m = (look::OBLIQUE * level.px_per_m) as f32;
    projection.slice_top = heights_m[1] as f32;
    projection.slices_per_unit =
        (f64::from(job.style.slices) / (heights_m[1] - heights_m[0])) as f32;
    let spans = light_and_reach(
        plan,
        job,
        &level,
        heights_m,
        look.radius_px(cell_px, particles),
    );
    let spans = upstream(spans, &level, flow::plan(plan, job, scene));
    choose_cells(plan, scene, &level, spans);
}

/// Spans widened by as far as particles drift, radians, where meridians are closest.
fn upstream(spans: [Span; 2], level: &Level, reach_rad: f64) -> [Span; 2] {
    if reach_rad <= 0.0 {
        return spans;
    }
    let lat_deg = |px: f64| mercator_lat_deg((level.origin_px[1] + px) / level.world_px);
    let reach_deg = reach_rad.to_degrees();
    let north_deg = (lat_deg(0.0) + reach_deg).clamp(-MAX_LAT_DEG, MAX_LAT_DEG);
    let south_deg = (lat_deg(level.size_px) - reach_deg).clamp(-MAX_LAT_DEG, MAX_LAT_DEG);
    let cos_lat = north_deg.abs().max(south_deg.abs()).to_radians().cos();
    // No particle goes farther in half its life than half round the world.
    let across = (reach_rad / cos_lat / TAU).min(0.5) * level.world_px;
    let y_px = |lat_deg: f64| mercator_y(lat_deg) * level.world_px - level.origin_px[1];
    let (up, down) = (-y_px(north_deg), y_px(south_deg) - level.size_px);
    let subpixels = f64::from(SUBPIXELS);
    let [x, y] = spans;
    [
        [x[0] - across * subpixels, x[1] + across * subpixels],
        [
            y[0] - up.max(0.0) * subpixels,
            y[1] + down.max(0.0) * subpixels,
        ],
    ]
}

fn rows(
    grid: &Grid,
    level: &Level,
    look: &Look,
    col_px: f64,
    (particles, style_depth): (f64, f64),
) -> Vec<Row> {
    let subpixels = f64::from(SUBPIXELS);
    let edge_px = |row: u32| {
        let lat_deg = grid.row_north_deg(row).clamp(-MAX_LAT_DEG, MAX_LAT_DEG);
        mercator_y(lat_deg) * level.world_px - level.origin_px[1]
    };
    (0..grid.rows)
        .map(|row| {
            let (north, south) = (edge_px(row), edge_px(row + 1));
            let height = (south - north).max(1e-6);
            let area_px = height * col_px;
            let [north_rad, south_rad] =
                [row, row + 1].map(|row| grid.row_north_deg(row).to_radians());
            let (sin_lat, cos_lat) = (0.5 * (north_rad + south_rad)).sin_cos();
            let radius = look.radius_px(Look::side(col_px, height), particles);
            // Rows far from the tile do not fit; they are never chosen.
            let y_sub = (north * subpixels).round().clamp(-1e9, 1e9) as i32;
            Row {
                y_sub,
                y_span_px: (south - north) as f32,
                sin_lat: sin_lat as f32,
                cos_lat: cos_lat as f32,
                lat_span_rad: (north_rad - south_rad) as f32,
                radius: radius as f32,
                area_m2: area_m2(grid, row),
                depth_gain: look.depth_gain(area_px, radius, particles, style_depth) as f32,
            }
        })
        .collect()
}

/// How the sun shines on a map.
struct Shadows {
    /// Way of a shadow across the ground for each metre of height, subpixels east and south.
    per_m: [f64; 2],
    /// Way in the light for each pixel towards the eye, subpixels. The eye looks straight down once height is drawn as a
    /// way north: a pixel towards it is a pixel of height, above ground that lies as much farther south.
    toward_eye: [f64; 2],
    /// Of the sun's elevation.
    sine: f64,
}

impl Shadows {
    fn of(job: &RenderJob, level: &Level) -> Self {
        let sun = &job.style.sun;
        let elevation = sun.elevation_deg.max(look::LOWEST_SUN_DEG).to_radians();
        let azimuth = sun.azimuth_deg.to_radians();
        let sub_per_m = level.px_per_m * f64::from(SUBPIXELS);
        let across = sub_per_m / elevation.tan();
        let per_m = [-azimuth.sin() * across, azimuth.cos() * across];
        let toward_eye = [per_m[0], per_m[1] + look::OBLIQUE * sub_per_m];
        Self {
            per_m,
            toward_eye: toward_eye.map(|shift| shift / level.px_per_m),
            sine: elevation.sin(),
        }
    }
}

/// Sets the light's parameters; where cells must be looked for comes back: x and y.
fn light_and_reach(
    plan: &mut Plan,
    job: &RenderJob,
    level: &Level,
    heights_m: [f64; 2],
    radius_px: f64,
) -> [Span; 2] {
    let subpixels = f64::from(SUBPIXELS);
    let widest = plan
        .all_rows()
        .iter()
        .map(|row| f64::from(row.radius))
        .fold(0.0, f64::max)
        + 1.0;
    let per_m = level.px_per_m * subpixels;
    let edge = level.size_px * subpixels;
    let margin = widest * subpixels;
    plan.params.lists.entry_shift = entry_shift(widest);
    let shift = |span: Span, per_m: f64| -> Span {
        let moves = heights_m.map(|h| h * per_m);
        [
            span[0] + moves[0].min(moves[1]) - 2.0,
            span[1] + moves[0].max(moves[1]) + 2.0,
        ]
    };
    // On the ground below what is seen: height moves particles north, that is to smaller y.
    let seen = [
        [-margin, edge + margin],
        shift([-margin, edge + margin], look::OBLIQUE * per_m),
    ];
    if plan.params.lighting.mode == LIGHT_OFF {
        return seen;
    }
    let Shadows {
        per_m: shadow_per_m,
        toward_eye,
        sine,
    } = Shadows::of(job, level);
    let texel_px = (look::TEXEL_PER_RADIUS * radius_px).max(LEAST_TEXEL_PX);
    let unit = (texel_px * subpixels).round();
    let (mut origin, mut texels) = ([0; 2], [0; 2]);
    let mut reach = [[0.0; 2]; 2];
    for axis in 0..2 {
        let lit = shift(seen[axis], shadow_per_m[axis]);
        // Clouds look their light up so far from their centres.
        let looked = f64::from(LOOK) * widest * toward_eye[axis].abs();
        let lit = [lit[0] - looked, lit[1] + looked];
        let absolute = level.origin_px[axis] * subpixels;
        let first = ((absolute + lit[0]) / unit).floor() - 1.0;
        origin[axis] = (absolute - first * unit) as i32;
        texels[axis] = (((absolute + lit[1]) / unit).floor() - first) as u32 + 3;
        reach[axis] = shift(lit, -shadow_per_m[axis]);
    }
    let Params {
        projection,
        lighting,
        ..
    } = &mut plan.params;
    lighting.unit = unit as i32;
    lighting.size = texels.into();
    projection.light_origin = origin.into();
    projection.light_shift_per_m = DVec2::from(shadow_per_m).as_vec2();
    let slices_per_unit = f64::from(projection.slices_per_unit);
    let radius_slices = radius_px / level.px_per_m * slices_per_unit;
    lighting.look_power = look::look_power_tile(radius_slices);
    let toward_slice = -slices_per_unit / level.px_per_m;
    lighting.toward = DVec2::from(toward_eye).extend(toward_slice).as_vec3();
    let texel_px = unit / subpixels;
    projection.light_depth_gain =
        (look::LIGHT_DEPTH * PI / 3.0 / (texel_px * texel_px) / sine) as f32;
    reach
}

/// Fills the table of columns and sets the rows whose ground lies within `spans` (x, y), date line included.
fn choose_cells(plan: &mut Plan, scene: &Scene, level: &Level, spans: [Span; 2]) {
    let grid = &scene.grid;
    let subpixels = f64::from(SUBPIXELS);
    let width_px = grid.dlon_deg / 360.0 * level.world_px;
    let first_turn = -(level.size_px / level.world_px).ceil() as i32 - 1;
    for turn in first_turn..=-first_turn {
        for col in 0..grid.cols {
            let west = (mercator_x(grid.col_west_deg(col)) + f64::from(turn)) * level.world_px
                - level.origin_px[0];
            if (west + width_px) * subpixels >= spans[0][0] && west * subpixels <= spans[0][1] {
                let x_sub = (west * subpixels).round() as i32;
                let middle_deg = grid.col_west_deg(col) + 0.5 * grid.dlon_deg;
                let (sin_lon, cos_lon) = middle_deg.to_radians().sin_cos();
                plan.cols.push(Col {
                    x_sub,
                    x_span_px: width_px as f32,
                    sin_lon: sin_lon as f32,
                    cos_lon: cos_lon as f32,
                    index: col,
                });
            }
        }
    }
    let near = |row: &Row| {
        let north = f64::from(row.y_sub);
        let height = f64::from(row.y_span_px) * subpixels;
        height > 0.0 && north + height >= spans[1][0] && north <= spans[1][1]
    };
    let chosen: Vec<u32> = (0..grid.rows)
        .filter(|&row| near(&plan.rows[row as usize]))
        .collect();
    let cells = &mut plan.params.cells;
    cells.first_row = chosen.first().copied().unwrap_or(0);
    cells.row_count = chosen.last().map_or(0, |row| row + 1) - cells.first_row;
    cells.slot_count = plan.cols.len() as u32;
}

/// Rows and columns that a planned tile can show something of.
pub(super) fn seen(plan: &Plan, grid: &Grid, size_px: u32) -> [Vec<u32>; 2] {
    if plan.mode != Mode::Map {
        let cells = &plan.params.cells;
        let rows = cells.first_row..cells.first_row + cells.row_count;
        let cols = plan.cols.iter().map(|col| col.index);
        return [rows.collect(), cols.collect()];
    }
    let shown = plan.params.interpolation;
    let rows = shown.first_cell / grid.cols..shown.end_cell / grid.cols;
    let pixels = plan.axes.iter().take(size_px as usize);
    // Isolines look one column farther than values between centres of cells.
    let near = pixels.flat_map(|axis| axis.index - 1..=axis.index + 2);
    let cols = i64::from(grid.cols);
    let col = |col: i32| {
        let col = i64::from(col);
        let col = if grid.is_periodic() {
            col.rem_euclid(cols)
        } else {
            col
        };
        (0..cols).contains(&col).then_some(col as u32)
    };
    [rows.collect(), near.filter_map(col).collect()]
}

fn interpolate_rows(plan: &mut Plan, rows: Range<u32>) {
    let cols = plan.params.grid.cols;
    plan.params.interpolation = InterpolateParams {
        first_cell: rows.start * cols,
        end_cell: rows.end * cols,
    };
}

/// Where every pixel column and row of a thematic map falls on the grid.
fn map_axes(plan: &mut Plan, scene: &Scene, tile: Tile, size_px: u32) {
    let grid = &scene.grid;
    plan.params.thematic.edge_sharpness =
        (grid.dlon_deg / 360.0 * world_px(tile, size_px)).max(1.0) as f32;
    plan.axes = axes(grid, tile, size_px);
    let rows = &plan.axes[size_px as usize..];
    let [north, south] = [rows.first(), rows.last()].map(|axis| axis.map_or(0, |axis| axis.index));
    // Isolines look one row farther than values between centres of cells.
    let first = (north - 1).clamp(0, grid.rows as i32) as u32;
    let last = (south + 3).clamp(0, grid.rows as i32) as u32;
    interpolate_rows(plan, first..last.max(first));
}

/// Where every pixel column, then every row of a tile falls between centres of cells.
pub(super) fn axes(grid: &Grid, tile: Tile, size_px: u32) -> Vec<Axis> {
    let world_px = world_px(tile, size_px);
    let axis = |place: f64| Axis {
        index: place.floor() as i32,
        fraction: (place - place.floor()) as f32,
    };
    let share = |pixel: u32, tile_index: u32| {
        (f64::from(tile_index) * f64::from(size_px) + f64::from(pixel) + 0.5) / world_px
    };
    let col = |pixel: u32| {
        let lon = share(pixel, tile.x) * 360.0 - 180.0;
        axis((lon - grid.west_deg).rem_euclid(360.0) / grid.dlon_deg - 0.5)
    };
    let row = |pixel: u32| {
        let lat = mercator_lat_deg(share(pixel, tile.y));
        axis((grid.north_deg - lat) / grid.dlat_deg - 0.5)
    };
    let pixels = 0..size_px;
    pixels.clone().map(col).chain(pixels.map(row)).collect()
}
