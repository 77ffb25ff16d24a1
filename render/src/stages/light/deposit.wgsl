// A splat gives its optical depth to the light buffer, through `add_light`.

// Depth that one splat may give to one texel: sums of 2^15 splats stay below 2^31.
const MOST_GIVEN = 16.0;

fn give(texel: vec2<i32>, slice: u32, depth: f32) {
    let amount = u32(min(depth, MOST_GIVEN) * DEPTH_ONE + 0.5);
    if (amount > 0u && inside(texel)) { add_light(address(texel, slice), amount); }
}

fn give_slice(texel: Texel, slice: i32, depth: f32) {
    let at = u32(clamp(slice, 0, i32(view.slices) - 1));
    let east = depth * texel.part.x;
    let west = depth - east;
    give(texel.index, at, west * (1.0 - texel.part.y));
    give(texel.index + vec2(1, 0), at, east * (1.0 - texel.part.y));
    give(texel.index + vec2(0, 1), at, west * texel.part.y);
    give(texel.index + vec2(1, 1), at, east * texel.part.y);
}

// Every splat gives to the two slices whose middles it lies between: given to its own slice alone, a thin sheet that
// runs through the slices at a slant would be striped.
fn deposit(splat: Splat) {
    let texel = texel_of(vec2(splat.light_u, splat.light_v));
    let middle = floor(splat.slice - 0.5);
    let behind = splat.light_depth * (splat.slice - 0.5 - middle);
    give_slice(texel, i32(middle), splat.light_depth - behind);
    give_slice(texel, i32(middle) + 1, behind);
}
