// What is seen of a plain globe and of the air over it, and a colour as bytes. Reads `domain`.
struct BaseMapParams {
    land: vec3<f32>, shading: f32, land_high: vec3<f32>, high_m: f32, sea: vec3<f32>, border_grey: f32, shelf: vec3<f32>, border_alpha: f32,
    deep: vec3<f32>, deep_m: f32, hatch: vec3<f32>, air_depth: f32, air: vec3<f32>, air_height: f32, sky: vec3<f32>, sky_alpha: f32,
    lake: vec3<f32>, sun_share: f32, hatch_over_relief: vec3<f32>, over_grey: f32, over_coast_alpha: f32, over_border_alpha: f32,
}
@group(0) @binding(29) var<uniform> base_map: BaseMapParams;

const HATCH_PX = 8;
const HATCH_LINE_PX = 2;

// Colour of water over a sea floor, or over one that is not known.
fn sea_colour(floor: Terrain) -> vec3<f32> {
    if (feature(HAS_WATER, context.has_water == 1u)) { return vec3(WATER_RED, WATER_GREEN, WATER_BLUE); }
    if (!floor.is_known) { return base_map.sea; }
    return mix(base_map.shelf, base_map.deep, clamp(-floor.height_m / base_map.deep_m, 0.0, 1.0));
}

// The plain globe in even light: land where land is, lakes in it, sea, hatched where the product has no data. `shares` of
// the pixel are land and lake, as `ground_mask` says.
fn plain(lon: f32, lat: f32, shares: vec2<f32>, floor: Terrain, pixel: vec2<u32>) -> vec3<f32> {
    var sea = sea_colour(floor);
    if (is_hatched(lon, lat, pixel)) { sea += base_map.hatch; }
    var land = base_map.land;
    if (floor.is_known) { land = mix(land, base_map.land_high, clamp(floor.height_m / base_map.high_m, 0.0, 1.0)); }
    return mix(mix(sea, land, shares.x), base_map.lake, shares.y);
}

// Is a pixel on a line of the hatching, where the product has no data?
fn is_hatched(lon: f32, lat: f32, pixel: vec2<u32>) -> bool {
    let place = vec2<i32>(pixel) + view.origin_px;
    return (place.x + place.y) % HATCH_PX < HATCH_LINE_PX && is_unsampled(lon, lat);
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
    return 0.25 + clamp(sun, 0.0, 1.0);
}

// The same as the base map shows it.
fn daylight(sun: f32) -> f32 {
    return 1.0 + base_map.sun_share * (sunlight(sun) - 1.0);
}

// Optical depth of the air from a height, earth radii, outwards along a line whose cosine against the vertical is `up`.
fn air_above(height: f32, up: f32) -> f32 {
    let slant = 0.5 * (up + sqrt(up * up + LEVEL * base_map.air_height));
    return base_map.air_depth * exp(-height / base_map.air_height) / slant;
}
// 8 / pi: along a level line the depth is that of an exponential atmosphere.
const LEVEL = 2.5464791;

// The same between the eye and what a pixel's sight line meets, or along all of it where it passes the globe.
fn air_along(ground: Ground) -> f32 {
    let radius = length(view.eye);
    let down = ground.nearest_at / radius;
    let behind = air_above(max(radius - 1.0, 0.0), abs(down));
    if (ground.on_ground) {
        let sight = normalize(ground.normal - view.eye);
        return max(air_above(0.0, -dot(sight, ground.normal)) - behind, 0.0);
    }
    if (down <= 0.0) { return behind; }
    return max(2.0 * air_above(max(length(ground.foot) - 1.0, 0.0), 0.0) - behind, 0.0);
}

// What shines beside the globe: its air, over a sky where one is wanted.
fn beside(ground: Ground) -> vec4<f32> {
    let share = 1.0 - exp(-air_along(ground));
    let lit = base_map.air * daylight(dot(ground.foot, view.sun) / max(length(ground.foot), 1.0e-6));
    return vec4(lit, 1.0) * share + vec4(base_map.sky, 1.0) * (base_map.sky_alpha * (1.0 - share));
}

// What is seen of the ground half a pixel beyond its outline, through half of the air there.
fn rim(ground: Ground) -> vec3<f32> {
    let day = daylight(dot(ground.foot, view.sun) / max(length(ground.foot), 1.0e-6));
    return mix(base_map.sea, base_map.air, 1.0 - exp(-0.5 * air_along(ground))) * day;
}

// A colour of the ground through its air.
fn hazy(colour: vec3<f32>, ground: Ground) -> vec3<f32> {
    let lit = base_map.air * daylight(dot(ground.normal, view.sun));
    return mix(colour, lit, 1.0 - exp(-air_along(ground)));
}

// Threshold of ordered dithering at a place (Bayer 1973), 0 to 63: three bits of x ^ y and y in turn, lowest first.
fn threshold(place: vec2<u32>) -> u32 {
    let bits = (place.x ^ place.y) & 7u;
    let down = place.y & 7u;
    return ((bits & 1u) << 5u) | ((down & 1u) << 4u) | ((bits & 2u) << 2u) | ((down & 2u) << 1u) | ((bits & 4u) >> 1u) | ((down & 4u) >> 2u);
}

// Straight-alpha sRGB in RGBA8, red lowest, of premultiplied linear light. What is seen beside a globe is dithered: air and sky
// are smoother than bytes. Why nothing else is: docs/method.md, "Air".
fn bytes_of(colour: vec4<f32>, pixel: vec2<u32>, is_dithered: bool) -> u32 {
    let alpha = u32(clamp(colour.w, 0.0, 1.0) * 255.0 + 0.5);
    if (alpha == 0u) { return 0u; }
    var rounding = 0.5;
    if (is_dithered) {
        rounding = (f32(threshold(pixel + vec2<u32>(view.origin_px))) + 0.5) / 64.0;
    }
    let rgb = vec3<u32>(clamp(srgb_of(colour.xyz / colour.w), vec3(0.0), vec3(1.0)) * 255.0 + rounding);
    return rgb.x | (rgb.y << 8u) | (rgb.z << 16u) | (alpha << 24u);
}
