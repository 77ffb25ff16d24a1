// What lies between a splat and the sun dims it. Reads `light`, the depth above the slice planes.

// Depth above a slice plane; nothing above the first, everything above the last.
fn depth_at(texel: vec2<i32>, plane: i32) -> f32 {
    return f32(light[address(texel, u32(clamp(plane, 0, i32(params.slices))))]);
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

fn shaded(color: u32, place: vec2<i32>, slice: f32, day: f32) -> u32 {
    let texel = texel_of(place);
    let middle = i32(floor(slice - 0.5));
    let part = slice - 0.5 - f32(middle);
    let north = mix(depth_above(texel.index, middle, part), depth_above(texel.index + vec2(1, 0), middle, part), texel.part.x);
    let south = mix(depth_above(texel.index + vec2(0, 1), middle, part), depth_above(texel.index + vec2(1, 1), middle, part), texel.part.x);
    let transmittance = exp(-mix(north, south, texel.part.y));
    return dimmed(color, params.ambient + params.direct * transmittance * day);
}
