//! CPU twin of `reach.wgsl`, `bin.wgsl` and of the second half of the sort in `scatter.wgsl`.

use crate::stages::layout::{
    BEYOND_BIT, Entry, KERNEL_CLOUD, SCREEN_TILE_SHIFT, SUBPIXELS, Splat, nearest,
};
use crate::stages::params::Params;

const MOST_DEPTH: f32 = 65_535.0;

fn radius_of(params: &Params, splat: &Splat) -> i32 {
    (nearest(splat.radius_px * SUBPIXELS as f32) >> params.lists.entry_shift).max(1)
}

/// Optical depth at the centre in whole parts; a splat of none is in no list. A cloud whose radius was rounded keeps its mass.
fn depth_of(params: &Params, splat: &Splat) -> u32 {
    let mut tau = splat.tau;
    if params.lists.kernel == KERNEL_CLOUD {
        let rounded_px =
            (radius_of(params, splat) << params.lists.entry_shift) as f32 / SUBPIXELS as f32;
        let wider = splat.radius_px / rounded_px;
        tau *= wider * wider;
    }
    ((tau * params.lists.depth_one).min(MOST_DEPTH) + 0.5) as u32
}

/// Screen tiles a splat touches, as half-open ranges of columns and rows.
fn reach_of(params: &Params, splat: &Splat) -> [std::ops::Range<u32>; 2] {
    if splat.tau <= 0.0 || depth_of(params, splat) == 0 {
        return [0..0, 0..0];
    }
    let radius = radius_of(params, splat) << params.lists.entry_shift;
    let axis = |place: i32, tiles: u32| {
        let low = ((place - radius) >> SCREEN_TILE_SHIFT).max(0) as u32;
        let end = (((place + radius) >> SCREEN_TILE_SHIFT) + 1).clamp(0, tiles as i32) as u32;
        low..end.max(low)
    };
    [
        axis(splat.x_sub, params.view.tiles.x),
        axis(splat.y_sub, params.view.tiles.y),
    ]
}

fn lists_of(params: &Params, splat: &Splat) -> impl Iterator<Item = usize> + use<> {
    let [xs, ys] = reach_of(params, splat);
    let (tiles_x, slices, slice) = (params.view.tiles.x, params.view.slices, splat.slice as u32);
    ys.flat_map(move |y| {
        xs.clone()
            .map(move |x| ((y * tiles_x + x) * slices + slice) as usize)
    })
}

/// Adds the number of splats in every list of (screen tile, slice).
pub fn count(params: &Params, splats: &[Splat], counts: &mut [u32]) {
    for splat in splats {
        for list in lists_of(params, splat) {
            counts[list] += 1;
        }
    }
}

/// Turns counts into starts; the number of all entries comes back.
pub fn scan(counts: &mut [u32]) -> u32 {
    let mut start = 0;
    for count in counts {
        start += std::mem::replace(count, start);
    }
    start
}

/// Writes every entry and moves each list's start to its end.
pub fn scatter(params: &Params, splats: &[Splat], counts: &mut [u32], entries: &mut [Entry]) {
    for splat in splats {
        let radius = radius_of(params, splat) as u32;
        let size = radius | (splat.is_beyond * BEYOND_BIT) | (depth_of(params, splat) << 16);
        let colour = (splat.colour & 0x00ff_ffff) | ((splat.slope + 128) as u32) << 24;
        for list in lists_of(params, splat) {
            let tile = list as u32 / params.view.slices;
            let corner = [tile % params.view.tiles.x, tile / params.view.tiles.x]
                .map(|t| (t << SCREEN_TILE_SHIFT) as i32);
            let offset =
                |place: i32, corner: i32| ((place - corner) >> params.lists.entry_shift) as u32;
            let place =
                (offset(splat.x_sub, corner[0]) & 0xffff) | (offset(splat.y_sub, corner[1]) << 16);
            entries[counts[list] as usize] = Entry {
                place,
                size,
                colour,
            };
            counts[list] += 1;
        }
    }
}
