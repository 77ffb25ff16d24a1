// Blended colour to bytes, alone or in its surroundings.
// Kernels of their own for pictures in their surroundings: others pay nothing for it.
override IN_CONTEXT: bool = false;

fn composed(pixel: vec2<u32>, blended: vec4<f32>) -> u32 {
    if (!IN_CONTEXT) { return bytes_of(blended, pixel, false); }
    let seen = in_context(pixel, blended);
    return bytes_of(seen.colour, pixel, seen.is_beside);
}
