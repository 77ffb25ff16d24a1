// A particle on the screen and in the light: map projection for tiles, eq. 4 (docs/method.md) and a perspective camera for the globe.
// Reads `rows` and `cols`.
struct ProjectParams {
    half: vec3<f32>, slice_top: f32,
    light_u: vec3<f32>, light_u0: f32,
    light_v: vec3<f32>, light_v0: f32,
    slices_per_unit: f32, size_spread: f32, lon_span_rad: f32, height_px_per_m: f32,
    light_shift_per_m: vec2<f32>, light_origin: vec2<i32>,
    min_radius_px: f32, max_radius_px: f32, light_depth_gain: f32, light_texels_per_unit: f32,
    per_earth_radius_m: f32, day_on: u32, beyond_m: f32,
}
@group(0) @binding(22) var<uniform> projection: ProjectParams;

// Half a cell beyond which the series for small angles is not good enough.
const WIDE_CELL_RAD = 0.2;

// Sine and cosine of a small angle added to one with known sine and cosine: exact to 1e-7 below 0.2 rad, unlike
// the sine of some devices.
fn turned(sin_a: f32, cos_a: f32, delta: f32) -> vec2<f32> {
    if (abs(delta) > WIDE_CELL_RAD) { return vec2(sin_a * cos(delta) + cos_a * sin(delta), cos_a * cos(delta) - sin_a * sin(delta)); }
    let d2 = delta * delta;
    let s = delta * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0));
    let c = 1.0 - d2 / 2.0 * (1.0 - d2 / 12.0);
    return vec2(sin_a * c + cos_a * s, cos_a * c - sin_a * s);
}

fn slice_of(coordinate: f32) -> f32 {
    return clamp((projection.slice_top - coordinate) * projection.slices_per_unit, 0.0, f32(view.slices) - 0.001);
}

fn size_of(colour: u32) -> f32 {
    return 1.0 + projection.size_spread * (f32(colour >> 24u) / 255.0 - 1.0);
}

// Where a particle's place lies on the globe, length 1.
fn normal_of(particle: Particle) -> vec3<f32> {
    let row = rows[particle.row];
    let col = cols[particle.slot];
    let lat = turned(row.sin_lat, row.cos_lat, (0.5 - particle.south) * row.lat_span_rad);
    let lon = turned(col.sin_lon, col.cos_lon, (particle.east - 0.5) * projection.lon_span_rad);
    return vec3(lat.y * lon.x, lat.y * lon.y, lat.x);
}

// Share of direct light at a place: 0 on the night side, with dusk between.
fn day_at(normal: vec3<f32>) -> f32 {
    return smoothstep(-0.15, 0.35, dot(normal, view.sun));
}

// All of a colour is the particle's own: see `Splat`.
const UNDIMMED = 0xff000000u;

// A particle's colour as an eye below the sea surface sees it: through the surface from underneath where the particle lies
// above it, and through the water. In the last byte is what is left of its own light.
fn through_sea(particle: Particle, sight: vec3<f32>, normal: vec3<f32>) -> u32 {
    let way = length(sight);
    let toward = sight / max(way, 1.0e-9);
    let nearest_at = -dot(view.eye, toward);
    let foot = view.eye + toward * nearest_at;
    let to_ceiling = nearest_at + sqrt(max(1.0 - dot(foot, foot), 0.0));
    let codes = codes_of(particle.colour) / 255.0;
    // The sheet of particles at the surface lies on both sides of it.
    let above = clamp(particle.height_m / particles.sheet_m + 0.5, 0.0, 1.0);
    let through = mix(1.0, view.ceiling_kept, above);
    let seen = mix(ceiling_light(dot(normal, view.sun)), codes * codes, through);
    let left = kept_over(min(way, to_ceiling));
    let water = water_light(dot(toward, view.eye) / length(view.eye));
    let colour = with_codes(0u, sqrt(mix(water, seen, left)) * 255.0);
    return colour | (u32(nearest(through * left * 255.0)) << 24u);
}

fn on_tile(particle: Particle) -> Splat {
    let row = rows[particle.row];
    let col = cols[particle.slot];
    let subpixels = f32(SUBPIXELS);
    var splat: Splat;
    let ground_y = row.y_sub + nearest(particle.south * row.y_span_px * subpixels);
    splat.x_sub = col.x_sub + nearest(particle.east * col.x_span_px * subpixels);
    splat.y_sub = ground_y - nearest(particle.height_m * projection.height_px_per_m * subpixels);
    splat.light_u = splat.x_sub + nearest(particle.height_m * projection.light_shift_per_m.x) + projection.light_origin.x;
    splat.light_v = ground_y + nearest(particle.height_m * projection.light_shift_per_m.y) + projection.light_origin.y;
    let radius = row.radius * size_of(particle.colour);
    splat.radius_px = clamp(radius, projection.min_radius_px, projection.max_radius_px);
    let thinned = row.radius / splat.radius_px;
    splat.tau = particle.depth * row.depth_gain * thinned * thinned;
    splat.light_depth = splat.tau * splat.radius_px * splat.radius_px * projection.light_depth_gain;
    splat.slice = slice_of(particle.height_m);
    splat.day = 1.0;
    if (feature(HAS_DAY, projection.day_on == 1u)) { splat.day = day_at(normal_of(particle)); }
    splat.colour = particle.colour | UNDIMMED;
    splat.is_beyond = u32(-particle.height_m > projection.beyond_m);
    return splat;
}

fn on_globe(particle: Particle) -> Splat {
    let row = rows[particle.row];
    let normal = normal_of(particle);
    let distance = 1.0 + particle.height_m * projection.per_earth_radius_m;
    let place = normal * distance;
    let camera = view.eye;
    let sight = place - camera;
    let ahead = dot(sight, view.forward);
    // Hidden if beyond the horizon of the sea surface, or of its own sphere when below it; from below, beyond that of the core.
    let beyond = dot(normal, camera);
    let horizon = min(distance, view.hides);
    let camera_sq = dot(camera, camera);
    let grazing = sqrt(max(camera_sq - horizon * horizon, 0.0)) * sqrt(max(distance * distance - horizon * horizon, 0.0));
    // What is not seen still casts its shadow.
    var splat: Splat;
    splat.light_depth = particle.depth * row.depth_gain * row.radius * row.radius * projection.light_depth_gain;
    splat.slice = slice_of(dot(place, projection.half));
    let u = dot(place, projection.light_u) - projection.light_u0;
    let v = dot(place, projection.light_v) - projection.light_v0;
    splat.light_u = nearest(u * projection.light_texels_per_unit * f32(lighting.unit));
    splat.light_v = nearest(v * projection.light_texels_per_unit * f32(lighting.unit));
    splat.day = day_at(normal);
    splat.colour = particle.colour | UNDIMMED;
    if (is_submerged()) { splat.colour = through_sea(particle, sight, normal); }
    if (ahead < 0.01 * abs(camera_sq - 1.0) || beyond * distance < horizon * horizon - grazing) { return splat; }
    let scale = view.focal_px / ahead;
    let x = dot(sight, view.right) * scale + view.center_px.x;
    let y = view.center_px.y - dot(sight, view.up) * scale;
    // A ball away from the middle of the picture is drawn as an ellipse, longer by 1 / cos; the disc has its area.
    let oblique = sqrt(length(sight) / ahead);
    let full_px = row.radius * scale * oblique;
    let radius_px = full_px * size_of(particle.colour);
    if (max(abs(x), abs(y)) > 1.0e5 || radius_px > projection.max_radius_px) { return splat; }
    splat.x_sub = nearest(x * f32(SUBPIXELS)) - view.origin_px.x * SUBPIXELS;
    splat.y_sub = nearest(y * f32(SUBPIXELS)) - view.origin_px.y * SUBPIXELS;
    splat.radius_px = max(radius_px, projection.min_radius_px);
    let thinned = full_px / splat.radius_px;
    splat.tau = particle.depth * row.depth_gain * thinned * thinned;
    splat.is_beyond = u32(select(-particle.height_m, particle.height_m, is_submerged()) > projection.beyond_m);
    return splat;
}

fn splat_of(particle: Particle) -> Splat {
    if (is_tile()) { return on_tile(particle); }
    return on_globe(particle);
}
