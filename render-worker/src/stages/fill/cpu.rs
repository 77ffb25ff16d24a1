//! CPU twin of `fill.wgsl`.

use super::{FillParams, REACH};
use crate::stages::layout::is_missing;

/// Fills missing cells of the domain from data within [`REACH`] cells, weighted by one over the squared distance
/// (Shepard 1968, power 2); cells with no data that near stay missing.
///
/// `values`, `domain`: `[row, col]`; `cosines`: of each row's middle latitude.
pub fn fill(params: &FillParams, values: &[f32], domain: &[u32], cosines: &[f32]) -> Vec<f32> {
    let cols = params.cols as usize;
    let gap = |at: usize| is_missing(values[at]) && domain[at] != 0;
    let cell = |at: usize| {
        if gap(at) {
            from_neighbours(params, values, cosines, at / cols, at % cols)
        } else {
            values[at]
        }
    };
    (0..values.len()).map(cell).collect()
}

fn from_neighbours(
    params: &FillParams,
    values: &[f32],
    cosines: &[f32],
    row: usize,
    col: usize,
) -> f32 {
    let (rows, cols) = (params.rows as i32, params.cols as i32);
    let width = cosines[row] * params.lon_per_lat;
    let (mut weights, mut sum) = (0.0, 0.0);
    for dy in -REACH..=REACH {
        let y = row as i32 + dy;
        if y < 0 || y >= rows {
            continue;
        }
        for dx in -params.reach_x..=params.reach_x {
            let x = col as i32 + dx;
            let x = if params.periodic == 1 {
                x.rem_euclid(cols)
            } else {
                x
            };
            if x < 0 || x >= cols {
                continue;
            }
            let value = values[(y * cols + x) as usize];
            if !is_missing(value) {
                let (east, south) = (dx as f32 * width, dy as f32);
                let weight = 1.0 / (east * east + south * south);
                weights += weight;
                sum += weight * value;
            }
        }
    }
    if weights > 0.0 {
        sum / weights
    } else {
        values[row * params.cols as usize + col]
    }
}
