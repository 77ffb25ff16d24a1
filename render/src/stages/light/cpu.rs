//! CPU twin of `deposit.wgsl`, `light.wgsl` and `shade.wgsl`.

use glam::{Vec2, Vec3};

use crate::stages::colour::{codes_of, with_codes};
use crate::stages::layout::{
    ASIDE, LEAST_COSINE_SQ, LEAST_SINE, LOOK, MOST_EXPONENT, MOST_POWER, SLOPE_ONE, Splat,
    VIEW_TILE, nearest,
};
use crate::stages::params::Params;

const MOST_GIVEN: f32 = (1 << 25) as f32;
const DARK: u32 = 0x7fff_ffff;

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

/// How far towards the sun a splat is: see [`LightParams`](super::params::LightParams).
fn sunward_of(params: &Params, splat: &Splat) -> f32 {
    let lighting = &params.lighting;
    lighting.sunward
        + lighting.sunward_per_part * splat.light_v as f32
        + lighting.sunward_per_slice * splat.slice
}

fn layer_at(params: &Params, sunward: f32) -> f32 {
    let lighting = &params.lighting;
    let layer = lighting.first_layer + lighting.deeper * sunward;
    layer.clamp(0.0, lighting.layers as f32 - 0.001)
}

/// Adds every splat's depth to the four nearest texels of the two layers whose middles it lies between.
pub fn deposit(params: &Params, splats: &[Splat], light: &mut [u32]) {
    for splat in splats.iter().filter(|splat| splat.light_depth > 0.0) {
        let texel = texel_of(params, [splat.light_u, splat.light_v]);
        let layer = layer_at(params, sunward_of(params, splat));
        let middle = (layer - 0.5).floor();
        let behind = splat.light_depth * (layer - 0.5 - middle);
        give_layer(
            params,
            &texel,
            middle as i32,
            splat.light_depth - behind,
            light,
        );
        give_layer(params, &texel, middle as i32 + 1, behind, light);
    }
}

fn give_layer(params: &Params, texel: &Texel, layer: i32, depth: f32, light: &mut [u32]) {
    let at = layer.clamp(0, params.lighting.layers as i32 - 1) as u32;
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
        .take(params.lighting.layers as usize + 1)
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

/// Optical depth between the sun and a place a step away from `at`: both in parts of a texel, and towards the sun. Map tiles,
/// whose neighbours see the same clouds from other corners, step by whole parts.
fn depth_before(params: &Params, light: &[u32], at: Vec3, step: Vec3) -> f32 {
    let mut across = step.truncate();
    if params.view.kind == VIEW_TILE {
        across = (across + 0.5).floor();
    }
    let there = at.truncate() + across;
    let Texel {
        index: [x, y],
        part,
    } = texel_of(params, there.floor().as_ivec2().to_array());
    let [east, south] =
        (Vec2::from(part) + (there - there.floor()) / params.lighting.unit as f32).to_array();
    let layer = layer_at(params, at.z + step.z);
    let middle = (layer - 0.5).floor();
    let part = layer - 0.5 - middle;
    let depth = |texel| depth_above(params, light, texel, middle as i32, part);
    let north_row = mix(depth([x, y]), depth([x + 1, y]), east);
    let south_row = mix(depth([x, y + 1]), depth([x + 1, y + 1]), east);
    mix(north_row, south_row, south)
}

/// The light round a cloud: where it is, a step of one radius towards the eye, and by what power of the light what is seen
/// counts.
struct Looks<'a> {
    params: &'a Params,
    light: &'a [u32],
    at: Vec3,
    toward: Vec3,
    power: f32,
}

impl Looks<'_> {
    /// Share of the direct light that what the eye sees of the cloud gets, `aside` of its middle: looked up before and behind
    /// it. One look would draw clouds too dark, because the eye sees their near sides.
    fn lit(&self, aside: Vec3) -> f32 {
        let [near, far] = [LOOK, -LOOK].map(|look| {
            let step = aside + self.toward * look;
            depth_before(self.params, self.light, self.at, step)
        });
        // Where little light reaches, the eye sees little past what lies in front.
        let seen = 1.0 / (1.0 + (self.power * (near - far)).min(MOST_EXPONENT).exp());
        mix((-far).exp(), (-near).exp(), seen)
    }
}

/// How a cloud on a globe stands to eye and sun.
struct Stand {
    /// A step of a radius up in the picture, times `sine`.
    up: Vec3,
    /// Of the angle between sight line and vertical.
    sine: f32,
    /// Power of the light by which what is seen of it counts.
    power: f32,
}

fn stand(params: &Params, place: Vec3, toward: Vec3) -> Stand {
    let out = place - params.lighting.earth;
    let vertical = out / out.length();
    let radius = toward.length();
    let eye = toward / radius;
    let cosine = vertical.dot(eye);
    let high = vertical.z.max(0.0);
    let power = params.lighting.look_power * high * cosine / (cosine * cosine).max(LEAST_COSINE_SQ);
    Stand {
        up: (vertical - eye * cosine) * radius,
        sine: (1.0 - cosine * cosine).max(0.0).sqrt(),
        power: power.clamp(-MOST_POWER, MOST_POWER),
    }
}

/// Share of the direct light in the middle of a splat, and by how much that is more a radius farther up.
fn sloping(params: &Params, light: &[u32], splat: &Splat) -> [f32; 2] {
    let lighting = &params.lighting;
    let (u, v) = (splat.light_u as f32, splat.light_v as f32);
    let at = Vec3::new(u, v, sunward_of(params, splat));
    let parts = Vec3::new(lighting.part, lighting.part, 1.0);
    let place = at * parts;
    let toward = (lighting.toward - lighting.toward_pull * place) * splat.radius_px;
    let looks = Looks {
        params,
        light,
        at,
        toward: toward / parts,
        power: lighting.look_power,
    };
    if params.view.kind == VIEW_TILE {
        return [looks.lit(Vec3::ZERO), 0.0];
    }
    let Stand { up, sine, power } = stand(params, place, toward);
    let looks = Looks { power, ..looks };
    let aside = up / parts * ASIDE;
    let (above, below) = (looks.lit(aside), looks.lit(-aside));
    [
        0.5 * (above + below),
        (above - below) / (2.0 * ASIDE * sine.max(LEAST_SINE)),
    ]
}

/// Dims every splat's colour by what lies between it and the sun.
pub fn shade(params: &Params, light: &[u32], splats: &mut [Splat]) {
    for splat in splats.iter_mut().filter(|splat| splat.tau > 0.0) {
        let [even, rise] = sloping(params, light, splat);
        let night = mix(params.lighting.night, 1.0, splat.day);
        let direct = params.lighting.direct;
        // Water in between has its own light.
        let own = (splat.colour >> 24) as f32 / 255.0;
        let all = (params.lighting.ambient + direct * even * splat.day) * night;
        let shade = mix(1.0, all, own);
        splat.colour = dimmed(splat.colour, shade);
        let rise = own * direct * splat.day * night * rise;
        splat.slope = nearest(rise / shade * SLOPE_ONE).clamp(-127, 127);
    }
}
