//! A thematic tile with nothing around it, from fields to bytes on a processor: what the twins of `interpolate.wgsl`,
//! `map.wgsl` and `compose.wgsl` make of it one after the other, bit for bit.
//!
//! A tile lies along the axes of its grid, so that what a row of cells gives a row of pixels is worked out once and serves
//! all rows of pixels beside it; and a colour comes back from linear light as it went in, so that it need not go there. On
//! 256 x 256 pixels that is a tenth of the work, and software adapters take more than either.

use contract::job::{Mode, RenderJob, View};

use super::cpu::{cell_at, in_cell};
use crate::plan::Plan;
use crate::scene::Scene;
use crate::stages::interpolate::cpu::interpolated;
use crate::stages::layout::{Axis, VIEW_TILE, is_missing, nearest};
use crate::stages::params::Params;
use crate::stages::particles::cpu::share_of;
use crate::stages::place::place_in_range;

/// Can a job be one of these tiles, as far as it alone says?
pub fn may_suit(job: &RenderJob) -> bool {
    job.mode == Mode::Map
        && matches!(job.view, View::Tile { .. })
        && !job.style.context.coastlines
        && job.style.context.isolines.is_none()
        && job.relief.is_none()
        && job.trails.is_none()
}

/// Is this a picture that [`draw`] draws?
pub fn suits(plan: &Plan) -> bool {
    let params = &plan.params;
    plan.mode == Mode::Map
        && params.view.kind == VIEW_TILE
        && !params.in_context
        && params.values.has_uncertainty == 0
        // Larger ones are drawn in parts.
        && plan.parts().len() == 1
}

/// Draws all of it; its pixels as RGBA8, red lowest.
pub fn draw(plan: &Plan, scene: &Scene) -> Vec<u8> {
    let tile = Tile {
        params: &plan.params,
        before: scene.value.before.cells.content(),
        after: scene.value.after.cells.content(),
        domain: scene.domain.content(),
    };
    let [width, height] = plan.size_px().map(|px| px as usize);
    let axes: Vec<Axis> = plan
        .axes
        .iter()
        .map(|axis| in_cell(&plan.params, *axis))
        .collect();
    let (cols, rows) = axes.split_at(width);
    let colours = Colours::of(plan);
    let mut image = Vec::with_capacity(width * height * 4);
    let mut sides = [Along::of(width), Along::of(width)];
    for axis in &rows[..height] {
        // The rows of cells north and south of these pixels are often those of the pixels before, or one of them is.
        if sides[1].row == Some(axis.index) {
            sides.swap(0, 1);
        }
        for (side, row) in sides.iter_mut().zip([axis.index, axis.index + 1]) {
            if side.row != Some(row) {
                tile.fill(side, row, cols);
            }
        }
        tile.draw_row(&sides, axis.fraction, &colours, &mut image);
    }
    image
}

/// What a row of cells gives each column of pixels.
struct Along {
    /// Which row of cells; it may lie outside the grid.
    row: Option<i32>,
    /// Mean value, weighted by the share of each cell that holds data.
    value: Vec<f32>,
    /// Share of the weight that is of cells with data.
    weight: Vec<f32>,
    /// The same, less what of these cells holds none; as `weight` where every cell is covered all over.
    share: Vec<f32>,
}

impl Along {
    fn of(width: usize) -> Self {
        Self {
            row: None,
            value: vec![0.0; width],
            weight: vec![0.0; width],
            share: vec![0.0; width],
        }
    }
}

/// The palette, as pixels have it.
struct Colours {
    /// Red, green and blue, red lowest; no alpha.
    rgb: Vec<u32>,
    /// What the look's own opacity leaves of alpha, for each colour; empty without any.
    opacity: Vec<f32>,
}

impl Colours {
    fn of(plan: &Plan) -> Self {
        let (colours, shape) = plan.palette.split_at(256);
        let opacity = |word: &u32| (word & 0xffff) as f32 / 65535.0;
        Self {
            rgb: colours.iter().map(|colour| colour & 0x00ff_ffff).collect(),
            opacity: if plan.params.values.has_shape == 1 {
                shape[..256].iter().map(opacity).collect()
            } else {
                vec![]
            },
        }
    }
}

/// What a tile is drawn from.
struct Tile<'a> {
    params: &'a Params,
    /// Fields, `[row, col]`.
    before: &'a [f32],
    after: &'a [f32],
    domain: &'a [u32],
}

impl Tile<'_> {
    /// Value times the share of the cell that holds data, 1, and that share; or zeros where there is no data.
    fn cell(&self, row: i32, col: i32) -> [f32; 3] {
        let Some(cell) = cell_at(self.params, row, col) else {
            return [0.0; 3];
        };
        let weight = self.params.values.weight;
        let value = interpolated(self.before[cell], self.after[cell], weight);
        if is_missing(value) {
            return [0.0; 3];
        }
        let share = share_of(self.params, self.domain, cell);
        [value * share, 1.0, share]
    }

    fn fill(&self, along: &mut Along, row: i32, cols: &[Axis]) {
        along.row = Some(row);
        let mut last: Option<(i32, [[f32; 3]; 2])> = None;
        for (at, axis) in cols.iter().enumerate() {
            let cells = match last {
                Some((col, cells)) if col == axis.index => cells,
                _ => [axis.index, axis.index + 1].map(|col| self.cell(row, col)),
            };
            last = Some((axis.index, cells));
            let [west, east] = cells;
            let mixed = |of: usize| mix(west[of], east[of], axis.fraction);
            along.value[at] = mixed(0);
            along.weight[at] = mixed(1);
            along.share[at] = mixed(2);
        }
    }

    fn draw_row(&self, sides: &[Along; 2], south: f32, colours: &Colours, image: &mut Vec<u8>) {
        let params = self.params;
        let [north, below] = sides;
        for at in 0..north.value.len() {
            let mixed = |of: fn(&Along) -> &[f32]| mix(of(north)[at], of(below)[at], south);
            let weight = mixed(|along| &along.weight);
            let share = mixed(|along| &along.share);
            let edge = (weight - 0.5) * params.thematic.edge_sharpness + 0.5;
            let mut alpha = params.thematic.alpha * edge.clamp(0.0, 1.0);
            let mut pixel = 0;
            if alpha > 0.0 && share > 0.0 {
                if params.values.has_coverage == 1 {
                    alpha *= share / weight;
                }
                let value = mixed(|along| &along.value) / share;
                let colour = nearest(place_in_range(params, value) * 255.0) as usize;
                if let Some(opacity) = colours.opacity.get(colour) {
                    alpha *= opacity;
                }
                let alpha = (alpha.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
                if alpha > 0 {
                    pixel = colours.rgb[colour] | alpha << 24;
                }
            }
            image.extend_from_slice(&pixel.to_le_bytes());
        }
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}
