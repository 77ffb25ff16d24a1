//! CPU twin of `deposit.wgsl`, `light.wgsl` and `shade.wgsl`.

use crate::stages::colour::{codes_of, with_codes};
use crate::stages::layout::{LOOK, Splat, nearest};
use crate::stages::params::Params;

const MOST_GIVEN: f32 = (1 << 25) as f32;
const DARK: u32 = 0x7fff_ffff;

/// Places in a cloud where its light is looked up, radii towards the eye: one look at the centre would draw clouds too
/// dark, because the eye sees their near sides.
const LOOKUPS: [f32; 2] = [-LOOK, LOOK];

struct Texel {
    index: [i32; 2],
    part: [f32; 2],
}

fn texel_of(params: &Params, place: [i32; 2]) -> Texel {
    let index = place.map(|p| p.div_euclid(params.lighting.unit));
    let part = [0, 1].map(|axis| {
        (place[axis] - index[axis] * params.lighting.unit) as f32 / params.lighting.unit as f32
    });
    Texel { index, part }
}

fn address(params: &Params, texel: [i32; 2], slice: u32) -> Option<usize> {
    let [x, y] = texel;
    let inside =
        x >= 0 && y >= 0 && x < params.lighting.size.x as i32 && y < params.lighting.size.y as i32;
    let layer = slice as usize * params.lighting.size.y as usize;
    inside.then(|| (layer + y as usize) * params.lighting.size.x as usize + x as usize)
}

/// Adds every splat's depth to the four nearest texels of the two slices whose middles it lies between.
pub fn deposit(params: &Params, splats: &[Splat], light: &mut [u32]) {
    for splat in splats.iter().filter(|splat| splat.light_depth > 0.0) {
        let texel = texel_of(params, [splat.light_u, splat.light_v]);
        let middle = (splat.slice - 0.5).floor();
        let behind = splat.light_depth * (splat.slice - 0.5 - middle);
        give_slice(
            params,
            &texel,
            middle as i32,
            splat.light_depth - behind,
            light,
        );
        give_slice(params, &texel, middle as i32 + 1, behind, light);
    }
}

fn give_slice(params: &Params, texel: &Texel, slice: i32, depth: f32, light: &mut [u32]) {
    let at = slice.clamp(0, params.view.slices as i32 - 1) as u32;
    let Texel {
        index: [x, y],
        part,
    } = *texel;
    let one = params.lighting.depth_one;
    let east = depth * part[0];
    let west = depth - east;
    let shares = [
        ([x, y], west * (1.0 - part[1])),
        ([x + 1, y], east * (1.0 - part[1])),
        ([x, y + 1], west * part[1]),
        ([x + 1, y + 1], east * part[1]),
    ];
    for (texel, depth) in shares {
        if let Some(at) = address(params, texel, at) {
            light[at] = light[at].wrapping_add(((depth * one).min(MOST_GIVEN) + 0.5) as u32);
        }
    }
}

/// Turns the depth of each slice into twice the depth above its middle; one more layer holds twice the whole.
pub fn prefix(params: &Params, light: &mut [u32]) {
    let layer = params.lighting.size.x as usize * params.lighting.size.y as usize;
    let mut above = vec![0u32; layer];
    for slice in light
        .chunks_exact_mut(layer)
        .take(params.view.slices as usize + 1)
    {
        for (own, above) in slice.iter_mut().zip(&mut above) {
            let below = (*above + (*own).min(DARK)).min(DARK);
            *own = *above + below;
            *above = below;
        }
    }
}

fn depth_above(params: &Params, light: &[u32], texel: [i32; 2], middle: i32, part: f32) -> f32 {
    let depth_at = |slice: i32| {
        let at = u32::try_from(slice)
            .ok()
            .and_then(|slice| address(params, texel, slice));
        at.map_or(0.0, |at| light[at] as f32)
    };
    0.5 * mix(depth_at(middle), depth_at(middle + 1), part) / params.lighting.depth_one
}

fn dimmed(colour: u32, shade: f32) -> u32 {
    with_codes(colour, codes_of(colour) * shade.sqrt())
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Optical depth between a place and the sun.
fn depth_before(params: &Params, light: &[u32], place: [i32; 2], slice: f32) -> f32 {
    let Texel {
        index: [x, y],
        part: [east, south],
    } = texel_of(params, place);
    let middle = (slice - 0.5).floor();
    let part = slice - 0.5 - middle;
    let depth = |texel| depth_above(params, light, texel, middle as i32, part);
    let north_row = mix(depth([x, y]), depth([x + 1, y]), east);
    let south_row = mix(depth([x, y + 1]), depth([x + 1, y + 1]), east);
    mix(north_row, south_row, south)
}

/// Share of the direct light that what the eye sees of a splat gets.
fn lit(params: &Params, light: &[u32], splat: &Splat) -> f32 {
    let lighting = &params.lighting;
    let (u, v) = (splat.light_u as f32, splat.light_v as f32);
    let (mut sum, mut weights) = (0.0, 0.0);
    for t in LOOKUPS {
        let step = t * splat.radius_px;
        let place = [
            splat.light_u + nearest(step * (lighting.toward.x - lighting.toward_pull * u)),
            splat.light_v + nearest(step * (lighting.toward.y - lighting.toward_pull * v)),
        ];
        let toward = lighting.toward.z - lighting.toward_pull * splat.slice;
        let slice = (splat.slice + step * toward).clamp(0.0, params.view.slices as f32 - 0.001);
        // Where little light reaches, the eye sees little past what lies in front.
        let depth = depth_before(params, light, place, slice);
        let seen = (-lighting.look_power * depth).exp();
        sum += seen * (-depth).exp();
        weights += seen;
    }
    sum / weights.max(1e-30)
}

/// Dims every splat's colour by what lies between it and the sun.
pub fn shade(params: &Params, light: &[u32], splats: &mut [Splat]) {
    for splat in splats.iter_mut().filter(|splat| splat.tau > 0.0) {
        let direct = params.lighting.direct * lit(params, light, splat) * splat.day;
        let night = mix(params.lighting.night, 1.0, splat.day);
        let shade = (params.lighting.ambient + direct) * night;
        // Water in between has its own light.
        let own = (splat.colour >> 24) as f32 / 255.0;
        splat.colour = dimmed(splat.colour, mix(1.0, shade, own));
    }
}
