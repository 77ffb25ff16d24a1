// The light's side of half-angle slicing: splats give their optical depth to a slice-layered buffer, a sum along the
// slices turns it into the depth above each slice plane, and every splat is dimmed by what lies between it and the sun.
@group(0) @binding(1) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(2) var<storage, read_write> light: array<atomic<u32>>;

// Depth that one splat may give to one texel: sums of 2^15 splats stay below 2^31.
const MOST_GIVEN = 16.0;
const DARK = 0x7fffffffu;

struct Texel { index: vec2<i32>, part: vec2<f32> }

fn texel_of(splat: Splat) -> Texel {
    let place = vec2(splat.light_u, splat.light_v);
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

fn give(texel: vec2<i32>, slice: u32, depth: f32) {
    if (inside(texel)) { atomicAdd(&light[address(texel, slice)], u32(min(depth, MOST_GIVEN) * DEPTH_ONE + 0.5)); }
}

fn give_slice(texel: Texel, slice: i32, depth: f32) {
    let at = u32(clamp(slice, 0, i32(params.slices) - 1));
    let east = depth * texel.part.x;
    let west = depth - east;
    give(texel.index, at, west * (1.0 - texel.part.y));
    give(texel.index + vec2(1, 0), at, east * (1.0 - texel.part.y));
    give(texel.index + vec2(0, 1), at, west * texel.part.y);
    give(texel.index + vec2(1, 1), at, east * texel.part.y);
}

// Every splat gives to the two slices whose middles it lies between: given to its own slice alone, a thin sheet that
// runs through the slices at a slant would be striped.
@compute @workgroup_size(GROUP)
fn deposit(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let i = list_index(global, workgroups);
    if (i >= params.particle_count) { return; }
    let splat = splats[i];
    if (splat.tau <= 0.0) { return; }
    let texel = texel_of(splat);
    let middle = floor(splat.slice - 0.5);
    let behind = splat.light_depth * (splat.slice - 0.5 - middle);
    give_slice(texel, i32(middle), splat.light_depth - behind);
    give_slice(texel, i32(middle) + 1, behind);
}

@compute @workgroup_size(GROUP)
fn prefix(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let column = list_index(global, workgroups);
    let layer = params.light_width * params.light_height;
    if (column >= layer) { return; }
    var above = 0u;
    for (var slice = 0u; slice <= params.slices; slice++) {
        let at = slice * layer + column;
        let own = atomicLoad(&light[at]);
        atomicStore(&light[at], above);
        above = min(above + min(own, DARK), DARK);
    }
}

// Depth above a slice plane; nothing above the first, everything above the last.
fn depth_at(texel: vec2<i32>, plane: i32) -> f32 {
    return f32(atomicLoad(&light[address(texel, u32(clamp(plane, 0, i32(params.slices))))]));
}

// Depth above a place: the mean of half a slice before and half a slice behind it, each between two planes. Together
// with the deposit this gives a thin sheet half its own depth wherever it lies, so that slices leave no bands.
fn depth_above(texel: vec2<i32>, middle: i32, part: f32) -> f32 {
    if (!inside(texel)) { return 0.0; }
    let between = depth_at(texel, middle + 1);
    let outer = mix(depth_at(texel, middle) + between, between + depth_at(texel, middle + 2), part);
    return 0.5 * outer / DEPTH_ONE;
}

fn dimmed(color: u32, shade: f32) -> u32 {
    let rgb = min(vec3(f32(color & 255u), f32((color >> 8u) & 255u), f32((color >> 16u) & 255u)) * shade, vec3(255.0));
    return u32(nearest(rgb.x)) | (u32(nearest(rgb.y)) << 8u) | (u32(nearest(rgb.z)) << 16u) | (color & 0xff000000u);
}

@compute @workgroup_size(GROUP)
fn shade(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let i = list_index(global, workgroups);
    if (i >= params.particle_count) { return; }
    let splat = splats[i];
    if (splat.tau <= 0.0) { return; }
    let texel = texel_of(splat);
    let middle = i32(floor(splat.slice - 0.5));
    let part = splat.slice - 0.5 - f32(middle);
    let north = mix(depth_above(texel.index, middle, part), depth_above(texel.index + vec2(1, 0), middle, part), texel.part.x);
    let south = mix(depth_above(texel.index + vec2(0, 1), middle, part), depth_above(texel.index + vec2(1, 1), middle, part), texel.part.x);
    let transmittance = exp(-mix(north, south, texel.part.y));
    splats[i].color = dimmed(splat.color, params.ambient + params.direct * transmittance * splat.day);
}
