// Places in the light buffer: layers of texels from the sun on and one for the whole.
struct LightParams {
    toward: vec3<f32>, toward_pull: f32, size: vec2<u32>, unit: i32, mode: u32, earth: vec3<f32>, part: f32,
    deeper: f32, first_layer: f32, sunward: f32, sunward_per_part: f32, sunward_per_slice: f32, layers: u32,
    look_power: f32, ambient: f32, direct: f32, depth_one: f32, night: f32,
}
@group(0) @binding(23) var<uniform> lighting: LightParams;

struct Texel { index: vec2<i32>, part: vec2<f32> }

fn texel_of(place: vec2<i32>) -> Texel {
    // Rounded towards the west and north also below 0.
    let index = (place - (place % lighting.unit + lighting.unit) % lighting.unit) / lighting.unit;
    return Texel(index, vec2<f32>(place - index * lighting.unit) / f32(lighting.unit));
}

// How far towards the sun a splat is.
fn sunward_of(v: i32, slice: f32) -> f32 {
    return lighting.sunward + lighting.sunward_per_part * f32(v) + lighting.sunward_per_slice * slice;
}

fn layer_at(sunward: f32) -> f32 {
    return clamp(lighting.first_layer + lighting.deeper * sunward, 0.0, f32(lighting.layers) - 0.001);
}

fn address(texel: vec2<i32>, layer: u32) -> u32 {
    return (layer * lighting.size.y + u32(texel.y)) * lighting.size.x + u32(texel.x);
}

fn inside(texel: vec2<i32>) -> bool {
    return all(texel >= vec2(0)) && all(texel < vec2<i32>(lighting.size));
}
