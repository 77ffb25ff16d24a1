// A blended colour in its surroundings: coast lines, the terrain through the sea, the night. Bindings are beyond
// those of the stages that compose.
struct ContextParams {
    surface: u32, has_water: u32, night_on: u32, terrain_on: u32, terrain_slope: f32, seabed_per_m: f32, coast_on: u32,
    coast_above: u32, coast_grey: f32, coast_alpha: f32, coast_row_words: u32,
}
@group(0) @binding(27) var<uniform> context: ContextParams;
@group(0) @binding(5) var<storage, read> terrain: array<f32>;
@group(0) @binding(6) var<storage, read> ground_axes: array<GroundAxis>;
@group(0) @binding(7) var<storage, read> coast: array<u32>;

// Light on a thematic map where it is night.
const NIGHT = 0.4;

// What a pixel shows of the earth: its place in the terrain, and the sun from there in east, north and up.
struct Spot {
    on_ground: bool, x: Axis, y: Axis, cos_lat: f32, sun: vec3<f32>, lon: f32, lat: f32, normal: vec3<f32>, cover: f32,
}

fn axis_at(place: f32) -> Axis {
    let index = floor(place);
    return Axis(i32(index), place - index);
}

fn sun_from(lon: vec2<f32>, lat: vec2<f32>) -> vec3<f32> {
    let sun = view.sun;
    if (view.sun_is_local == 1u) { return sun; }
    let outward = sun.x * lon.x + sun.y * lon.y;
    return vec3(sun.x * lon.y - sun.y * lon.x, sun.z * lat.y - outward * lat.x, sun.z * lat.x + outward * lat.y);
}

fn spot_on_tile(pixel: vec2<u32>) -> Spot {
    let col = ground_axes[pixel.x];
    let row = ground_axes[view.size_px.x + pixel.y];
    var spot: Spot;
    spot.on_ground = true;
    spot.cover = 1.0;
    spot.x = Axis(col.index, col.fraction);
    spot.y = Axis(row.index, row.fraction);
    spot.cos_lat = row.cos;
    spot.sun = sun_from(vec2(col.sin, col.cos), vec2(row.sin, row.cos));
    return spot;
}

fn spot_on_globe(pixel: vec2<u32>) -> Spot {
    let ground = ground_below(pixel);
    var spot: Spot;
    spot.cover = clamp(ground.rim_px + 0.5, 0.0, 1.0);
    spot.on_ground = ground.on_ground;
    if (!ground.on_ground) { return spot; }
    spot.lon = ground.lon;
    spot.lat = ground.lat;
    spot.normal = ground.normal;
    spot.cos_lat = length(ground.normal.xy);
    let east = ground.lon - terrain_grid.west_rad;
    spot.x = axis_at((east - floor(east / TURN) * TURN) * terrain_grid.cols_per_rad - 0.5);
    spot.y = axis_at((terrain_grid.north_rad - ground.lat) * terrain_grid.rows_per_rad - 0.5);
    spot.sun = sun_from(ground.normal.xy / max(spot.cos_lat, 1.0e-6), vec2(ground.normal.z, spot.cos_lat));
    return spot;
}

// Terrain in the light of the sun, what lies below the sea through its water.
fn lit_terrain(ground: Terrain, sun: vec3<f32>) -> vec3<f32> {
    let facing = normalize(vec3(-ground.slope, 1.0));
    // Slopes that still look at a sun below the horizon lie in the shadow of the earth.
    let day = clamp(sun.z * 10.0 + 0.5, 0.0, 1.0);
    let floor_color = tint(ground.height_m) * sunlight(dot(facing, sun) * day);
    if (ground.height_m >= 0.0 || context.seabed_per_m <= 0.0) { return floor_color; }
    let water = vec3(WATER_RED, WATER_GREEN, WATER_BLUE) * sunlight(sun.z);
    return mix(water, floor_color, exp(context.seabed_per_m * ground.height_m));
}

fn ground_color(spot: Spot) -> vec4<f32> {
    if (context.surface == 0u) { return vec4(0.0); }
    if (!spot.on_ground) { return vec4(AIR * 0.5, 1.0) * spot.cover; }
    var ground: Terrain;
    if (context.terrain_on == 1u) { ground = terrain_at(spot.x, spot.y, spot.cos_lat); }
    if (view.kind == VIEW_TILE) {
        if (!ground.is_known) { return vec4(0.0); }
        return vec4(lit_terrain(ground, spot.sun), 1.0);
    }
    var lit: vec3<f32>;
    if (ground.is_known) {
        lit = lit_terrain(ground, spot.sun);
    } else {
        var color = SEA;
        if (context.has_water == 1u) { color = vec3(WATER_RED, WATER_GREEN, WATER_BLUE); }
        if (is_land(spot.lon, spot.lat)) { color = LAND; }
        lit = color * sunlight(spot.sun.z);
    }
    return vec4(hazy(lit, spot.normal), 1.0) * spot.cover;
}

fn coast_color(pixel: vec2<u32>) -> vec4<f32> {
    if (context.coast_on == 0u) { return vec4(0.0); }
    let place = pixel + vec2<u32>(view.origin_px);
    let word = coast[place.y * context.coast_row_words + place.x / 4u];
    let cover = f32((word >> (place.x % 4u * 8u)) & 255u) / 255.0 * context.coast_alpha;
    return vec4(vec3(context.coast_grey), 1.0) * cover;
}

fn in_context(pixel: vec2<u32>, blended: vec4<f32>) -> vec4<f32> {
    var spot: Spot;
    if (view.kind == VIEW_TILE) { spot = spot_on_tile(pixel); } else { spot = spot_on_globe(pixel); }
    var color = blended;
    if (context.night_on == 1u) {
        color = vec4(color.xyz * mix(NIGHT, 1.0, smoothstep(-0.15, 0.35, spot.sun.z)), color.w);
    }
    let line = coast_color(pixel);
    if (context.coast_above == 1u) {
        color = line + color * (1.0 - line.w);
    } else {
        color += line * (1.0 - color.w);
    }
    color += ground_color(spot) * (1.0 - color.w);
    return color;
}
