//! CPU twin of `eye.wgsl`.

use glam::{Vec2, Vec4};

use crate::stages::layout::{DEPTH_ONE, Entry, KERNEL_BALL, KERNEL_CLOUD, Params, SCREEN_TILE_PX, SUBPIXELS};

const MOST_SUM: u32 = 0x7fff_ffff;
const MOST_DEPTH: f32 = 15.0;

/// Share of a splat's depth at `offset` radii from its centre.
pub fn weight_at(kernel: u32, offset: Vec2, radius_px: f32) -> f32 {
    let q = offset.dot(offset);
    if kernel == KERNEL_CLOUD {
        let inside = (1.0 - q).max(0.0);
        return inside * inside;
    }
    ((1.0 - q.sqrt()) * radius_px).clamp(0.0, 1.0)
}

fn ball_light(offset: Vec2) -> f32 {
    let toward = (1.0 - offset.dot(offset)).max(0.0).sqrt();
    0.55 + 0.45 * (-0.45 * offset.x - 0.55 * offset.y + 0.70 * toward).clamp(0.0, 1.0)
}

fn contribution(params: &Params, entry: &Entry, pixel_sub: [i32; 2]) -> [u32; 4] {
    let [dx, dy] = [pixel_sub[0] - entry.x_sub, pixel_sub[1] - entry.y_sub];
    let offset = Vec2::new(dx as f32, dy as f32) * (entry.inverse_radius_px / SUBPIXELS as f32);
    if offset.dot(offset) >= 1.0 {
        return [0; 4];
    }
    let depth = (entry.tau * weight_at(params.kernel, offset, 1.0 / entry.inverse_radius_px)).min(MOST_DEPTH);
    let amount = (depth * DEPTH_ONE + 0.5) as u32;
    let light = if params.kernel == KERNEL_BALL { ball_light(offset) } else { 1.0 };
    let channel = |shift: u32| {
        let plain = (entry.color >> shift) & 255;
        amount * if params.kernel == KERNEL_BALL { (plain as f32 * light + 0.5) as u32 } else { plain }
    };
    [channel(0), channel(8), channel(16), amount]
}

/// Colour with alpha, premultiplied, once the slice with these sums is blended into it.
pub fn blended(front_to_back: bool, picture: Vec4, sums: [u32; 4]) -> Vec4 {
    if sums[3] == 0 {
        return picture;
    }
    let depth = sums[3] as f32;
    let alpha = 1.0 - (-depth / DEPTH_ONE).exp();
    let rgb = Vec4::new(sums[0] as f32, sums[1] as f32, sums[2] as f32, depth * 255.0) / (depth * 255.0);
    let slice = rgb * alpha;
    if front_to_back { picture + slice * (1.0 - picture.w) } else { picture * (1.0 - alpha) + slice }
}

/// Every pixel from the lists that end where `list_ends` says.
pub fn eye(params: &Params, list_ends: &[u32], entries: &[Entry], picture: &mut [Vec4]) {
    for tile_y in 0..params.tiles_y {
        for tile_x in 0..params.tiles_x {
            let first_list = ((tile_y * params.tiles_x + tile_x) * params.slices) as usize;
            let first = if first_list == 0 { 0 } else { list_ends[first_list - 1] as usize };
            let end = list_ends[first_list + params.slices as usize - 1] as usize;
            let list = &entries[first..end];
            for y in tile_y * SCREEN_TILE_PX..((tile_y + 1) * SCREEN_TILE_PX).min(params.height) {
                for x in tile_x * SCREEN_TILE_PX..((tile_x + 1) * SCREEN_TILE_PX).min(params.width) {
                    picture[(y * params.width + x) as usize] = pixel(params, list, x, y);
                }
            }
        }
    }
}

fn pixel(params: &Params, list: &[Entry], x: u32, y: u32) -> Vec4 {
    let front_to_back = params.front_to_back == 1;
    let pixel_sub = [x, y].map(|p| p as i32 * SUBPIXELS + SUBPIXELS / 2);
    let mut color = Vec4::ZERO;
    let mut sums = [0u32; 4];
    let mut slice = 0;
    for entry in list {
        if entry.color >> 24 != slice {
            slice = entry.color >> 24;
            color = blended(front_to_back, color, sums);
            sums = [0; 4];
        }
        let own = contribution(params, entry, pixel_sub);
        for (sum, own) in sums.iter_mut().zip(own) {
            *sum = (*sum + own).min(MOST_SUM);
        }
    }
    blended(front_to_back, color, sums)
}
