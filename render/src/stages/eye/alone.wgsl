// The same picture without shared memory and without waiting: every invocation adds up its tile's entries by itself, for
// four pixels of a column. For adapters that are programs: they run a workgroup's invocations in turn and switch between
// them at every wait.
const STRIDE = 4u; // rows between an invocation's pixels

// An entry as the pixels of one column see it.
struct Near { radius_px: f32, inverse_radius: f32, south: f32, east: f32, depth: f32, rgb: vec3<u32>, is_hidden: bool }

fn near_of(entry: Entry, column: f32) -> Near {
    let pixel_units = f32(SUBPIXELS) / f32(1u << lists.entry_shift);
    let radius_px = f32(entry.size & RADIUS_BITS) / pixel_units;
    let place = vec2(f32(i32(entry.place << 16u) >> 16u), f32(i32(entry.place) >> 16u)) / pixel_units;
    let inverse_radius = 1.0 / radius_px;
    let rgb = light_of(entry.color);
    return Near(radius_px, inverse_radius, place.y, (column - place.x) * inverse_radius, f32(entry.size >> 16u), rgb,
        is_behind(entry));
}

// What an entry gives to the pixel of a row, where so much of what lies beyond the sea surface is kept; nothing beyond its radius.
fn given(near: Near, row: f32, kept: f32) -> vec4<u32> {
    let south = (row - near.south) * near.inverse_radius;
    let amount = u32(near.depth * weight_at(near.east * near.east + south * south, near.radius_px)
        * select(1.0, kept, near.is_hidden) + 0.5);
    var rgb = near.rgb;
    if (KERNEL == KERNEL_BALL) { rgb = vec3<u32>(vec3<f32>(rgb) * ball_light(vec2(near.east, south)) + 0.5); }
    if (KERNEL == KERNEL_RIMMED) { rgb = rimmed(rgb, near.east * near.east + south * south, near.radius_px); }
    return vec4(sixteenth(rgb * amount), amount);
}

fn more(sums: vec4<u32>, given: vec4<u32>) -> vec4<u32> {
    return sums + min(given, vec4(MOST_SUM) - sums);
}

// What a pixel keeps of something beyond the sea surface.
fn kept_at(pixel: vec2<u32>) -> f32 {
    if (!hides_beyond() || any(pixel >= view.size_px)) { return 1.0; }
    return kept_of(hidden_share(pixel));
}

fn show(pixel: vec2<u32>, color: vec4<f32>) {
    if (all(pixel.xy < view.size_px)) { image[pixel.y * view.size_px.x + pixel.x] = composed(pixel, color); }
}

@compute @workgroup_size(SCREEN_TILE_PX, STRIDE)
fn alone(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let first_list = (workgroup.y * view.tiles.x + workgroup.x) * view.slices;
    let center = vec2<f32>(local.xy) + 0.5;
    let stride = f32(STRIDE);
    var color_0 = vec4(0.0);
    var color_1 = vec4(0.0);
    var color_2 = vec4(0.0);
    var color_3 = vec4(0.0);
    let pixel = workgroup.xy * SCREEN_TILE_PX + local.xy;
    let kept = vec4(kept_at(pixel), kept_at(pixel + vec2(0u, STRIDE)), kept_at(pixel + vec2(0u, 2u * STRIDE)), kept_at(pixel + vec2(0u, 3u * STRIDE)));
    var begin = 0u;
    if (first_list > 0u) { begin = min(list_ends[first_list - 1u], lists.entry_capacity); }
    for (var slice = 0u; slice < view.slices; slice++) {
        let end = min(list_ends[first_list + slice], lists.entry_capacity);
        if (end > begin) {
            var own_0 = vec4(0u);
            var own_1 = vec4(0u);
            var own_2 = vec4(0u);
            var own_3 = vec4(0u);
            for (var at = begin; at < end; at++) {
                let near = near_of(entries[at], center.x);
                own_0 = more(own_0, given(near, center.y, kept.x));
                own_1 = more(own_1, given(near, center.y + stride, kept.y));
                own_2 = more(own_2, given(near, center.y + 2.0 * stride, kept.z));
                own_3 = more(own_3, given(near, center.y + 3.0 * stride, kept.w));
            }
            color_0 = blended(color_0, own_0);
            color_1 = blended(color_1, own_1);
            color_2 = blended(color_2, own_2);
            color_3 = blended(color_3, own_3);
        }
        begin = end;
    }
    show(pixel, color_0);
    show(pixel + vec2(0u, STRIDE), color_1);
    show(pixel + vec2(0u, 2u * STRIDE), color_2);
    show(pixel + vec2(0u, 3u * STRIDE), color_3);
}
