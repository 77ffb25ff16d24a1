//! CPU twin of `bin.wgsl`.

use crate::stages::layout::{Entry, Params, SCREEN_TILE_PX, SUBPIXELS, Splat};

/// Screen tiles a splat touches, as half-open ranges of columns and rows.
fn reach_of(params: &Params, splat: &Splat) -> [std::ops::Range<u32>; 2] {
    if splat.tau <= 0.0 {
        return [0..0, 0..0];
    }
    let tile_sub = SCREEN_TILE_PX as i32 * SUBPIXELS;
    let radius = (splat.radius_px * SUBPIXELS as f32).ceil() as i32;
    let axis = |place: i32, tiles: u32| {
        let low = (place - radius).div_euclid(tile_sub).max(0) as u32;
        let end = ((place + radius).div_euclid(tile_sub) + 1).clamp(0, tiles as i32) as u32;
        low..end.max(low)
    };
    [axis(splat.x_sub, params.tiles_x), axis(splat.y_sub, params.tiles_y)]
}

fn lists_of(params: &Params, splat: &Splat) -> impl Iterator<Item = usize> + use<> {
    let [xs, ys] = reach_of(params, splat);
    let (tiles_x, slices, slice) = (params.tiles_x, params.slices, splat.slice as u32);
    ys.flat_map(move |y| xs.clone().map(move |x| ((y * tiles_x + x) * slices + slice) as usize))
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
        let entry = Entry {
            x_sub: splat.x_sub,
            y_sub: splat.y_sub,
            inverse_radius_px: 1.0 / splat.radius_px,
            tau: splat.tau,
            color: (splat.color & 0x00ff_ffff) | ((splat.slice as u32) << 24),
        };
        for list in lists_of(params, splat) {
            entries[counts[list] as usize] = entry;
            counts[list] += 1;
        }
    }
}
