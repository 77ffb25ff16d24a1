//! CPU twin of `isolines.wgsl`.

use glam::{Vec2, Vec3};

use super::params::Isoline;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::stages::layout::{Axis, GroundAxis, MISSING, VIEW_TILE, is_missing, nearest};
use crate::stages::map::cpu::{cell_at, col_of, row_of};
use crate::stages::params::Params;
use crate::stages::particles::cpu::share_of;
use crate::stages::sphere::{ground_below, line_share};

const CROWDED: f32 = 0.2;
const TOO_CROWDED: f32 = 0.5;
const RIM_PER_PX: f32 = 0.3;
const LEAST_LOOP_PX: f32 = 3.0;
const FLAT_PX: f32 = 10000.0;

/// What the stage reads.
pub struct Inputs<'a> {
    /// The grid at the instant.
    pub value: &'a [f32],
    /// How much of every cell holds data; not read where no cell is covered in part.
    pub domain: &'a [u32],
    /// Columns, then rows of a tile.
    pub axes: &'a [Axis],
    pub ground_axes: &'a [GroundAxis],
    pub levels: &'a [Isoline],
}

impl<'a> Inputs<'a> {
    /// Those of a planned picture with this grid at its instant.
    pub fn of(plan: &'a Plan, scene: &'a Scene, value: &'a [f32]) -> Self {
        Self {
            value,
            domain: scene.domain.content(),
            axes: &plan.axes,
            ground_axes: &plan.ground_axes,
            levels: &plan.isolines,
        }
    }
}

/// A place between centres of cells, the value there over the range of colours, and its change for each column and row.
#[derive(Debug, Clone, Copy)]
struct FieldAt {
    x: Axis,
    y: Axis,
    value: f32,
    per_col: f32,
    per_row: f32,
}

/// How a field lies on the screen: what its value changes by over a pixel, the size of a cell, and how much is seen of lines.
struct OnScreen {
    slope: f32,
    cell_px: Vec2,
    inside: f32,
}

impl OnScreen {
    /// `slope_of`: what changes so much for each radian east and north changes so much over a pixel.
    fn of(params: &Params, field: &FieldAt, slope_of: impl Fn(Vec2) -> f32, inside: f32) -> Self {
        let grid = &params.grid;
        let cells_per_px = Vec2::new(
            slope_of(Vec2::new(grid.cols_per_rad, 0.0)),
            slope_of(Vec2::new(0.0, grid.rows_per_rad)),
        );
        Self {
            slope: slope_of(per_rad_of(params, field)),
            cell_px: 1.0 / cells_per_px.max(Vec2::splat(1.0e-20)),
            inside,
        }
    }
}

/// The lines of every pixel.
pub fn draw_lines(params: &Params, inputs: &Inputs<'_>, lines: &mut [u32]) {
    let size_px = params.view.size_px;
    for y in 0..size_px.y {
        for x in 0..size_px.x {
            lines[(y * size_px.x + x) as usize] = one(params, inputs, [x, y]);
        }
    }
}

fn one(params: &Params, inputs: &Inputs<'_>, [x, y]: [u32; 2]) -> u32 {
    if params.view.kind == VIEW_TILE {
        let (col, row) = (x as usize, (params.view.size_px.x + y) as usize);
        let field = field_at(params, inputs, [inputs.axes[col], inputs.axes[row]]);
        let slope = |per_rad| slope_on_tile(params, per_rad, inputs.ground_axes[row].cos);
        return field.map_or(0, |field| {
            line_of(
                params,
                inputs,
                &field,
                &OnScreen::of(params, &field, slope, 1.0),
            )
        });
    }
    let hit = ground_below(params, [x, y]);
    if !hit.on_ground {
        return 0;
    }
    let slope = |per_rad: Vec2| slope_on_globe(params, per_rad, hit.normal);
    let inside = (hit.rim_px * RIM_PER_PX - 0.5).clamp(0.0, 1.0) * line_share(&hit);
    let mut word = 0;
    if params.isolines.count > 0 {
        let place = [col_of(params, hit.lon_rad), row_of(params, hit.lat_rad)];
        let field = field_at(params, inputs, place);
        word = field.map_or(0, |field| {
            line_of(
                params,
                inputs,
                &field,
                &OnScreen::of(params, &field, slope, inside),
            )
        });
    }
    if params.isolines.graticule_per_rad > 0.0 {
        let meridian = graticule_of(params, hit.lon_rad, slope(Vec2::X));
        let parallel = graticule_of(params, hit.lat_rad, slope(Vec2::Y));
        word |= (nearest(meridian.max(parallel) * inside * 4095.0) as u32) << 20;
    }
    word
}

/// Value times the share of the cell that holds data, 1, and that share; or zeros where there is no data.
fn cell_value(params: &Params, inputs: &Inputs<'_>, row: i32, col: i32) -> Vec3 {
    let cell = cell_at(params, row, col);
    match cell.filter(|cell| !is_missing(inputs.value[*cell])) {
        Some(cell) => {
            let share = share_of(params, inputs.domain, cell);
            let own = &params.isolines;
            let value = (inputs.value[cell] - own.low) * own.per_unit;
            Vec3::new(value * share, 1.0, share)
        }
        None => Vec3::ZERO,
    }
}

fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}

fn field_at(params: &Params, inputs: &Inputs<'_>, [x, y]: [Axis; 2]) -> Option<FieldAt> {
    let cell = |row, col| cell_value(params, inputs, row, col);
    let [north_west, north_east] = [x.index, x.index + 1].map(|col| cell(y.index, col));
    let [south_west, south_east] = [x.index, x.index + 1].map(|col| cell(y.index + 1, col));
    let north = mix(north_west, north_east, x.fraction);
    let south = mix(south_west, south_east, x.fraction);
    let sum = mix(north, south, y.fraction);
    if sum.y < 0.5 || sum.z <= 0.0 {
        return None;
    }
    let east = mix(north_east - north_west, south_east - south_west, y.fraction);
    let down = south - north;
    let value = sum.x / sum.z;
    Some(FieldAt {
        x,
        y,
        value,
        per_col: (east.x - value * east.z) / sum.z,
        per_row: (down.x - value * down.z) / sum.z,
    })
}

fn per_rad_of(params: &Params, field: &FieldAt) -> Vec2 {
    let grid = &params.grid;
    Vec2::new(
        field.per_col * grid.cols_per_rad,
        -field.per_row * grid.rows_per_rad,
    )
}

fn slope_on_tile(params: &Params, per_rad: Vec2, cos_lat: f32) -> f32 {
    Vec2::new(per_rad.x, per_rad.y * cos_lat).length() * params.isolines.rad_per_px
}

fn slope_on_globe(params: &Params, per_rad: Vec2, normal: Vec3) -> f32 {
    let view = &params.view;
    let toward = normal - view.eye;
    let sight = toward / toward.length();
    let along = 1.0 / sight.dot(normal);
    let way = toward.dot(view.forward) / view.focal_px;
    let right = (view.right - sight * (view.right.dot(normal) * along)) * way;
    let down = (view.up - sight * (view.up.dot(normal) * along)) * -way;
    let cos_lat = normal.truncate().length().max(1.0e-6);
    let east = Vec3::new(normal.y, -normal.x, 0.0) / cos_lat;
    let north = (-normal.truncate() * (normal.z / cos_lat)).extend(cos_lat);
    let rise = east * (per_rad.x / cos_lat) + north * per_rad.y;
    Vec2::new(rise.dot(right), rise.dot(down)).length()
}

fn crowd(per_px: f32) -> f32 {
    ((TOO_CROWDED - per_px) / (TOO_CROWDED - CROWDED)).clamp(0.0, 1.0)
}

fn graticule_of(params: &Params, angle: f32, slope: f32) -> f32 {
    let own = &params.isolines;
    let place = angle * own.graticule_per_rad;
    let per_px = (slope * own.graticule_per_rad).max(1.0e-20);
    let off_px = (place - (place + 0.5).floor()).abs() / per_px;
    (own.graticule_half_px + 0.5 - off_px).clamp(0.0, 1.0) * crowd(per_px)
}

/// Value of a cell over the range of colours, or none.
fn value_of(params: &Params, inputs: &Inputs<'_>, row: i32, col: i32) -> f32 {
    let own = cell_value(params, inputs, row, col);
    if own.z <= 0.0 { MISSING } else { own.x / own.z }
}

/// Of the four cells round a place the one that alone lies on its side of a level: its number.
fn lone_corner(params: &Params, inputs: &Inputs<'_>, field: &FieldAt, level: f32) -> Option<i32> {
    let (mut above, mut below) = (0, 0);
    let (mut high, mut low) = (0, 0);
    for i in 0..4 {
        let (row, col) = (field.y.index + i / 2, field.x.index + i % 2);
        let own = value_of(params, inputs, row, col);
        if is_missing(own) {
            continue;
        }
        if own > level {
            (above, high) = (above + 1, i);
        } else {
            (below, low) = (below + 1, i);
        }
    }
    match (above, below) {
        (1, _) => Some(high),
        (_, 1) => Some(low),
        _ => None,
    }
}

/// How much is drawn of a line at a place: less of one that runs round a single cell, a dot where it is small.
fn loop_share(
    params: &Params,
    inputs: &Inputs<'_>,
    field: &FieldAt,
    level: f32,
    cell_px: Vec2,
) -> f32 {
    let Some(corner) = lone_corner(params, inputs, field, level) else {
        return 1.0;
    };
    let (row, col) = (field.y.index + corner / 2, field.x.index + corner % 2);
    let own = value_of(params, inputs, row, col);
    let mut cells = Vec2::ZERO;
    for i in (0..9).filter(|i| *i != 4) {
        let other = value_of(params, inputs, row + i / 3 - 1, col + i % 3 - 1);
        let is_there = !is_missing(other);
        if is_there && (other > level) == (own > level) {
            return 1.0;
        }
        if i % 2 == 0 {
            continue;
        }
        let reach = if is_there {
            (own - level) / (own - other)
        } else {
            0.5
        };
        if i == 1 || i == 7 {
            cells.y += reach;
        } else {
            cells.x += reach;
        }
    }
    let size_px = (cells * cell_px).max_element();
    (size_px / LEAST_LOOP_PX - 1.0).clamp(0.0, 1.0)
}

fn line_of(params: &Params, inputs: &Inputs<'_>, field: &FieldAt, screen: &OnScreen) -> u32 {
    let (mut cover, mut grey) = (0.0, 0.0);
    for level in inputs.levels {
        let off_px = (field.value - level.value).abs() / screen.slope.max(1.0e-20);
        let per_px = screen.slope / level.gap;
        let steep = (per_px * (2.0 * FLAT_PX) - 1.0).clamp(0.0, 1.0);
        let mut own =
            (level.half_px + 0.5 - off_px).clamp(0.0, 1.0) * level.alpha * crowd(per_px) * steep;
        if own > cover {
            own *= loop_share(params, inputs, field, level.value, screen.cell_px);
        }
        if own > cover {
            (cover, grey) = (own, level.grey);
        }
    }
    nearest(cover * screen.inside * 4095.0) as u32 | (nearest(grey * 255.0) as u32) << 12
}
