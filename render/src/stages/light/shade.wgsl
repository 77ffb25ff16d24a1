// What lies between a splat and the sun dims it. Reads `light`, twice the depth above the middle of each slice.

// Depth above a place between the middles of two slices. Together with the deposit this gives a thin sheet half its own
// depth wherever it lies, so that slices leave no bands.
fn depth_above(texel: vec2<i32>, middle: i32, part: f32) -> f32 {
    if (!inside(texel)) { return 0.0; }
    var before = 0.0;
    if (middle >= 0) { before = f32(light[address(texel, u32(middle))]); }
    return 0.5 * mix(before, f32(light[address(texel, u32(middle + 1))]), part) / lighting.depth_one;
}

fn dimmed(colour: u32, shade: f32) -> u32 {
    return with_codes(colour, codes_of(colour) * sqrt(shade));
}

// Optical depth between a place and the sun.
fn depth_before(place: vec2<i32>, slice: f32) -> f32 {
    let texel = texel_of(place);
    let middle = i32(floor(slice - 0.5));
    let part = slice - 0.5 - f32(middle);
    let north = mix(depth_above(texel.index, middle, part), depth_above(texel.index + vec2(1, 0), middle, part), texel.part.x);
    let south = mix(depth_above(texel.index + vec2(0, 1), middle, part), depth_above(texel.index + vec2(1, 1), middle, part), texel.part.x);
    return mix(north, south, texel.part.y);
}

// How far from a cloud's centre its light is looked up, radii.
const LOOK: f32 = 0.34;

// Share of light at a place a step towards the eye times the share of what is seen there, and the latter.
fn look(place: vec2<i32>, slice: f32, step: f32) -> vec2<f32> {
    let toward = lighting.toward.xy - lighting.toward_pull * vec2<f32>(place);
    let there = place + vec2(nearest(step * toward.x), nearest(step * toward.y));
    let slice_there = slice + step * (lighting.toward.z - lighting.toward_pull * slice);
    // Where little light reaches, the eye sees little past what lies in front.
    let depth = depth_before(there, clamp(slice_there, 0.0, f32(view.slices) - 0.001));
    return exp(-lighting.look_power * depth) * vec2(exp(-depth), 1.0);
}

// A splat's colour in its light, looked up before and behind the centre: one look at the centre would draw clouds too
// dark, because the eye sees their near sides.
fn shaded(colour: u32, place: vec2<i32>, slice: f32, day: f32, radius_px: f32) -> u32 {
    let sum = look(place, slice, -LOOK * radius_px) + look(place, slice, LOOK * radius_px);
    let lit = sum.x / max(sum.y, 1.0e-30);
    let shade = (lighting.ambient + lighting.direct * lit * day) * mix(lighting.night, 1.0, day);
    // Water in between has its own light.
    return dimmed(colour, mix(1.0, shade, f32(colour >> 24u) / 255.0));
}
