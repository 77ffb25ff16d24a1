//! CPU twin of `project.wgsl`.

use glam::{Vec2, Vec3};

use crate::stages::layout::{Col, Params, Particle, Row, SUBPIXELS, Splat, VIEW_TILE, nearest};

/// Half a cell beyond which the series for small angles is not good enough.
const WIDE_CELL_RAD: f32 = 0.2;

/// One splat a particle.
pub fn project(
    params: &Params,
    rows: &[Row],
    cols: &[Col],
    particles: &[Particle],
    splats: &mut [Splat],
) {
    for (splat, particle) in splats.iter_mut().zip(particles) {
        let (row, col) = (&rows[particle.row as usize], &cols[particle.slot as usize]);
        *splat = if params.view == VIEW_TILE {
            on_tile(params, row, col, particle)
        } else {
            on_globe(params, row, col, particle)
        };
    }
}

/// Sine and cosine of a small angle added to one with known sine and cosine.
pub fn turned(sin_a: f32, cos_a: f32, delta: f32) -> Vec2 {
    if delta.abs() > WIDE_CELL_RAD {
        let (s, c) = delta.sin_cos();
        return Vec2::new(sin_a * c + cos_a * s, cos_a * c - sin_a * s);
    }
    let d2 = delta * delta;
    let s = delta * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0));
    let c = 1.0 - d2 / 2.0 * (1.0 - d2 / 12.0);
    Vec2::new(sin_a * c + cos_a * s, cos_a * c - sin_a * s)
}

fn slice_of(params: &Params, coordinate: f32) -> f32 {
    ((params.slice_top - coordinate) * params.slices_per_unit)
        .clamp(0.0, params.slices as f32 - 0.001)
}

fn size_of(params: &Params, color: u32) -> f32 {
    1.0 + params.size_spread * ((color >> 24) as f32 / 255.0 - 1.0)
}

/// Where a particle's place lies on the globe, length 1.
fn normal_of(params: &Params, row: &Row, col: &Col, particle: &Particle) -> Vec3 {
    let lat = turned(
        row.sin_lat,
        row.cos_lat,
        (0.5 - particle.south) * row.lat_span_rad,
    );
    let lon = turned(
        col.sin_lon,
        col.cos_lon,
        (particle.east - 0.5) * params.lon_span_rad,
    );
    Vec3::new(lat.y * lon.x, lat.y * lon.y, lat.x)
}

/// Share of direct light at a place: 0 on the night side, with dusk between.
fn day_at(params: &Params, normal: Vec3) -> f32 {
    let sun = vector(params.sun_x, params.sun_y, params.sun_z);
    smoothstep(-0.15, 0.35, normal.dot(sun))
}

fn on_tile(params: &Params, row: &Row, col: &Col, particle: &Particle) -> Splat {
    let subpixels = SUBPIXELS as f32;
    let ground_y = row.y_sub + nearest(particle.south * row.y_span_px * subpixels);
    let x_sub = col.x_sub + nearest(particle.east * col.x_span_px * subpixels);
    let radius = row.radius * size_of(params, particle.color);
    let radius_px = radius.clamp(params.min_radius_px, params.max_radius_px);
    let thinned = row.radius / radius_px;
    let tau = particle.depth * row.depth_gain * thinned * thinned;
    Splat {
        x_sub,
        y_sub: ground_y - nearest(particle.height_m * params.height_px_per_m * subpixels),
        radius_px,
        tau,
        slice: slice_of(params, particle.height_m),
        light_u: x_sub
            + nearest(particle.height_m * params.light_shift_x_per_m)
            + params.light_origin_x,
        light_v: ground_y
            + nearest(particle.height_m * params.light_shift_y_per_m)
            + params.light_origin_y,
        light_depth: tau * radius_px * radius_px * params.light_depth_gain,
        day: if params.day_on == 1 {
            day_at(params, normal_of(params, row, col, particle))
        } else {
            1.0
        },
        color: particle.color,
    }
}

fn vector(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Is a place beyond the horizon of the sea surface, or of its own sphere when below it?
fn is_hidden(normal: Vec3, distance: f32, camera: Vec3) -> bool {
    let horizon = distance.min(1.0);
    let camera_sq = camera.dot(camera);
    let grazing = (camera_sq - horizon * horizon).max(0.0).sqrt()
        * (distance * distance - horizon * horizon).max(0.0).sqrt();
    normal.dot(camera) * distance < horizon * horizon - grazing
}

fn on_globe(params: &Params, row: &Row, col: &Col, particle: &Particle) -> Splat {
    let normal = normal_of(params, row, col, particle);
    let distance = 1.0 + particle.height_m * params.per_earth_radius_m;
    let place = normal * distance;
    let camera = vector(params.eye_x, params.eye_y, params.eye_z);
    let sight = place - camera;
    let ahead = sight.dot(vector(params.forward_x, params.forward_y, params.forward_z));
    if ahead < 0.01 * (camera.dot(camera) - 1.0) || is_hidden(normal, distance, camera) {
        return Splat::default();
    }
    let scale = params.focal_px / ahead;
    let x = sight.dot(vector(params.right_x, params.right_y, params.right_z)) * scale
        + params.center_px_x;
    let y = params.center_px_y - sight.dot(vector(params.up_x, params.up_y, params.up_z)) * scale;
    let oblique = (sight.length() / ahead).sqrt();
    let full_px = row.radius * scale * oblique;
    let radius_px = full_px * size_of(params, particle.color);
    if x.abs().max(y.abs()) > 1.0e5 || radius_px > params.max_radius_px {
        return Splat::default();
    }
    let radius_px = radius_px.max(params.min_radius_px);
    let thinned = full_px / radius_px;
    let u =
        place.dot(vector(params.light_u_x, params.light_u_y, params.light_u_z)) - params.light_u0;
    let v =
        place.dot(vector(params.light_v_x, params.light_v_y, params.light_v_z)) - params.light_v0;
    let to_light = params.light_texels_per_unit * params.light_unit as f32;
    Splat {
        x_sub: nearest(x * SUBPIXELS as f32) - params.origin_x_px * SUBPIXELS,
        y_sub: nearest(y * SUBPIXELS as f32) - params.origin_y_px * SUBPIXELS,
        radius_px,
        tau: particle.depth * row.depth_gain * thinned * thinned,
        slice: slice_of(
            params,
            place.dot(vector(params.half_x, params.half_y, params.half_z)),
        ),
        light_u: nearest(u * to_light),
        light_v: nearest(v * to_light),
        light_depth: particle.depth
            * row.depth_gain
            * row.radius
            * row.radius
            * params.light_depth_gain,
        day: day_at(params, normal),
        color: particle.color,
    }
}

/// Hermite step from 0 at `low` to 1 at `high`, as WGSL defines it.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
