// What is seen of a plain globe, and a colour as bytes. Reads `domain`.
const LAND = vec3(0.36, 0.38, 0.40);
const SEA = vec3(0.035, 0.075, 0.14);
const AIR = vec3(0.30, 0.50, 0.80);

// Sea where the product has data in some step and outside its grid, land elsewhere.
fn is_land(lon: f32, lat: f32) -> bool {
    let east = lon - grid.west_rad;
    let col = i32(floor((east - floor(east / TURN) * TURN) * grid.cols_per_rad));
    let row = i32(floor((grid.north_rad - lat) * grid.rows_per_rad));
    if (row < 0 || row >= i32(grid.rows) || col >= i32(grid.cols)) { return false; }
    let cell = u32(row) * grid.cols + u32(col);
    if (cell < grid.held_first_cell || cell >= grid.held_end_cell) { return false; }
    return domain[cell - grid.held_first_cell] == 0u;
}

// Light of the sun at a sine of its elevation, with what comes from all sides.
fn sunlight(sun: f32) -> f32 {
    return 0.45 + 0.75 * clamp(sun, 0.0, 1.0);
}

// A colour of the ground through the air towards the globe's outline.
fn hazy(color: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let camera = view.eye;
    let facing = clamp(dot(normal, normalize(camera - normal)), 0.0, 1.0);
    let haze = (1.0 - facing) * (1.0 - facing) * (1.0 - facing);
    return mix(color, AIR, 0.55 * haze);
}

// Straight-alpha RGBA8, red lowest.
fn bytes_of(color: vec4<f32>) -> u32 {
    let alpha = u32(clamp(color.w, 0.0, 1.0) * 255.0 + 0.5);
    if (alpha == 0u) { return 0u; }
    let rgb = vec3<u32>(clamp(color.xyz / color.w, vec3(0.0), vec3(1.0)) * 255.0 + 0.5);
    return rgb.x | (rgb.y << 8u) | (rgb.z << 16u) | (alpha << 24u);
}
