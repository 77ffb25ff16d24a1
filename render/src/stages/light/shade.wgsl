// What lies between a splat and the sun dims it. Reads `light`, twice the depth above the middle of each layer.

// Depth above a place between the middles of two layers. Together with the deposit this gives a thin sheet half its own
// depth wherever it lies, so that layers leave no bands.
fn depth_above(texel: vec2<i32>, middle: i32, part: f32) -> f32 {
    if (!inside(texel)) { return 0.0; }
    var before = 0.0;
    if (middle >= 0) { before = f32(light[address(texel, u32(middle))]); }
    return 0.5 * mix(before, f32(light[address(texel, u32(middle + 1))]), part) / lighting.depth_one;
}

fn dimmed(colour: u32, shade: f32) -> u32 {
    return with_codes(colour, codes_of(colour) * sqrt(shade));
}

// Optical depth between the sun and a place a step away from `at`: both in parts of a texel, and towards the sun. Map tiles,
// whose neighbours see the same clouds from other corners, step by whole parts.
fn depth_before(at: vec3<f32>, step: vec3<f32>) -> f32 {
    let there = at.xy + select(step.xy, floor(step.xy + 0.5), is_tile());
    let texel = texel_of(vec2<i32>(floor(there)));
    let across = texel.part + (there - floor(there)) / f32(lighting.unit);
    let layer = layer_at(at.z + step.z);
    let middle = i32(floor(layer - 0.5));
    let part = layer - 0.5 - f32(middle);
    let north = mix(depth_above(texel.index, middle, part), depth_above(texel.index + vec2(1, 0), middle, part), across.x);
    let south = mix(depth_above(texel.index + vec2(0, 1), middle, part), depth_above(texel.index + vec2(1, 1), middle, part), across.x);
    return mix(north, south, across.y);
}

// How far from a cloud's centre its light is looked up, radii: along the sight line and across it.
const LOOK: f32 = 0.34;
const ASIDE: f32 = 0.4;
const LEAST_SINE: f32 = 0.05;
const LEAST_COSINE_SQ: f32 = 0.01;
const MOST_POWER: f32 = 4.0;
const MOST_EXPONENT: f32 = 60.0;

// Share of the direct light that what the eye sees of a cloud gets, `aside` of its middle: looked up before and behind it,
// `toward` being a step of one radius towards the eye. One look would draw clouds too dark, because the eye sees their near sides.
fn lit_at(at: vec3<f32>, aside: vec3<f32>, toward: vec3<f32>, power: f32) -> f32 {
    let near = depth_before(at, aside + toward * LOOK);
    let far = depth_before(at, aside - toward * LOOK);
    // Where little light reaches, the eye sees little past what lies in front.
    let seen = 1.0 / (1.0 + exp(min(power * (near - far), MOST_EXPONENT)));
    return mix(exp(-far), exp(-near), seen);
}

// How a cloud on a globe stands to eye and sun: a step of a radius up in the picture times `sine`, that of the angle between
// sight line and vertical; and the power of the light by which what is seen of it counts.
struct Stand { up: vec3<f32>, sine: f32, power: f32 }

fn stand_of(place: vec3<f32>, toward: vec3<f32>) -> Stand {
    let out = place - lighting.earth;
    let vertical = out / length(out);
    let radius = length(toward);
    let eye = toward / radius;
    let cosine = dot(vertical, eye);
    let power = lighting.look_power * max(vertical.z, 0.0) * cosine / max(cosine * cosine, LEAST_COSINE_SQ);
    return Stand((vertical - eye * cosine) * radius, sqrt(max(1.0 - cosine * cosine, 0.0)), clamp(power, -MOST_POWER, MOST_POWER));
}

// Share of the direct light in the middle of a cloud, and by how much that is more a radius farther up.
fn sloping(at: vec3<f32>, radius_px: f32) -> vec2<f32> {
    let parts = vec3(lighting.part, lighting.part, 1.0);
    let place = at * parts;
    let toward = (lighting.toward - lighting.toward_pull * place) * radius_px;
    if (is_tile()) { return vec2(lit_at(at, vec3(0.0), toward, lighting.look_power), 0.0); }
    let stand = stand_of(place, toward);
    let aside = stand.up / parts * ASIDE;
    let above = lit_at(at, aside, toward / parts, stand.power);
    let below = lit_at(at, -aside, toward / parts, stand.power);
    return vec2(0.5 * (above + below), (above - below) / (2.0 * ASIDE * max(stand.sine, LEAST_SINE)));
}

// A splat's colour in its light; in the last byte how that changes up the picture.
fn shaded(colour: u32, at: vec2<i32>, slice: f32, day: f32, radius_px: f32) -> u32 {
    let lit = sloping(vec3(vec2<f32>(at), sunward_of(at.y, slice)), radius_px);
    // Water in between has its own light.
    let own = f32(colour >> 24u) / 255.0;
    let all = mix(lighting.night, 1.0, day);
    let shade = mix(1.0, (lighting.ambient + lighting.direct * lit.x * day) * all, own);
    let slope = own * lighting.direct * day * all * lit.y / shade;
    let steps = clamp(nearest(slope * SLOPE_ONE), -127, 127);
    return (dimmed(colour, shade) & 0xffffffu) | (u32(steps + 128) << 24u);
}
