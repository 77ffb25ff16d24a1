// Classic half-angle slicing by rasterising quads: what the compute renderer is held against. The prelude goes before.
override LIGHT_RADIUS_TEXELS: f32;
override LIGHT_GAIN: f32;

@group(0) @binding(1) var<storage, read> seen: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read> lit: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var light: texture_2d<f32>;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) offset: vec2<f32>,
    @location(1) @interpolate(flat) colour: vec4<f32>,
}

// Quads of an instance: those of a slice are drawn as so many instances as hold them, of corners that an index buffer
// names, so that a group of invocations shades corners of many quads and each corner once.
override QUADS: u32;

fn corner_of(vertex: u32) -> vec2<f32> {
    return vec2(f32(vertex & 1u), f32((vertex >> 1u) & 1u)) * 2.0 - 1.0;
}

// The place in the order of a corner's quad: the first vertex of a draw is four times the first place of its slice.
fn quad_of(vertex: u32, instance: u32) -> u32 {
    return (vertex >> 2u) + instance * QUADS;
}

// A corner of a place that nobody takes: all four at one point.
fn nowhere() -> Corner {
    var corner: Corner;
    corner.position = vec4(2.0, 2.0, 0.0, 1.0);
    return corner;
}

fn clip(px: vec2<f32>, size: vec2<f32>) -> vec4<f32> {
    return vec4(px.x / size.x * 2.0 - 1.0, 1.0 - px.y / size.y * 2.0, 0.0, 1.0);
}

@vertex
fn eye_corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Corner {
    let place = order[quad_of(vertex, instance)];
    if (place == 0u) { return nowhere(); }
    let at = place - 1u;
    let near = seen[at];
    let far = lit[at];
    let radius = f32((near.z & RADIUS_BITS) << lists.entry_shift) / f32(SUBPIXELS);
    let center = vec2(f32(bitcast<i32>(near.x)), f32(bitcast<i32>(near.y))) / f32(SUBPIXELS);
    var shade = 1.0;
    if (lighting.mode == 1u) {
        let texel = vec2(bitcast<i32>(far.x), bitcast<i32>(far.y)) / lighting.unit;
        let depth = textureLoad(light, clamp(texel, vec2(0), vec2<i32>(lighting.size) - 1), 0).x;
        shade = lighting.ambient + lighting.direct * exp(-depth) * bitcast<f32>(far.w);
    }
    let codes = codes_of(near.w) / 255.0;
    let rgb = codes * codes;
    var corner: Corner;
    corner.offset = corner_of(vertex);
    corner.position = clip(center + corner.offset * radius, vec2<f32>(view.size_px));
    corner.colour = vec4(min(rgb * shade, vec3(1.0)), f32(near.z >> 16u) / lists.depth_one);
    return corner;
}

fn weight(offset: vec2<f32>) -> f32 {
    let inside = max(1.0 - dot(offset, offset), 0.0);
    return inside * inside;
}

@fragment
fn eye_pixel(corner: Corner) -> @location(0) vec4<f32> {
    let alpha = 1.0 - exp(-corner.colour.w * weight(corner.offset));
    return vec4(corner.colour.xyz * alpha, alpha);
}

@vertex
fn light_corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Corner {
    let place = order[quad_of(vertex, instance)];
    if (place == 0u) { return nowhere(); }
    let at = place - 1u;
    let near = seen[at];
    let far = lit[at];
    let center = vec2(f32(bitcast<i32>(far.x)), f32(bitcast<i32>(far.y))) / f32(lighting.unit);
    var corner: Corner;
    corner.offset = corner_of(vertex);
    // As wide as a particle is in light texels; the same depth over the same area as the compute renderer gives.
    let radius = LIGHT_RADIUS_TEXELS;
    corner.position = clip(center + corner.offset * radius, vec2<f32>(lighting.size));
    let radius_px = f32((near.z & RADIUS_BITS) << lists.entry_shift) / f32(SUBPIXELS);
    let mass = f32(near.z >> 16u) / lists.depth_one * radius_px * radius_px * LIGHT_GAIN;
    corner.colour = vec4(mass * 3.0 / (3.14159265 * radius * radius));
    return corner;
}

@fragment
fn light_pixel(corner: Corner) -> @location(0) vec4<f32> {
    return vec4(corner.colour.x * weight(corner.offset));
}

// Sorting by slice, once a frame: count, prefix, scatter. In the order splats count from 1; 0 is nobody.
@group(0) @binding(4) var<storage, read_write> slice_counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> draws: array<u32>;
@group(0) @binding(6) var<storage, read_write> order_out: array<u32>;

fn slice_at(at: u32) -> u32 {
    return u32(bitcast<f32>(lit[at].z));
}

const MOST_SLICES = 256u;
var<workgroup> own: array<atomic<u32>, MOST_SLICES>;

fn clear_own(invocation: u32) {
    for (var slice = invocation; slice < MOST_SLICES; slice += GROUP) { atomicStore(&own[slice], 0u); }
    workgroupBarrier();
}

@compute @workgroup_size(GROUP)
fn count_slices(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    clear_own(invocation);
    let at = list_index(global, workgroups);
    if (at < cells.splat_count) {
        if (seen[at].z != 0u) { atomicAdd(&own[slice_at(at)], 1u); }
    }
    workgroupBarrier();
    for (var slice = invocation; slice < MOST_SLICES; slice += GROUP) {
        let count = atomicLoad(&own[slice]);
        if (count > 0u) { atomicAdd(&slice_counts[slice], count); }
    }
}

// One indexed draw for every slice; slices begin at whole instances.
@compute @workgroup_size(1)
fn start_slices() {
    var first = 0u;
    for (var slice = 0u; slice < view.slices; slice++) {
        let instances = (atomicLoad(&slice_counts[slice]) + QUADS - 1u) / QUADS;
        draws[5u * slice] = 6u * QUADS;
        draws[5u * slice + 1u] = instances;
        draws[5u * slice + 2u] = 0u;
        draws[5u * slice + 3u] = 4u * first;
        draws[5u * slice + 4u] = 0u;
        atomicStore(&slice_counts[slice], first);
        first += instances * QUADS;
    }
}

@compute @workgroup_size(GROUP)
fn order_slices(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    clear_own(invocation);
    let at = list_index(global, workgroups);
    var is_drawn = false;
    if (at < cells.splat_count) { is_drawn = seen[at].z != 0u; }
    if (is_drawn) { atomicAdd(&own[slice_at(at)], 1u); }
    workgroupBarrier();
    for (var slice = invocation; slice < MOST_SLICES; slice += GROUP) {
        let count = atomicLoad(&own[slice]);
        if (count > 0u) { atomicStore(&own[slice], atomicAdd(&slice_counts[slice], count)); }
    }
    workgroupBarrier();
    if (is_drawn) { order_out[atomicAdd(&own[slice_at(at)], 1u)] = at + 1u; }
}
