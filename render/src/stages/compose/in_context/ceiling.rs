//! CPU twin of `ceiling.wgsl`: what an eye below the sea surface sees behind the particles.

use glam::{Vec3, Vec4};

use super::{Spot, Surroundings, coast_colour, ground_mask, over, surface_lines, trail_colour};
use crate::stages::compose::globe::{daylight, plain};
use crate::stages::params::Params;
use crate::stages::water::{kept_over, mix, water_light};

fn water_before(params: &Params, spot: &Spot) -> Vec3 {
    let eye = params.view.eye;
    water_light(params, spot.ground.sight.dot(eye) / eye.length())
}

/// The surface; a map lies on it, and lines on that.
fn ceiling_colour(
    params: &Params,
    around: &Surroundings<'_>,
    spot: &Spot,
    pixel: [u32; 2],
    blended: Vec4,
) -> Vec4 {
    let ground = &spot.ground;
    let mut seen = Vec4::ZERO;
    if params.context.surface == 1 {
        let [land, lake, ..] = ground_mask(params, around.coast, pixel);
        let place = [ground.lon_rad, ground.lat_rad];
        let colour = plain(params, around.domain, place, [land, lake], None, pixel);
        seen = (colour * daylight(params, spot.sun.z)).extend(1.0);
    }
    if params.context.coast_above == 1 {
        seen = blended + seen * (1.0 - blended.w);
    }
    seen = over(trail_colour(params, around.trails, pixel), seen, true);
    let [isoline, graticule] = surface_lines(params, around, pixel, 0.0);
    seen = over(isoline, over(graticule, seen, true), true);
    seen = over(
        coast_colour(params, around.coast, spot, pixel, 0.0),
        seen,
        true,
    );
    let water = water_before(params, spot) * seen.w;
    mix(water, seen.truncate(), kept_over(params, ground.way)).extend(seen.w)
}

/// The core, where a globe is drawn.
fn deep_colour(params: &Params, spot: &Spot) -> Vec4 {
    if params.context.surface == 0 {
        return Vec4::ZERO;
    }
    let (foot, hides) = (spot.ground.foot, params.view.hides);
    let way = spot.ground.nearest_at - (hides * hides - foot.dot(foot)).max(0.0).sqrt();
    let water = water_before(params, spot);
    mix(water, params.view.deep, kept_over(params, way)).extend(1.0)
}

pub(super) fn from_below(
    params: &Params,
    surroundings: &Surroundings<'_>,
    spot: &Spot,
    pixel: [u32; 2],
    blended: Vec4,
) -> Vec4 {
    let mut around = Vec4::ZERO;
    if spot.cover > 0.0 {
        around = ceiling_colour(params, surroundings, spot, pixel, blended) * spot.cover;
    }
    if spot.cover < 1.0 {
        around += deep_colour(params, spot) * (1.0 - spot.cover);
    }
    if params.context.coast_above == 1 {
        return around;
    }
    blended + around * (1.0 - blended.w)
}
