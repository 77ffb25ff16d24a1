// Places in the light buffer: one layer of texels for every slice and one for the whole.
struct Texel { index: vec2<i32>, part: vec2<f32> }

fn texel_of(place: vec2<i32>) -> Texel {
    // Rounded towards the west and north also below 0.
    let index = vec2(place.x - (place.x % params.light_unit + params.light_unit) % params.light_unit,
        place.y - (place.y % params.light_unit + params.light_unit) % params.light_unit) / params.light_unit;
    return Texel(index, vec2<f32>(place - index * params.light_unit) / f32(params.light_unit));
}

fn address(texel: vec2<i32>, slice: u32) -> u32 {
    return (slice * params.light_height + u32(texel.y)) * params.light_width + u32(texel.x);
}

fn inside(texel: vec2<i32>) -> bool {
    return all(texel >= vec2(0)) && texel.x < i32(params.light_width) && texel.y < i32(params.light_height);
}
