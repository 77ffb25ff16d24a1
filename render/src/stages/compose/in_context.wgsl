// A blended colour in its surroundings: the plain globe, coast lines, the terrain through the sea, the night. Bindings are beyond
// those of the stages that compose.
struct ContextParams {
    surface: u32, has_water: u32, night_on: u32, terrain_on: u32, sea_floor_on: u32, terrain_slope: f32, seabed_per_m: f32, coast_on: u32,
    coast_above: u32, coast_grey: f32, coast_alpha: f32, coast_row_words: u32, land_hides: u32, lines_on: u32, isolines_through: f32,
    graticule_grey: f32, graticule_alpha: f32, trails_on: u32, trails_row_px: u32, land_masked: u32,
}
@group(0) @binding(27) var<uniform> context: ContextParams;
@group(0) @binding(5) var<storage, read> terrain: array<f32>;
@group(0) @binding(6) var<storage, read> ground_axes: array<GroundAxis>;
@group(0) @binding(7) var<storage, read> coast: array<u32>;
// Of the part that is drawn; see `isolines.wgsl`.
@group(0) @binding(11) var<storage, read> lines: array<u32>;
// Of the whole picture: red lowest, sRGB with straight alpha.
@group(0) @binding(12) var<storage, read> trails_below: array<u32>;

fn has_surface() -> bool { return feature(HAS_SURFACE, context.surface == 1u); }
fn has_terrain() -> bool { return feature(HAS_TERRAIN, context.terrain_on == 1u); }
fn has_coast_above() -> bool { return feature(HAS_COAST_ABOVE, context.coast_above == 1u); }
fn has_trails() -> bool { return feature(HAS_TRAILS, context.trails_on == 1u); }
fn masks_land() -> bool { return feature(MASKS_LAND, context.land_masked == 1u); }
fn land_hides() -> bool { return feature(LAND_HIDES, context.land_hides == 1u); }

// Light on a thematic map where it is night.
const NIGHT = 0.14;

// What a pixel shows of the earth: its place in the terrain, and the sun from there in east, north and up.
struct Spot {
    on_ground: bool, x: Axis, y: Axis, cos_lat: f32, sun: vec3<f32>, cover: f32, ground: Ground,
}

fn axis_at(place: f32) -> Axis {
    let index = floor(place);
    return Axis(i32(index), place - index);
}

fn sun_from(lon: vec2<f32>, lat: vec2<f32>) -> vec3<f32> {
    let sun = view.sun;
    if (feature(HAS_LOCAL_SUN, view.sun_is_local == 1u)) { return sun; }
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
    spot.ground = ground;
    if (!ground.on_ground) { return spot; }
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
    let floor_colour = linear_of(tint(ground.height_m)) * sunlight(dot(facing, sun) * day);
    if (ground.height_m >= 0.0 || context.seabed_per_m <= 0.0) { return floor_colour; }
    let water = vec3(WATER_RED, WATER_GREEN, WATER_BLUE) * sunlight(sun.z);
    return mix(water, floor_colour, exp(context.seabed_per_m * ground.height_m));
}

// The plain globe in the light of the sun; a coarse relief is a part lighter or darker where it slopes.
fn lit_plain(spot: Spot, floor: Terrain, pixel: vec2<u32>) -> vec3<f32> {
    let shares = ground_mask(pixel).xy;
    let colour = plain(spot.ground.lon, spot.ground.lat, shares, floor, pixel) * daylight(spot.sun.z);
    if (!floor.is_known) { return colour; }
    let facing = normalize(vec3(-floor.slope, 1.0));
    let day = clamp(spot.sun.z * 10.0 + 0.5, 0.0, 1.0);
    let slanted = sunlight(dot(facing, spot.sun) * day) / sunlight(spot.sun.z * day);
    return colour * (1.0 + base_map.shading * (slanted - 1.0));
}

// Terrain of a globe view in the light of the sun, its sea hatched where the product has no data.
fn lit_relief(spot: Spot, ground: Terrain, pixel: vec2<u32>) -> vec3<f32> {
    let lit = lit_terrain(ground, spot.sun);
    if (!is_hatched(spot.ground.lon, spot.ground.lat, pixel)) { return lit; }
    let shares = ground_mask(pixel).xy;
    let sea = (1.0 - shares.x) * (1.0 - shares.y);
    return lit + base_map.hatch_over_relief * (sunlight(spot.sun.z) * sea);
}

fn ground_colour(spot: Spot, pixel: vec2<u32>) -> vec4<f32> {
    if (!has_surface()) { return vec4(0.0); }
    var ground: Terrain;
    if (spot.on_ground && (has_terrain() || feature(HAS_SEA_FLOOR, context.sea_floor_on == 1u))) {
        ground = terrain_at(spot.x, spot.y, spot.cos_lat);
    }
    if (is_tile()) {
        if (!ground.is_known) { return vec4(0.0); }
        return vec4(lit_terrain(ground, spot.sun), 1.0);
    }
    var seen = vec4(0.0);
    if (spot.cover < 1.0) { seen = beside(spot.ground) * (1.0 - spot.cover); }
    if (spot.cover <= 0.0) { return seen; }
    var lit: vec3<f32>;
    if (!spot.on_ground) {
        lit = rim(spot.ground);
    } else if (ground.is_known && has_terrain()) {
        lit = hazy(lit_relief(spot, ground, pixel), spot.ground);
    } else {
        lit = hazy(lit_plain(spot, ground, pixel), spot.ground);
    }
    return seen + vec4(lit, 1.0) * spot.cover;
}

// Share of land in a pixel of a globe view in 255 parts.
fn land_share(pixel: vec2<u32>) -> u32 {
    let place = pixel + vec2<u32>(view.origin_px);
    return coast[place.y * context.coast_row_words + place.x] & 255u;
}

fn trail_word(pixel: vec2<u32>) -> u32 {
    let place = pixel + vec2<u32>(view.origin_px);
    return trails_below[place.y * context.trails_row_px + place.x];
}

// The trail of a pixel on the sea surface.
fn trail_colour(pixel: vec2<u32>) -> vec4<f32> {
    if (!has_trails()) { return vec4(0.0); }
    let word = trail_word(pixel);
    return vec4(linear_of(codes_of(word) / 255.0), 1.0) * (f32(word >> 24u) / 255.0);
}

// Share of what lies beyond the sea surface that land and trails hide in a pixel, in 255 parts. Trails count twice: depth that
// is scaled hides more of them than it should where it is large.
fn hidden_share(pixel: vec2<u32>) -> u32 {
    var kept = 255u;
    if (land_hides()) { kept -= land_share(pixel); }
    if (has_trails()) {
        let clear = 255u - (trail_word(pixel) >> 24u);
        kept = (kept * clear * clear + 32512u) / 65025u;
    }
    return 255u - kept;
}

// What lies in a pixel of a globe view: shares of land, lakes, shores and borders.
fn ground_mask(pixel: vec2<u32>) -> vec4<f32> {
    let place = pixel + vec2<u32>(view.origin_px);
    let word = coast[place.y * context.coast_row_words + place.x];
    return vec4(f32(word & 255u), f32((word >> 8u) & 255u), f32((word >> 16u) & 255u), f32(word >> 24u)) / 255.0;
}

// Coast lines, below them borders; `covered` is how much of what lies below has colours of its own.
fn coast_colour(spot: Spot, pixel: vec2<u32>, covered: f32) -> vec4<f32> {
    if (!feature(HAS_COAST, context.coast_on == 1u)) { return vec4(0.0); }
    if (!is_tile()) {
        let mask = ground_mask(pixel) * line_share(spot.ground);
        let shore = mask.z * mix(context.coast_alpha, base_map.over_coast_alpha, covered);
        let border = mask.w * mix(base_map.border_alpha, base_map.over_border_alpha, covered);
        let greys = mix(vec2(context.coast_grey, base_map.border_grey), vec2(base_map.over_grey), covered);
        return vec4(vec3(greys.x), 1.0) * shore + vec4(vec3(greys.y), 1.0) * (border * (1.0 - shore));
    }
    let place = pixel + vec2<u32>(view.origin_px);
    let word = coast[place.y * context.coast_row_words + place.x / 4u];
    let cover = f32((word >> (place.x % 4u * 8u)) & 255u) / 255.0 * context.coast_alpha;
    return vec4(vec3(context.coast_grey), 1.0) * cover;
}

// A line over what lies below it, or where that leaves it seen.
fn over(line: vec4<f32>, colour: vec4<f32>, is_above: bool) -> vec4<f32> {
    if (is_above) { return line + colour * (1.0 - line.w); }
    return colour + line * (1.0 - colour.w);
}

// Share of a pixel that shows values: what is not land, where land is masked.
fn unmasked_share(pixel: vec2<u32>) -> f32 {
    if (!masks_land()) { return 1.0; }
    return f32(255u - land_share(pixel)) / 255.0;
}

// Lines of a pixel on the sea surface; `covered` is how much of what lies below has colours of its own.
struct SurfaceLines { isoline: vec4<f32>, graticule: vec4<f32> }

fn surface_lines(pixel: vec2<u32>, covered: f32) -> SurfaceLines {
    if (!feature(HAS_LINES, context.lines_on == 1u)) { return SurfaceLines(vec4(0.0), vec4(0.0)); }
    let word = lines[pixel.y * view.size_px.x + pixel.x];
    let isoline = vec4(vec3(f32((word >> 12u) & 255u) / 255.0), 1.0) * (f32(word & 4095u) / 4095.0 * unmasked_share(pixel));
    let grey = mix(context.graticule_grey, base_map.over_grey, covered);
    return SurfaceLines(isoline, vec4(vec3(grey), 1.0) * (f32(word >> 20u) / 4095.0 * context.graticule_alpha));
}

// Particles with the lines below them: they hide the graticule, and isolines but for a part.
fn with_lines(pixel: vec2<u32>, colour: vec4<f32>, covered: f32) -> vec4<f32> {
    let own = surface_lines(pixel, covered);
    let shown = over(own.isoline, over(own.isoline * context.isolines_through, colour, true), false);
    return over(own.graticule, shown, has_coast_above());
}

// `is_beside`: it is smoother than bytes, see `bytes_of`.
struct InContext { colour: vec4<f32>, is_beside: bool }

fn in_context(pixel: vec2<u32>, blended: vec4<f32>) -> InContext {
    var spot: Spot;
    if (is_tile()) { spot = spot_on_tile(pixel); } else { spot = spot_on_globe(pixel); }
    var colour = blended * unmasked_share(pixel);
    if (feature(HAS_NIGHT, context.night_on == 1u)) {
        colour = vec4(colour.xyz * mix(NIGHT, 1.0, smoothstep(-0.15, 0.35, spot.sun.z)), colour.w);
    }
    if (is_submerged()) { return InContext(from_below(spot, pixel, colour), true); }
    var covered = f32(has_terrain());
    if (has_coast_above()) { covered = max(covered, colour.w); }
    let trail = trail_colour(pixel);
    if (has_coast_above()) { colour = over(trail, colour, true); }
    colour = with_lines(pixel, colour, covered);
    let line = coast_colour(spot, pixel, covered);
    colour = over(line, colour, has_coast_above());
    if (!has_coast_above()) { colour = over(trail, colour, false); }
    colour += ground_colour(spot, pixel) * (1.0 - colour.w);
    return InContext(colour, spot.cover < 1.0);
}
