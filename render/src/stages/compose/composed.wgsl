// Blended colour to bytes: over the plain globe, where one is wanted, or in its surroundings.
// Kernels of their own for pictures in their surroundings: others pay nothing for it.
override IN_CONTEXT: bool = false;

fn surface_below(pixel: vec2<u32>) -> vec4<f32> {
    let ground = ground_below(pixel);
    let cover = clamp(ground.rim_px + 0.5, 0.0, 1.0);
    if (!ground.on_ground) { return vec4(AIR * 0.5, 1.0) * cover; }
    var color = SEA;
    if (is_land(ground.lon, ground.lat)) { color = LAND; }
    let lit = color * sunlight(dot(ground.normal, view.sun));
    return vec4(hazy(lit, ground.normal), 1.0) * cover;
}

fn composed(pixel: vec2<u32>, blended: vec4<f32>) -> u32 {
    var color = blended;
    if (IN_CONTEXT) {
        color = in_context(pixel, blended);
    } else if (context.surface == 1u) {
        color += surface_below(pixel) * (1.0 - color.w);
    }
    return bytes_of(color);
}
