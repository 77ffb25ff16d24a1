// The eye's side of half-angle slicing: one workgroup a screen tile, one invocation a pixel. Inside a slice optical
// depth and colour are summed as integers, in any order; slices are blended in order, towards or away from the eye.
@group(0) @binding(1) var<storage, read> list_ends: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read_write> picture: array<vec4<f32>>;

const BATCH = 64u; // SCREEN_TILE_PX * SCREEN_TILE_PX
const MOST_SUM = vec4<u32>(0x7fffffffu);
// Depth of one splat at one pixel: a colour sum grows by less than 2^24 at once and cannot wrap.
const MOST_DEPTH = 15.0;

var<workgroup> batch: array<Entry, BATCH>;

// Share of a splat's depth at `offset` radii from its centre.
fn weight_at(offset: vec2<f32>, radius_px: f32) -> f32 {
    let q = dot(offset, offset);
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

fn contribution(entry: Entry, pixel_sub: vec2<i32>) -> vec4<u32> {
    let offset = vec2<f32>(pixel_sub - vec2(entry.x_sub, entry.y_sub)) * (entry.inverse_radius_px / f32(SUBPIXELS));
    if (dot(offset, offset) >= 1.0) { return vec4(0u); }
    let depth = min(entry.tau * weight_at(offset, 1.0 / entry.inverse_radius_px), MOST_DEPTH);
    let amount = u32(depth * DEPTH_ONE + 0.5);
    var rgb = vec3(entry.color & 255u, (entry.color >> 8u) & 255u, (entry.color >> 16u) & 255u);
    if (params.kernel == KERNEL_BALL) { rgb = vec3<u32>(vec3<f32>(rgb) * ball_light(offset) + 0.5); }
    return vec4(rgb * amount, amount);
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
    let first_list = (workgroup.y * params.tiles_x + workgroup.x) * params.slices;
    var first = 0u;
    if (first_list > 0u) { first = min(list_ends[first_list - 1u], params.entry_capacity); }
    let end = min(list_ends[first_list + params.slices - 1u], params.entry_capacity);
    let pixel_sub = vec2<i32>(pixel.xy) * SUBPIXELS + SUBPIXELS / 2;
    var color = vec4(0.0);
    var sums = vec4(0u);
    var slice = 0u;
    for (var base = first; base < end; base += BATCH) {
        workgroupBarrier();
        if (base + invocation < end) { batch[invocation] = entries[base + invocation]; }
        workgroupBarrier();
        let length = min(BATCH, end - base);
        for (var j = 0u; j < length; j++) {
            let entry = batch[j];
            if (entry.color >> 24u != slice) {
                slice = entry.color >> 24u;
                color = blended(color, sums);
                sums = vec4(0u);
            }
            sums = min(sums + contribution(entry, pixel_sub), MOST_SUM);
        }
    }
    color = blended(color, sums);
    if (pixel.x < params.width && pixel.y < params.height) { picture[pixel.y * params.width + pixel.x] = color; }
}
