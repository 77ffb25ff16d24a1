// The picture of a thematic map as bytes; the eye composes its own pixels.
@group(0) @binding(1) var<storage, read> picture: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> domain: array<u32>;
@group(0) @binding(3) var<storage, read_write> image: array<u32>;

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn compose(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if (any(pixel.xy >= view.size_px)) { return; }
    let at = pixel.y * view.size_px.x + pixel.x;
    image[at] = composed(pixel.xy, picture[at]);
}
