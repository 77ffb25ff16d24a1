// Blended colour to bytes: over the plain globe, where one is wanted, as straight-alpha RGBA8. Reads `domain`.
const LAND = vec3(0.36, 0.38, 0.40);
const SEA = vec3(0.035, 0.075, 0.14);
const AIR = vec3(0.30, 0.50, 0.80);

// Sea where the product has data in some step and outside its grid, land elsewhere.
fn is_land(lon: f32, lat: f32) -> bool {
    let east = lon - params.grid_west_rad;
    let col = i32(floor((east - floor(east / TURN) * TURN) * params.cols_per_rad));
    let row = i32(floor((params.grid_north_rad - lat) * params.rows_per_rad));
    if (row < 0 || row >= i32(params.rows) || col >= i32(params.cols)) { return false; }
    let cell = u32(row) * params.cols + u32(col);
    if (cell < params.held_first_cell || cell >= params.held_end_cell) { return false; }
    return domain[cell - params.held_first_cell] == 0u;
}

fn surface_below(pixel: vec2<u32>) -> vec4<f32> {
    let ground = ground_below(pixel);
    let cover = clamp(ground.rim_px + 0.5, 0.0, 1.0);
    if (!ground.on_ground) { return vec4(AIR * 0.5, 1.0) * cover; }
    var color = SEA;
    if (is_land(ground.lon, ground.lat)) { color = LAND; }
    let sun = dot(ground.normal, vec3(params.sun_x, params.sun_y, params.sun_z));
    let camera = vec3(params.eye_x, params.eye_y, params.eye_z);
    let facing = clamp(dot(ground.normal, normalize(camera - ground.normal)), 0.0, 1.0);
    let haze = (1.0 - facing) * (1.0 - facing) * (1.0 - facing);
    let lit = color * (0.45 + 0.75 * clamp(sun, 0.0, 1.0));
    return vec4(mix(lit, AIR, 0.55 * haze), 1.0) * cover;
}

fn composed(pixel: vec2<u32>, blended: vec4<f32>) -> u32 {
    var color = blended;
    if (params.surface == 1u) { color += surface_below(pixel) * (1.0 - color.w); }
    let alpha = u32(clamp(color.w, 0.0, 1.0) * 255.0 + 0.5);
    if (alpha == 0u) { return 0u; }
    let rgb = vec3<u32>(clamp(color.xyz / color.w, vec3(0.0), vec3(1.0)) * 255.0 + 0.5);
    return rgb.x | (rgb.y << 8u) | (rgb.z << 16u) | (alpha << 24u);
}
