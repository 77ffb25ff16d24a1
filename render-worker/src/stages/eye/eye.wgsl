// The eye's side of half-angle slicing: one workgroup a screen tile. Inside a slice the entries of its list add optical
// depth and colour to the pixels that they reach, as integers and so in any order; slices are blended in order, towards
// or away from the eye. Entries are spread over the invocations while they are added, pixels while they are blended.
@group(0) @binding(1) var<storage, read> list_ends: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read_write> picture: array<vec4<f32>>;

const PIXELS = 256u; // SCREEN_TILE_PX squared
// Entries added between two looks at the sums, two invocations each: their sums, below 2^24 each, and what was clamped to
// MOST_SUM before stay below 2^32.
const BATCH = 128u;
const MOST_SUM = 0x7fffffffu;

// Red, green, blue and depth of every pixel.
var<workgroup> sums: array<atomic<u32>, 1024>;

// Share of a splat's depth at a squared distance of `q` squared radii from its centre.
fn weight_at(q: f32, radius_px: f32) -> f32 {
    if (params.kernel == KERNEL_CLOUD) {
        let inside = max(1.0 - q, 0.0);
        return inside * inside;
    }
    return clamp((1.0 - sqrt(q)) * radius_px, 0.0, 1.0);
}

// Light on a ball seen from the front, lit from the upper left.
fn ball_light(offset: vec2<f32>) -> f32 {
    let toward = sqrt(max(1.0 - dot(offset, offset), 0.0));
    return 0.55 + 0.45 * clamp(-0.45 * offset.x - 0.55 * offset.y + 0.70 * toward, 0.0, 1.0);
}

// Adds an entry to every second row of pixels.
fn add(entry: Entry, half: i32) {
    let pixel_units = f32(SUBPIXELS) / f32(1u << params.entry_shift);
    let radius = f32(entry.size & 0xffffu);
    let depth = f32(entry.size >> 16u);
    let rgb = vec3(entry.color & 255u, (entry.color >> 8u) & 255u, (entry.color >> 16u) & 255u);
    let place = vec2(f32(i32(entry.place << 16u) >> 16u), f32(i32(entry.place) >> 16u));
    // Pixels with their centre within the radius.
    let low = max(vec2<i32>(ceil((place - radius) / pixel_units - 0.5)), vec2(0));
    let high = min(vec2<i32>(floor((place + radius) / pixel_units - 0.5)), vec2(i32(SCREEN_TILE_PX) - 1));
    let inverse_radius = 1.0 / radius;
    let radius_px = radius / pixel_units;
    for (var y = low.y + ((low.y ^ half) & 1); y <= high.y; y += 2) {
        for (var x = low.x; x <= high.x; x++) {
            let offset = ((vec2(f32(x), f32(y)) + 0.5) * pixel_units - place) * inverse_radius;
            let amount = u32(depth * weight_at(dot(offset, offset), radius_px) + 0.5);
            if (amount == 0u) { continue; }
            var own = rgb;
            if (params.kernel == KERNEL_BALL) { own = vec3<u32>(vec3<f32>(rgb) * ball_light(offset) + 0.5); }
            let pixel = u32(y) * SCREEN_TILE_PX + u32(x);
            atomicAdd(&sums[pixel], own.x * amount);
            atomicAdd(&sums[PIXELS + pixel], own.y * amount);
            atomicAdd(&sums[2u * PIXELS + pixel], own.z * amount);
            atomicAdd(&sums[3u * PIXELS + pixel], amount);
        }
    }
}

// What was added to a pixel since it was last looked at.
fn taken(channel: u32, pixel: u32) -> u32 {
    let sum = atomicLoad(&sums[channel * PIXELS + pixel]);
    if (sum > 0u) { atomicStore(&sums[channel * PIXELS + pixel], 0u); }
    return sum;
}

// Colour with alpha, premultiplied, once the slice with these sums is blended into it.
fn blended(picture: vec4<f32>, sums: vec4<u32>) -> vec4<f32> {
    if (sums.w == 0u) { return picture; }
    let alpha = 1.0 - exp(-f32(sums.w) / DEPTH_ONE);
    let slice = vec4(vec3<f32>(sums.xyz) / (f32(sums.w) * 255.0), 1.0) * alpha;
    if (params.front_to_back == 1u) { return picture + slice * (1.0 - picture.w); }
    return picture * (1.0 - alpha) + slice;
}

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn eye(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(global_invocation_id) pixel: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    for (var channel = 0u; channel < 4u; channel++) { atomicStore(&sums[channel * PIXELS + invocation], 0u); }
    workgroupBarrier();
    let first_list = (workgroup.y * params.tiles_x + workgroup.x) * params.slices;
    var begin = 0u;
    if (first_list > 0u) { begin = min(list_ends[first_list - 1u], params.entry_capacity); }
    var color = vec4(0.0);
    for (var slice = 0u; slice < params.slices; slice++) {
        let end = min(list_ends[first_list + slice], params.entry_capacity);
        if (end <= begin) { continue; }
        var own = vec4(0u);
        for (; begin < end; begin += BATCH) {
            let at = begin + (invocation >> 1u);
            if (at < end) { add(entries[at], i32(invocation & 1u)); }
            workgroupBarrier();
            let more = vec4(taken(0u, invocation), taken(1u, invocation), taken(2u, invocation), taken(3u, invocation));
            own = min(own + more, vec4(MOST_SUM));
            workgroupBarrier();
        }
        begin = end;
        color = blended(color, own);
    }
    if (pixel.x < params.width && pixel.y < params.height) { picture[pixel.y * params.width + pixel.x] = color; }
}
