// Height and slope of the terrain at a place between cell centres. Reads `terrain`.
@group(0) @binding(28) var<uniform> terrain_grid: GridParams;

struct Terrain { is_known: bool, height_m: f32, slope: vec2<f32> }

// East and west of a place so near a pole no slope is told: meridians meet.
const LEAST_COS_LAT = 0.02;

fn terrain_cell(row: i32, col: i32) -> f32 {
    let cols = i32(terrain_grid.cols);
    var x = col;
    if (terrain_grid.periodic == 1u) { x = wrapped(col, cols); }
    x = clamp(x, 0, cols - 1);
    let y = clamp(row, 0, i32(terrain_grid.rows) - 1);
    return terrain[u32(y) * terrain_grid.cols + u32(x)];
}

fn is_in_terrain(x: Axis, y: Axis) -> bool {
    let east = f32(x.index) + x.fraction + 0.5;
    let south = f32(y.index) + y.fraction + 0.5;
    return south >= 0.0 && south <= f32(terrain_grid.rows)
        && (terrain_grid.periodic == 1u || (east >= 0.0 && east <= f32(terrain_grid.cols)));
}

// Bilinear height, and the gradient of Horn (1981), doi:10.1109/PROC.1981.11918, bilinear between the four cells round
// the place: rise for each unit of way east and north, exaggerated.
fn terrain_at(x: Axis, y: Axis, cos_lat: f32) -> Terrain {
    var found: Terrain;
    if (!is_in_terrain(x, y)) { return found; }
    var z: array<f32, 16>;
    for (var i = 0; i < 16; i++) { z[i] = terrain_cell(y.index - 1 + i / 4, x.index - 1 + i % 4); }
    var height = 0.0;
    var weight = 0.0;
    for (var i = 0; i < 4; i++) {
        let own = z[5 + i % 2 + (i / 2) * 4];
        if (is_missing(own)) { continue; }
        let share = corner_share(i, x.fraction, y.fraction);
        height += own * share;
        weight += share;
    }
    if (weight < 0.5) { return found; }
    found.is_known = true;
    found.height_m = height / weight;
    // What is missing beside is level with the place.
    for (var i = 0; i < 16; i++) { if (is_missing(z[i])) { z[i] = found.height_m; } }
    var rise = vec2(0.0);
    for (var i = 0; i < 4; i++) {
        let at = 5 + i % 2 + (i / 2) * 4;
        let east = (z[at - 3] + 2.0 * z[at + 1] + z[at + 5]) - (z[at - 5] + 2.0 * z[at - 1] + z[at + 3]);
        let north = (z[at - 5] + 2.0 * z[at - 4] + z[at - 3]) - (z[at + 3] + 2.0 * z[at + 4] + z[at + 5]);
        rise += vec2(east, north) * corner_share(i, x.fraction, y.fraction);
    }
    let per_rad = vec2(terrain_grid.cols_per_rad / max(cos_lat, LEAST_COS_LAT), terrain_grid.rows_per_rad);
    found.slope = rise * per_rad * context.terrain_slope;
    return found;
}

// Bilinear weight of the corners north-west, north-east, south-west and south-east.
fn corner_share(corner: i32, east: f32, south: f32) -> f32 {
    let across = select(1.0 - east, east, corner % 2 == 1);
    let down = select(1.0 - south, south, corner / 2 == 1);
    return across * down;
}

// Colour of a height: greens to pale rock above the sea, blues to the deep below.
fn tint(height_m: f32) -> vec3<f32> {
    if (height_m < 0.0) {
        var sea = mix(vec3(0.21, 0.36, 0.42), vec3(0.14, 0.28, 0.38), clamp(height_m / -200.0, 0.0, 1.0));
        sea = mix(sea, vec3(0.09, 0.20, 0.32), clamp((height_m + 200.0) / -2300.0, 0.0, 1.0));
        sea = mix(sea, vec3(0.055, 0.13, 0.24), clamp((height_m + 2500.0) / -2500.0, 0.0, 1.0));
        return mix(sea, vec3(0.025, 0.06, 0.13), clamp((height_m + 5000.0) / -4000.0, 0.0, 1.0));
    }
    var land = mix(vec3(0.27, 0.35, 0.25), vec3(0.40, 0.44, 0.30), clamp(height_m / 300.0, 0.0, 1.0));
    land = mix(land, vec3(0.53, 0.49, 0.36), clamp((height_m - 300.0) / 900.0, 0.0, 1.0));
    land = mix(land, vec3(0.50, 0.43, 0.36), clamp((height_m - 1200.0) / 1800.0, 0.0, 1.0));
    return mix(land, vec3(0.80, 0.79, 0.78), clamp((height_m - 3000.0) / 2500.0, 0.0, 1.0));
}
