//! CPU twin of `map.wgsl`.

use std::f32::consts::TAU;

use glam::{Vec2, Vec4};

use crate::stages::layout::{Axis, Params, VIEW_TILE, is_missing, nearest};
use crate::stages::sphere::ground_below;

/// Every pixel of a thematic map; `axes` holds the columns, then the rows of a tile.
pub fn map(params: &Params, value: &[f32], palette: &[u32], axes: &[Axis], picture: &mut [Vec4]) {
    for y in 0..params.height {
        for x in 0..params.width {
            let at = (y * params.width + x) as usize;
            picture[at] = if params.view == VIEW_TILE {
                color_at(
                    params,
                    value,
                    palette,
                    axes[x as usize],
                    axes[(params.width + y) as usize],
                )
            } else {
                on_globe(params, value, palette, [x, y])
            };
        }
    }
}

fn on_globe(params: &Params, value: &[f32], palette: &[u32], pixel: [u32; 2]) -> Vec4 {
    let hit = ground_below(params, pixel);
    if !hit.on_ground {
        return Vec4::ZERO;
    }
    let east = hit.lon_rad - params.grid_west_rad;
    let x = (east - (east / TAU).floor() * TAU) * params.cols_per_rad - 0.5;
    let y = (params.grid_north_rad - hit.lat_rad) * params.rows_per_rad - 0.5;
    color_at(params, value, palette, axis_at(x), axis_at(y))
}

fn axis_at(place: f32) -> Axis {
    Axis {
        index: place.floor() as i32,
        fraction: place - place.floor(),
    }
}

fn cell_value(params: &Params, value: &[f32], row: i32, col: i32) -> Vec2 {
    let (rows, cols) = (params.rows as i32, params.cols as i32);
    let col = if params.periodic == 1 {
        col.rem_euclid(cols)
    } else {
        col
    };
    if col < 0 || col >= cols || row < 0 || row >= rows {
        return Vec2::ZERO;
    }
    let value = value[row as usize * cols as usize + col as usize];
    if is_missing(value) {
        Vec2::ZERO
    } else {
        Vec2::new(value, 1.0)
    }
}

fn mix(a: Vec2, b: Vec2, t: f32) -> Vec2 {
    a * (1.0 - t) + b * t
}

fn color_at(params: &Params, value: &[f32], palette: &[u32], x: Axis, y: Axis) -> Vec4 {
    let cell = |row, col| cell_value(params, value, row, col);
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
    let alpha = params.map_alpha * ((value.y - 0.5) * params.edge_sharpness + 0.5).clamp(0.0, 1.0);
    if alpha <= 0.0 {
        return Vec4::ZERO;
    }
    let position =
        ((value.x / value.y - params.transfer_low) * params.transfer_per_unit).clamp(0.0, 1.0);
    let color = palette[nearest(position * 255.0) as usize];
    let channel = |shift: u32| ((color >> shift) & 255) as f32 / 255.0;
    Vec4::new(channel(0), channel(8), channel(16), 1.0) * alpha
}
