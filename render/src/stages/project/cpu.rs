//! CPU twin of `project.wgsl`.

use glam::{Vec2, Vec3};

use crate::stages::colour::{codes_of, with_codes};
use crate::stages::layout::{Col, Particle, Row, SUBPIXELS, Splat, VIEW_TILE, nearest};
use crate::stages::params::Params;
use crate::stages::water::{ceiling_light, is_submerged, kept_over, mix, water_light};

/// All of a colour is the particle's own: see [`Splat`].
const UNDIMMED: u32 = 0xff00_0000;

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

fn size_of(params: &Params, colour: u32) -> f32 {
    1.0 + params.projection.size_spread * ((colour >> 24) as f32 / 255.0 - 1.0)
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
    let radius = row.radius * size_of(params, particle.colour);
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
        colour: particle.colour | UNDIMMED,
        is_beyond: u32::from(-particle.height_m > projection.beyond_m),
        slope: 0,
    }
}

/// Is a place beyond the horizon of what hides (the sea surface; from below, the core), or of its own sphere when below it?
fn is_hidden(normal: Vec3, distance: f32, camera: Vec3, hides: f32) -> bool {
    let horizon = distance.min(hides);
    let camera_sq = camera.dot(camera);
    let grazing = (camera_sq - horizon * horizon).max(0.0).sqrt()
        * (distance * distance - horizon * horizon).max(0.0).sqrt();
    normal.dot(camera) * distance < horizon * horizon - grazing
}

/// A particle's colour as an eye below the sea surface sees it: through the surface from underneath where the particle lies
/// above it, and through the water. In the last byte is what is left of its own light.
fn through_sea(params: &Params, particle: &Particle, sight: Vec3, normal: Vec3) -> u32 {
    let view = &params.view;
    let way = sight.length();
    let toward = sight / way.max(1.0e-9);
    let nearest_at = -view.eye.dot(toward);
    let foot = view.eye + toward * nearest_at;
    let to_ceiling = nearest_at + (1.0 - foot.dot(foot)).max(0.0).sqrt();
    let codes = codes_of(particle.colour) / 255.0;
    let above = (particle.height_m / params.particles.sheet_m + 0.5).clamp(0.0, 1.0);
    let through = 1.0 - above + view.ceiling_kept * above;
    let ceiling = ceiling_light(params, normal.dot(view.sun));
    let seen = mix(ceiling, codes * codes, through);
    let left = kept_over(params, way.min(to_ceiling));
    let water = water_light(params, toward.dot(view.eye) / view.eye.length());
    let seen = mix(water, seen, left);
    let colour = with_codes(0, seen.map(f32::sqrt) * 255.0);
    colour | (nearest(through * left * 255.0) as u32) << 24
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
        colour: if is_submerged(params) {
            through_sea(params, particle, sight, normal)
        } else {
            particle.colour | UNDIMMED
        },
        ..Splat::default()
    };
    let least = 0.01 * (camera.dot(camera) - 1.0).abs();
    if ahead < least || is_hidden(normal, distance, camera, view.hides) {
        return unseen;
    }
    let scale = view.focal_px / ahead;
    let x = sight.dot(view.right) * scale + view.center_px.x;
    let y = view.center_px.y - sight.dot(view.up) * scale;
    let oblique = (sight.length() / ahead).sqrt();
    let full_px = row.radius * scale * oblique;
    let radius_px = full_px * size_of(params, particle.colour);
    if x.abs().max(y.abs()) > 1.0e5 || radius_px > projection.max_radius_px {
        return unseen;
    }
    let radius_px = radius_px.max(projection.min_radius_px);
    let thinned = full_px / radius_px;
    let beyond_m = if view.hides < 1.0 {
        particle.height_m
    } else {
        -particle.height_m
    };
    Splat {
        x_sub: nearest(x * SUBPIXELS as f32) - view.origin_px.x * SUBPIXELS,
        y_sub: nearest(y * SUBPIXELS as f32) - view.origin_px.y * SUBPIXELS,
        radius_px,
        tau: particle.depth * row.depth_gain * thinned * thinned,
        is_beyond: u32::from(beyond_m > projection.beyond_m),
        ..unseen
    }
}

/// Hermite step from 0 at `low` to 1 at `high`, as WGSL defines it.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
