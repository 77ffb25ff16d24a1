// The eye's side of half-angle slicing: one workgroup a screen tile, two pixels an invocation. Inside a slice optical
// depth and colour are summed as integers, in any order; slices are blended in order, towards or away from the eye.
@group(0) @binding(1) var<storage, read> list_ends: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read_write> picture: array<vec4<f32>>;

const BATCH = 32u; // SCREEN_TILE_PX * HALF_TILE_PX
const HALF_TILE_PX = 4u;
const MOST_SUM = vec4<u32>(0x7fffffffu);

var<workgroup> batch: array<Entry, BATCH>;

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

struct Round { inverse_radius: f32, radius_px: f32, depth: f32, rgb: vec3<u32> }

fn contribution(own: Round, offset: vec2<f32>) -> vec4<u32> {
    let q = dot(offset, offset);
    let amount = u32(own.depth * weight_at(q, own.radius_px) + 0.5);
    if (params.kernel == KERNEL_BALL) {
        return vec4(vec3<u32>(vec3<f32>(own.rgb) * ball_light(offset) + 0.5) * amount, amount);
    }
    return vec4(own.rgb * amount, amount);
}

// Colour with alpha, premultiplied, once the slice with these sums is blended into it.
fn blended(picture: vec4<f32>, sums: vec4<u32>) -> vec4<f32> {
    if (sums.w == 0u) { return picture; }
    let alpha = 1.0 - exp(-f32(sums.w) / DEPTH_ONE);
    let slice = vec4(vec3<f32>(sums.xyz) / (f32(sums.w) * 255.0), 1.0) * alpha;
    if (params.front_to_back == 1u) { return picture + slice * (1.0 - picture.w); }
    return picture * (1.0 - alpha) + slice;
}

fn put(pixel: vec2<u32>, color: vec4<f32>) {
    if (pixel.x < params.width && pixel.y < params.height) { picture[pixel.y * params.width + pixel.x] = color; }
}

@compute @workgroup_size(SCREEN_TILE_PX, HALF_TILE_PX)
fn eye(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let first_list = (workgroup.y * params.tiles_x + workgroup.x) * params.slices;
    var first = 0u;
    if (first_list > 0u) { first = min(list_ends[first_list - 1u], params.entry_capacity); }
    let end = min(list_ends[first_list + params.slices - 1u], params.entry_capacity);
    // Centre of the upper pixel in the unit of entries.
    let unit = 1.0 / f32(1u << params.entry_shift);
    let center = (vec2<f32>(local.xy) + 0.5) * f32(SUBPIXELS) * unit;
    let step = f32(HALF_TILE_PX) * f32(SUBPIXELS) * unit;
    var upper = vec4(0.0);
    var lower = vec4(0.0);
    var upper_sums = vec4(0u);
    var lower_sums = vec4(0u);
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
                upper = blended(upper, upper_sums);
                lower = blended(lower, lower_sums);
                upper_sums = vec4(0u);
                lower_sums = vec4(0u);
            }
            let radius = f32(entry.size & 0xffffu);
            let rgb = vec3(entry.color & 255u, (entry.color >> 8u) & 255u, (entry.color >> 16u) & 255u);
            let own = Round(1.0 / radius, radius / (unit * f32(SUBPIXELS)), f32(entry.size >> 16u), rgb);
            let place = vec2(f32(i32(entry.place << 16u) >> 16u), f32(i32(entry.place) >> 16u));
            let offset = (center - place) * own.inverse_radius;
            upper_sums = min(upper_sums + contribution(own, offset), MOST_SUM);
            let below = vec2(offset.x, offset.y + step * own.inverse_radius);
            lower_sums = min(lower_sums + contribution(own, below), MOST_SUM);
        }
    }
    let pixel = workgroup.xy * SCREEN_TILE_PX + local.xy;
    put(pixel, blended(upper, upper_sums));
    put(pixel + vec2(0u, HALF_TILE_PX), blended(lower, lower_sums));
}
