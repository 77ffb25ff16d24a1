// A particle on the screen and in the light: map projection for tiles, eq. 4 (docs/method.md) and a perspective camera for the globe.
// Reads `rows` and `cols`.
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
    return clamp((params.slice_top - coordinate) * params.slices_per_unit, 0.0, f32(params.slices) - 0.001);
}

fn size_of(color: u32) -> f32 {
    return 1.0 + params.size_spread * (f32(color >> 24u) / 255.0 - 1.0);
}

// Where a particle's place lies on the globe, length 1.
fn normal_of(particle: Particle) -> vec3<f32> {
    let row = rows[particle.row];
    let col = cols[particle.slot];
    let lat = turned(row.sin_lat, row.cos_lat, (0.5 - particle.south) * row.lat_span_rad);
    let lon = turned(col.sin_lon, col.cos_lon, (particle.east - 0.5) * params.lon_span_rad);
    return vec3(lat.y * lon.x, lat.y * lon.y, lat.x);
}

// Share of direct light at a place: 0 on the night side, with dusk between.
fn day_at(normal: vec3<f32>) -> f32 {
    return smoothstep(-0.15, 0.35, dot(normal, vec3(params.sun_x, params.sun_y, params.sun_z)));
}

fn on_tile(particle: Particle) -> Splat {
    let row = rows[particle.row];
    let col = cols[particle.slot];
    let subpixels = f32(SUBPIXELS);
    var splat: Splat;
    let ground_y = row.y_sub + nearest(particle.south * row.y_span_px * subpixels);
    splat.x_sub = col.x_sub + nearest(particle.east * col.x_span_px * subpixels);
    splat.y_sub = ground_y - nearest(particle.height_m * params.height_px_per_m * subpixels);
    splat.light_u = splat.x_sub + nearest(particle.height_m * params.light_shift_x_per_m) + params.light_origin_x;
    splat.light_v = ground_y + nearest(particle.height_m * params.light_shift_y_per_m) + params.light_origin_y;
    let radius = row.radius * size_of(particle.color);
    splat.radius_px = clamp(radius, params.min_radius_px, params.max_radius_px);
    let thinned = row.radius / splat.radius_px;
    splat.tau = particle.depth * row.depth_gain * thinned * thinned;
    splat.light_depth = splat.tau * splat.radius_px * splat.radius_px * params.light_depth_gain;
    splat.slice = slice_of(particle.height_m);
    splat.day = 1.0;
    if (params.day_on == 1u) { splat.day = day_at(normal_of(particle)); }
    splat.color = particle.color;
    return splat;
}

fn on_globe(particle: Particle) -> Splat {
    let row = rows[particle.row];
    let normal = normal_of(particle);
    let distance = 1.0 + particle.height_m * params.per_earth_radius_m;
    let place = normal * distance;
    let camera = vec3(params.eye_x, params.eye_y, params.eye_z);
    let sight = place - camera;
    let ahead = dot(sight, vec3(params.forward_x, params.forward_y, params.forward_z));
    // Hidden if beyond the horizon of the sea surface, or of its own sphere when below it.
    let beyond = dot(normal, camera);
    let horizon = min(distance, 1.0);
    let camera_sq = dot(camera, camera);
    let grazing = sqrt(max(camera_sq - horizon * horizon, 0.0)) * sqrt(max(distance * distance - horizon * horizon, 0.0));
    var splat: Splat;
    if (ahead < 0.01 * (camera_sq - 1.0) || beyond * distance < horizon * horizon - grazing) { return splat; }
    let scale = params.focal_px / ahead;
    let x = dot(sight, vec3(params.right_x, params.right_y, params.right_z)) * scale + params.center_px_x;
    let y = params.center_px_y - dot(sight, vec3(params.up_x, params.up_y, params.up_z)) * scale;
    // A ball away from the middle of the picture is drawn as an ellipse, longer by 1 / cos; the disc has its area.
    let oblique = sqrt(length(sight) / ahead);
    let full_px = row.radius * scale * oblique;
    let radius_px = full_px * size_of(particle.color);
    if (max(abs(x), abs(y)) > 1.0e5 || radius_px > params.max_radius_px) { return splat; }
    splat.x_sub = nearest(x * f32(SUBPIXELS)) - params.origin_x_px * SUBPIXELS;
    splat.y_sub = nearest(y * f32(SUBPIXELS)) - params.origin_y_px * SUBPIXELS;
    splat.radius_px = max(radius_px, params.min_radius_px);
    let thinned = full_px / splat.radius_px;
    splat.tau = particle.depth * row.depth_gain * thinned * thinned;
    splat.light_depth = particle.depth * row.depth_gain * row.radius * row.radius * params.light_depth_gain;
    splat.slice = slice_of(dot(place, vec3(params.half_x, params.half_y, params.half_z)));
    let u = dot(place, vec3(params.light_u_x, params.light_u_y, params.light_u_z)) - params.light_u0;
    let v = dot(place, vec3(params.light_v_x, params.light_v_y, params.light_v_z)) - params.light_v0;
    splat.light_u = nearest(u * params.light_texels_per_unit * f32(params.light_unit));
    splat.light_v = nearest(v * params.light_texels_per_unit * f32(params.light_unit));
    splat.day = day_at(normal);
    splat.color = particle.color;
    return splat;
}

fn splat_of(particle: Particle) -> Splat {
    if (params.view == VIEW_TILE) { return on_tile(particle); }
    return on_globe(particle);
}
