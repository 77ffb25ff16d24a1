// Places in the light buffer: one layer of texels for every slice and one for the whole.
struct LightParams {
    toward: vec3<f32>, toward_pull: f32, size: vec2<u32>, unit: i32, mode: u32, look_power: f32, ambient: f32, direct: f32,
    depth_one: f32, night: f32,
}
@group(0) @binding(23) var<uniform> lighting: LightParams;

struct Texel { index: vec2<i32>, part: vec2<f32> }

fn texel_of(place: vec2<i32>) -> Texel {
    // Rounded towards the west and north also below 0.
    let index = (place - (place % lighting.unit + lighting.unit) % lighting.unit) / lighting.unit;
    return Texel(index, vec2<f32>(place - index * lighting.unit) / f32(lighting.unit));
}

fn address(texel: vec2<i32>, slice: u32) -> u32 {
    return (slice * lighting.size.y + u32(texel.y)) * lighting.size.x + u32(texel.x);
}

fn inside(texel: vec2<i32>) -> bool {
    return all(texel >= vec2(0)) && all(texel < vec2<i32>(lighting.size));
}
