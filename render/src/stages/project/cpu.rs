//! CPU twin of `project.wgsl`.

use glam::{Vec2, Vec3};

use crate::stages::layout::{Col, Particle, Row, SUBPIXELS, SUNK_M, Splat, VIEW_TILE, nearest};
use crate::stages::params::Params;

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
        *splat = if params.view.kind == VIEW_TILE {
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
    ((params.projection.slice_top - coordinate) * params.projection.slices_per_unit)
        .clamp(0.0, params.view.slices as f32 - 0.001)
}

fn size_of(params: &Params, color: u32) -> f32 {
    1.0 + params.projection.size_spread * ((color >> 24) as f32 / 255.0 - 1.0)
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
        (particle.east - 0.5) * params.projection.lon_span_rad,
    );
    Vec3::new(lat.y * lon.x, lat.y * lon.y, lat.x)
}

/// Share of direct light at a place: 0 on the night side, with dusk between.
fn day_at(params: &Params, normal: Vec3) -> f32 {
    let sun = params.view.sun;
    smoothstep(-0.15, 0.35, normal.dot(sun))
}

fn on_tile(params: &Params, row: &Row, col: &Col, particle: &Particle) -> Splat {
    let projection = &params.projection;
    let subpixels = SUBPIXELS as f32;
    let ground_y = row.y_sub + nearest(particle.south * row.y_span_px * subpixels);
    let x_sub = col.x_sub + nearest(particle.east * col.x_span_px * subpixels);
    let radius = row.radius * size_of(params, particle.color);
    let radius_px = radius.clamp(projection.min_radius_px, projection.max_radius_px);
    let thinned = row.radius / radius_px;
    let tau = particle.depth * row.depth_gain * thinned * thinned;
    Splat {
        x_sub,
        y_sub: ground_y - nearest(particle.height_m * projection.height_px_per_m * subpixels),
        radius_px,
        tau,
        slice: slice_of(params, particle.height_m),
        light_u: x_sub
            + nearest(particle.height_m * projection.light_shift_per_m.x)
            + projection.light_origin.x,
        light_v: ground_y
            + nearest(particle.height_m * projection.light_shift_per_m.y)
            + projection.light_origin.y,
        light_depth: tau * radius_px * radius_px * projection.light_depth_gain,
        day: if projection.day_on == 1 {
            day_at(params, normal_of(params, row, col, particle))
        } else {
            1.0
        },
        color: particle.color,
        is_sunk: 0,
    }
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
    let (view, projection) = (&params.view, &params.projection);
    let normal = normal_of(params, row, col, particle);
    let distance = 1.0 + particle.height_m * projection.per_earth_radius_m;
    let place = normal * distance;
    let camera = view.eye;
    let sight = place - camera;
    let ahead = sight.dot(view.forward);
    let u = place.dot(projection.light_u) - projection.light_u0;
    let v = place.dot(projection.light_v) - projection.light_v0;
    let to_light = projection.light_texels_per_unit * params.lighting.unit as f32;
    // What is not seen still casts its shadow.
    let unseen = Splat {
        slice: slice_of(params, place.dot(projection.half)),
        light_u: nearest(u * to_light),
        light_v: nearest(v * to_light),
        light_depth: particle.depth
            * row.depth_gain
            * row.radius
            * row.radius
            * projection.light_depth_gain,
        day: day_at(params, normal),
        color: particle.color,
        ..Splat::default()
    };
    if ahead < 0.01 * (camera.dot(camera) - 1.0) || is_hidden(normal, distance, camera) {
        return unseen;
    }
    let scale = view.focal_px / ahead;
    let x = sight.dot(view.right) * scale + view.center_px.x;
    let y = view.center_px.y - sight.dot(view.up) * scale;
    let oblique = (sight.length() / ahead).sqrt();
    let full_px = row.radius * scale * oblique;
    let radius_px = full_px * size_of(params, particle.color);
    if x.abs().max(y.abs()) > 1.0e5 || radius_px > projection.max_radius_px {
        return unseen;
    }
    let radius_px = radius_px.max(projection.min_radius_px);
    let thinned = full_px / radius_px;
    Splat {
        x_sub: nearest(x * SUBPIXELS as f32) - view.origin_px.x * SUBPIXELS,
        y_sub: nearest(y * SUBPIXELS as f32) - view.origin_px.y * SUBPIXELS,
        radius_px,
        tau: particle.depth * row.depth_gain * thinned * thinned,
        is_sunk: u32::from(particle.height_m < -SUNK_M),
        ..unseen
    }
}

/// Hermite step from 0 at `low` to 1 at `high`, as WGSL defines it.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
