//! CPU twin of `compose.wgsl` without surroundings (`composed.wgsl`).

use glam::{Vec3, Vec4};

use crate::stages::colour::srgb_of;
use crate::stages::params::Params;

/// Bytes of every pixel, red lowest, from the blended colours.
pub fn compose(params: &Params, picture: &[Vec4], image: &mut [u32]) {
    for y in 0..params.view.size_px.y {
        for x in 0..params.view.size_px.x {
            let at = (y * params.view.size_px.x + x) as usize;
            image[at] = bytes_of(params, picture[at], [x, y], false);
        }
    }
}

/// Threshold of ordered dithering at a place (Bayer 1973), 0 to 63.
fn threshold([x, y]: [u32; 2]) -> u32 {
    let (bits, down) = ((x ^ y) & 7, y & 7);
    (bits & 1) << 5
        | (down & 1) << 4
        | (bits & 2) << 2
        | (down & 2) << 1
        | (bits & 4) >> 1
        | (down & 4) >> 2
}

/// Straight-alpha sRGB in RGBA8, red lowest, of premultiplied linear light; what is seen beside a globe is dithered.
pub(super) fn bytes_of(params: &Params, colour: Vec4, [x, y]: [u32; 2], is_dithered: bool) -> u32 {
    let alpha = (colour.w.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
    if alpha == 0 {
        return 0;
    }
    let view = &params.view;
    let rounding = if is_dithered {
        let place = [x + view.origin_px.x as u32, y + view.origin_px.y as u32];
        (threshold(place) as f32 + 0.5) / 64.0
    } else {
        0.5
    };
    let srgb = srgb_of(colour.truncate() / colour.w);
    let rgb = srgb.clamp(Vec3::ZERO, Vec3::ONE) * 255.0 + rounding;
    rgb.x as u32 | (rgb.y as u32) << 8 | (rgb.z as u32) << 16 | alpha << 24
}
