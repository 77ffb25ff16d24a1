//! CPU twin of `light.wgsl`.

use crate::stages::layout::{DEPTH_ONE, Params, Splat, nearest};

const MOST_GIVEN: f32 = 16.0;
const DARK: u32 = 0x7fff_ffff;

struct Texel {
    index: [i32; 2],
    part: [f32; 2],
}

fn texel_of(params: &Params, splat: &Splat) -> Texel {
    let place = [splat.light_u, splat.light_v];
    let index = place.map(|p| p.div_euclid(params.light_unit));
    let part = [0, 1].map(|axis| {
        (place[axis] - index[axis] * params.light_unit) as f32 / params.light_unit as f32
    });
    Texel { index, part }
}

fn address(params: &Params, texel: [i32; 2], slice: u32) -> Option<usize> {
    let [x, y] = texel;
    let inside =
        x >= 0 && y >= 0 && x < params.light_width as i32 && y < params.light_height as i32;
    let layer = slice as usize * params.light_height as usize;
    inside.then(|| (layer + y as usize) * params.light_width as usize + x as usize)
}

/// Adds every splat's depth to the four nearest texels of its slice.
pub fn deposit(params: &Params, splats: &[Splat], light: &mut [u32]) {
    for splat in splats.iter().filter(|splat| splat.tau > 0.0) {
        let Texel {
            index: [x, y],
            part,
        } = texel_of(params, splat);
        let east = splat.light_depth * part[0];
        let west = splat.light_depth - east;
        let shares = [
            ([x, y], west * (1.0 - part[1])),
            ([x + 1, y], east * (1.0 - part[1])),
            ([x, y + 1], west * part[1]),
            ([x + 1, y + 1], east * part[1]),
        ];
        for (texel, depth) in shares {
            if let Some(at) = address(params, texel, splat.slice as u32) {
                light[at] =
                    light[at].wrapping_add((depth.min(MOST_GIVEN) * DEPTH_ONE + 0.5) as u32);
            }
        }
    }
}

/// Turns the depth of each slice into the depth above its upper plane; one more layer holds the whole.
pub fn prefix(params: &Params, light: &mut [u32]) {
    let layer = params.light_width as usize * params.light_height as usize;
    let mut above = vec![0u32; layer];
    for slice in light
        .chunks_exact_mut(layer)
        .take(params.slices as usize + 1)
    {
        for (own, above) in slice.iter_mut().zip(&mut above) {
            let depth = std::mem::replace(own, *above);
            *above = (*above + depth.min(DARK)).min(DARK);
        }
    }
}

fn depth_above(params: &Params, light: &[u32], texel: [i32; 2], slice: u32, part: f32) -> f32 {
    let Some(at) = address(params, texel, slice) else {
        return 0.0;
    };
    let layer = params.light_width as usize * params.light_height as usize;
    let (before, behind) = (light[at] as f32, light[at + layer] as f32);
    (before + (behind - before) * part) / DEPTH_ONE
}

fn dimmed(color: u32, shade: f32) -> u32 {
    let channel = |shift: u32| {
        (nearest((((color >> shift) & 255) as f32 * shade).min(255.0)) as u32) << shift
    };
    channel(0) | channel(8) | channel(16) | (color & 0xff00_0000)
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Dims every splat's colour by what lies between it and the sun.
pub fn shade(params: &Params, light: &[u32], splats: &mut [Splat]) {
    for splat in splats.iter_mut().filter(|splat| splat.tau > 0.0) {
        let Texel {
            index: [x, y],
            part: [east, south],
        } = texel_of(params, splat);
        let slice = splat.slice as u32;
        let part = splat.slice - slice as f32;
        let depth = |texel| depth_above(params, light, texel, slice, part);
        let north_row = mix(depth([x, y]), depth([x + 1, y]), east);
        let south_row = mix(depth([x, y + 1]), depth([x + 1, y + 1]), east);
        let transmittance = (-mix(north_row, south_row, south)).exp();
        splat.color = dimmed(
            splat.color,
            params.ambient + params.direct * transmittance * splat.day,
        );
    }
}
