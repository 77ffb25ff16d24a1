// A splat gives its optical depth to the light buffer, through `add_light`.

// What one splat may give to one texel at most, and it is dark there.
const MOST_GIVEN = 33554432.0; // 2^25

fn give(texel: vec2<i32>, layer: u32, depth: f32) {
    let amount = u32(min(depth * lighting.depth_one, MOST_GIVEN) + 0.5);
    if (amount > 0u && inside(texel)) { add_light(address(texel, layer), amount); }
}

fn give_layer(texel: Texel, layer: i32, depth: f32) {
    let at = u32(clamp(layer, 0, i32(lighting.layers) - 1));
    let east = depth * texel.part.x;
    let west = depth - east;
    give(texel.index, at, west * (1.0 - texel.part.y));
    give(texel.index + vec2(1, 0), at, east * (1.0 - texel.part.y));
    give(texel.index + vec2(0, 1), at, west * texel.part.y);
    give(texel.index + vec2(1, 1), at, east * texel.part.y);
}

// Every splat gives to the two layers whose middles it lies between: given to its own layer alone, a thin sheet that
// runs through the layers at a slant would be striped.
fn deposit(splat: Splat) {
    let texel = texel_of(vec2(splat.light_u, splat.light_v));
    let layer = layer_at(sunward_of(splat.light_v, splat.slice));
    let middle = floor(layer - 0.5);
    let behind = splat.light_depth * (layer - 0.5 - middle);
    give_layer(texel, i32(middle), splat.light_depth - behind);
    give_layer(texel, i32(middle) + 1, behind);
}
