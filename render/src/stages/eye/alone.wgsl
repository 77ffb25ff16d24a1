// The same picture without shared memory and without waiting: every invocation adds up its tile's entries by itself, for
// eight pixels of a column. For adapters that are programs: they run a workgroup's invocations in turn and switch between
// them at every wait, load as long as they add to several pixels, and compile what composes a pixel for each pixel anew: a
// kernel of its own, `finish`, does that.
@group(0) @binding(13) var<storage, read_write> picture: array<vec4<f32>>;

const STRIDE = 2u; // rows between an invocation's pixels
const COLUMN = 8u; // pixels of an invocation

// An entry as the pixels of one column see it.
struct Near { radius_px: f32, inverse_radius: f32, south: f32, east: f32, depth: f32, rgb: vec3<u32>, is_hidden: bool, brightness: f32, slope: f32 }

fn near_of(entry: Entry, column: f32, pixel_units: f32) -> Near {
    let radius_px = f32(i32(entry.size & RADIUS_BITS)) / pixel_units;
    let place = vec2(f32(i32(entry.place << 16u) >> 16u), f32(i32(entry.place) >> 16u)) / pixel_units;
    let inverse_radius = 1.0 / radius_px;
    let rgb = light_of(entry.colour);
    let east = (column - place.x) * inverse_radius;
    let slope = slope_of(entry, place);
    return Near(radius_px, inverse_radius, place.y, east, f32(i32(entry.size >> 16u)), rgb, is_behind(entry),
        1.0 + slope.x * east, slope.y);
}

// A number below 2^31 without its fraction: vectors of processors convert signed integers at once, unsigned ones in steps.
fn whole(x: f32) -> u32 {
    return u32(i32(x));
}

// What an entry gives to the pixel of a row, where so much of what lies beyond the sea surface is kept; nothing beyond its radius.
fn given(near: Near, row: f32, kept: f32) -> vec4<u32> {
    let south = (row - near.south) * near.inverse_radius;
    let share = near.depth * weight_at(near.east * near.east + south * south, near.radius_px) * select(1.0, kept, near.is_hidden);
    let amount = whole(share + 0.5);
    var bright = amount;
    if (KERNEL == KERNEL_CLOUD && !is_tile()) { bright = whole(min(share * (near.brightness + near.slope * south), MOST_BRIGHT) + 0.5); }
    var rgb = near.rgb;
    if (KERNEL == KERNEL_BALL) { rgb = vec3<u32>(vec3<f32>(rgb) * ball_light(vec2(near.east, south)) + 0.5); }
    if (KERNEL == KERNEL_RIMMED) { rgb = rimmed(rgb, near.east * near.east + south * south, near.radius_px); }
    return vec4(sixteenth(rgb * bright), amount);
}

fn more(sums: vec4<u32>, given: vec4<u32>) -> vec4<u32> {
    return sums + min(given, vec4(MOST_SUM) - sums);
}

// What a pixel keeps of something beyond the sea surface.
fn kept_at(pixel: vec2<u32>) -> f32 {
    if (!hides_beyond() || any(pixel >= view.size_px)) { return 1.0; }
    return kept_of(hidden_share(pixel));
}

fn show(pixel: vec2<u32>, colour: vec4<f32>) {
    if (all(pixel.xy < view.size_px)) { picture[pixel.y * view.size_px.x + pixel.x] = colour; }
}

@compute @workgroup_size(SCREEN_TILE_PX, STRIDE)
fn alone(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let first_list = (workgroup.y * view.tiles.x + workgroup.x) * view.slices;
    let center = vec2<f32>(local.xy) + 0.5;
    let pixel_units = f32(SUBPIXELS) / f32(1u << lists.entry_shift);
    let pixel = workgroup.xy * SCREEN_TILE_PX + local.xy;
    set_corner(workgroup.xy);
    var colours: array<vec4<f32>, COLUMN>;
    var kept: array<f32, COLUMN>;
    for (var i = 0u; i < COLUMN; i++) {
        colours[i] = vec4(0.0);
        kept[i] = kept_at(pixel + vec2(0u, i * STRIDE));
    }
    var begin = 0u;
    if (first_list > 0u) { begin = min(list_ends[first_list - 1u], lists.entry_capacity); }
    for (var slice = 0u; slice < view.slices; slice++) {
        let end = min(list_ends[first_list + slice], lists.entry_capacity);
        if (end > begin) {
            var sums: array<vec4<u32>, COLUMN>;
            for (var i = 0u; i < COLUMN; i++) { sums[i] = vec4(0u); }
            for (var base = begin; base < end; base += SAFE) {
                var own: array<vec4<u32>, COLUMN>;
                for (var i = 0u; i < COLUMN; i++) { own[i] = vec4(0u); }
                for (var at = base; at < min(base + SAFE, end); at++) {
                    let near = near_of(entries[at], center.x, pixel_units);
                    for (var i = 0u; i < COLUMN; i++) {
                        own[i] += given(near, center.y + f32(i * STRIDE), kept[i]);
                    }
                }
                for (var i = 0u; i < COLUMN; i++) { sums[i] = more(sums[i], own[i]); }
            }
            for (var i = 0u; i < COLUMN; i++) { colours[i] = blended(colours[i], sums[i]); }
        }
        begin = end;
    }
    for (var i = 0u; i < COLUMN; i++) { show(pixel + vec2(0u, i * STRIDE), colours[i]); }
}

// What was seen as bytes.
@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn finish(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if (any(pixel.xy >= view.size_px)) { return; }
    let at = pixel.y * view.size_px.x + pixel.x;
    image[at] = composed(pixel.xy, picture[at]);
}
