//! CPU twin of `map.wgsl`.

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use crate::stages::colour::linear_of;
use crate::stages::layout::{Axis, VIEW_TILE, is_missing, nearest};
use crate::stages::params::Params;
use crate::stages::particles::cpu::share_of;
use crate::stages::place::place_in_range;
use crate::stages::sphere::ground_below;
use crate::stages::uncertainty::hatched;

/// What the stage reads.
pub struct Inputs<'a> {
    pub value: &'a [f32],
    pub palette: &'a [u32],
    /// Columns, then rows of a tile.
    pub axes: &'a [Axis],
    /// Uncertainty of every cell; empty where it is not drawn.
    pub uncertainty: &'a [f32],
    /// How much of every cell holds data; not read where no cell is covered in part.
    pub domain: &'a [u32],
}

/// Every pixel of a thematic map.
pub fn map(params: &Params, inputs: &Inputs<'_>, picture: &mut [Vec4]) {
    for y in 0..params.view.size_px.y {
        for x in 0..params.view.size_px.x {
            let at = (y * params.view.size_px.x + x) as usize;
            picture[at] = if params.view.kind == VIEW_TILE {
                let (col, row) = (x as usize, (params.view.size_px.x + y) as usize);
                colour_at(params, inputs, [inputs.axes[col], inputs.axes[row]], [x, y])
            } else {
                on_globe(params, inputs, [x, y])
            };
        }
    }
}

fn on_globe(params: &Params, inputs: &Inputs<'_>, pixel: [u32; 2]) -> Vec4 {
    let hit = ground_below(params, pixel);
    if !hit.on_ground {
        return Vec4::ZERO;
    }
    let place = [col_of(params, hit.lon_rad), row_of(params, hit.lat_rad)];
    colour_at(params, inputs, place, pixel)
}

/// Where a longitude falls between centres of cells.
pub(crate) fn col_of(params: &Params, lon_rad: f32) -> Axis {
    let east = lon_rad - params.grid.west_rad;
    axis_at((east - (east / TAU).floor() * TAU) * params.grid.cols_per_rad - 0.5)
}

/// The same of a latitude.
pub(crate) fn row_of(params: &Params, lat_rad: f32) -> Axis {
    axis_at((params.grid.north_rad - lat_rad) * params.grid.rows_per_rad - 0.5)
}

fn axis_at(place: f32) -> Axis {
    Axis {
        index: place.floor() as i32,
        fraction: place - place.floor(),
    }
}

/// The cell of a row and a column, if there is one.
pub(crate) fn cell_at(params: &Params, row: i32, col: i32) -> Option<usize> {
    let (rows, cols) = (params.grid.rows as i32, params.grid.cols as i32);
    let col = if params.grid.periodic == 1 {
        col.rem_euclid(cols)
    } else {
        col
    };
    if col < 0 || col >= cols || row < 0 || row >= rows {
        return None;
    }
    Some(row as usize * cols as usize + col as usize)
}

/// Value times the share of the cell that holds data, 1, and that share; or zeros where there is no data.
fn cell_value(params: &Params, inputs: &Inputs<'_>, row: i32, col: i32) -> Vec3 {
    let cell = cell_at(params, row, col);
    match cell.filter(|cell| !is_missing(inputs.value[*cell])) {
        Some(cell) => {
            let share = share_of(params, inputs.domain, cell);
            Vec3::new(inputs.value[cell] * share, 1.0, share)
        }
        None => Vec3::ZERO,
    }
}

fn cell_uncertainty(params: &Params, uncertainty: &[f32], row: i32, col: i32) -> f32 {
    cell_at(params, row, col).map_or(0.0, |cell| uncertainty[cell])
}

fn uncertainty_at(params: &Params, uncertainty: &[f32], [x, y]: [Axis; 2]) -> f32 {
    let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
    let along = |row| {
        let [west, east] =
            [x.index, x.index + 1].map(|col| cell_uncertainty(params, uncertainty, row, col));
        mix(west, east, x.fraction)
    };
    mix(along(y.index), along(y.index + 1), y.fraction)
}

fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}

/// The cell that a place lies in, where cells have nothing between them.
pub(super) fn in_cell(params: &Params, place: Axis) -> Axis {
    if params.values.is_nearest == 1 {
        return Axis {
            index: place.index + i32::from(place.fraction >= 0.5),
            fraction: 0.0,
        };
    }
    place
}

fn colour_at(params: &Params, inputs: &Inputs<'_>, place: [Axis; 2], pixel: [u32; 2]) -> Vec4 {
    let palette = inputs.palette;
    let [x, y] = place.map(|axis| in_cell(params, axis));
    let cell = |row, col| cell_value(params, inputs, row, col);
    let north = mix(
        cell(y.index, x.index),
        cell(y.index, x.index + 1),
        x.fraction,
    );
    let south = mix(
        cell(y.index + 1, x.index),
        cell(y.index + 1, x.index + 1),
        x.fraction,
    );
    let value = mix(north, south, y.fraction);
    let mut alpha = params.thematic.alpha
        * ((value.y - 0.5) * params.thematic.edge_sharpness + 0.5).clamp(0.0, 1.0);
    if alpha <= 0.0 || value.z <= 0.0 {
        return Vec4::ZERO;
    }
    if params.values.has_coverage == 1 {
        alpha *= value.z / value.y;
    }
    let position = place_in_range(params, value.x / value.z);
    let at = nearest(position * 255.0) as usize;
    if params.values.has_shape == 1 {
        alpha *= (palette[256 + at] & 0xffff) as f32 / 65535.0;
    }
    let colour = palette[at];
    let channel = |shift: u32| ((colour >> shift) & 255) as f32 / 255.0;
    let mut rgb = Vec3::new(channel(0), channel(8), channel(16));
    if params.values.has_uncertainty == 1 {
        let uncertainty = uncertainty_at(params, inputs.uncertainty, [x, y]);
        rgb = hatched(params, rgb, uncertainty, pixel);
    }
    linear_of(rgb).extend(1.0) * alpha
}
