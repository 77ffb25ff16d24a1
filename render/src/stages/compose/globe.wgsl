// What is seen of a plain globe, and a colour as bytes. Reads `domain`.
@group(0) @binding(11) var<storage, read> land: array<u32>;

const LAND = vec3(0.36, 0.38, 0.40);
const SEA = vec3(0.035, 0.075, 0.14);
const AIR = vec3(0.30, 0.50, 0.80);
// Sea that the product has no data of is hatched, so much lighter.
const HATCH = vec3(0.05, 0.06, 0.07);
const HATCH_PX = 8;
const HATCH_LINE_PX = 2;

fn land_cell(col: i32, row: i32) -> f32 {
    let size = vec2<i32>(context.land_size);
    let at = u32(clamp(row, 0, size.y - 1) * size.x + (col % size.x + size.x) % size.x);
    return f32((land[at / 4u] >> (at % 4u * 8u)) & 255u) / 255.0;
}

// Share of a place that is land, between four cells.
fn land_share(lon: f32, lat: f32) -> f32 {
    let place = vec2(lon, -lat) * context.land_per_rad + vec2<f32>(context.land_size) * 0.5 - 0.5;
    let index = floor(place);
    let part = place - index;
    let cell = vec2<i32>(index);
    let north = mix(land_cell(cell.x, cell.y), land_cell(cell.x + 1, cell.y), part.x);
    let south = mix(land_cell(cell.x, cell.y + 1), land_cell(cell.x + 1, cell.y + 1), part.x);
    return mix(north, south, part.y);
}

// The plain globe in even light: land where land is, sea of a colour, hatched where the product has no data.
fn plain(lon: f32, lat: f32, water: vec3<f32>, pixel: vec2<u32>) -> vec3<f32> {
    var sea = water;
    let place = vec2<i32>(pixel) + view.origin_px;
    if ((place.x + place.y) % HATCH_PX < HATCH_LINE_PX && is_unsampled(lon, lat)) { sea += HATCH; }
    return mix(sea, LAND, land_share(lon, lat));
}

// Does the product have no data there, at any step, though its grid goes there?
fn is_unsampled(lon: f32, lat: f32) -> bool {
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
