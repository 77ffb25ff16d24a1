//! CPU twin of `globe.wgsl`: the plain globe and its air.

use std::f32::consts::{FRAC_2_PI, TAU};

use glam::{Vec3, Vec4};

use super::terrain;
use crate::stages::layout::{WATER_BLUE, WATER_GREEN, WATER_RED};
use crate::stages::params::Params;
use crate::stages::sphere::Ground;
use crate::stages::water::mix;

const HATCH_PX: i32 = 8;
const HATCH_LINE_PX: i32 = 2;
/// 8 / pi: along a level line the depth is that of an exponential atmosphere.
const LEVEL: f32 = 4.0 * FRAC_2_PI;
pub(super) const WATER: Vec3 = Vec3::new(WATER_RED, WATER_GREEN, WATER_BLUE);

fn sea_colour(params: &Params, floor: Option<&terrain::Ground>) -> Vec3 {
    let map = &params.base_map;
    match floor {
        _ if params.context.has_water == 1 => WATER,
        None => map.sea,
        Some(floor) => {
            let depth = (-floor.height_m / map.deep_m).clamp(0.0, 1.0);
            mix(map.shelf, map.deep, depth)
        }
    }
}

/// The plain globe in even light: land where land is, lakes in it, sea, hatched where the product has no data. `shares`
/// of the pixel are land and lake.
pub(super) fn plain(
    params: &Params,
    domain: &[u32],
    place: [f32; 2],
    shares: [f32; 2],
    floor: Option<&terrain::Ground>,
    pixel: [u32; 2],
) -> Vec3 {
    let map = &params.base_map;
    let mut sea = sea_colour(params, floor);
    if is_hatched(params, domain, place, pixel) {
        sea += map.hatch;
    }
    let height = floor.map_or(0.0, |floor| (floor.height_m / map.high_m).clamp(0.0, 1.0));
    let land = mix(map.land, map.land_high, height);
    mix(mix(sea, land, shares[0]), map.lake, shares[1])
}

/// Is a pixel on a line of the hatching, where the product has no data? `place`: longitude and latitude, radians.
pub(super) fn is_hatched(
    params: &Params,
    domain: &[u32],
    place: [f32; 2],
    pixel: [u32; 2],
) -> bool {
    let along = pixel[0] as i32 + pixel[1] as i32 + params.view.origin_px.element_sum();
    along % HATCH_PX < HATCH_LINE_PX && is_unsampled(params, domain, place)
}

fn is_unsampled(params: &Params, domain: &[u32], [lon_rad, lat_rad]: [f32; 2]) -> bool {
    let grid = &params.grid;
    let east = lon_rad - grid.west_rad;
    let col = ((east - (east / TAU).floor() * TAU) * grid.cols_per_rad).floor() as i32;
    let row = ((grid.north_rad - lat_rad) * grid.rows_per_rad).floor() as i32;
    let inside = row >= 0 && row < grid.rows as i32 && col < grid.cols as i32;
    inside && domain[row as usize * grid.cols as usize + col as usize] == 0
}

pub(super) fn sunlight(sun: f32) -> f32 {
    0.25 + sun.clamp(0.0, 1.0)
}

/// The same as the base map shows it.
pub(super) fn daylight(params: &Params, sun: f32) -> f32 {
    1.0 + params.base_map.sun_share * (sunlight(sun) - 1.0)
}

/// Optical depth of the air from a height, earth radii, outwards along a line whose cosine against the vertical is `up`:
/// of an exponential atmosphere whose curve is that of a parabola, with the bound of Abramowitz and Stegun (1964), 7.1.13,
/// for its error function, within 6 % of the sum along the line (docs/method.md).
pub fn air_above(params: &Params, height: f32, up: f32) -> f32 {
    let map = &params.base_map;
    let slant = 0.5 * (up + (up * up + LEVEL * map.air_height).sqrt());
    map.air_depth * (-height / map.air_height).exp() / slant
}

/// The same between the eye and what a pixel's sight line meets, or along all of it where it passes the globe.
pub fn air_along(params: &Params, ground: &Ground) -> f32 {
    let radius = params.view.eye.length();
    let down = ground.nearest_at / radius;
    let behind = air_above(params, (radius - 1.0).max(0.0), down.abs());
    if ground.on_ground {
        let toward = ground.normal - params.view.eye;
        let sight = toward / toward.length();
        return (air_above(params, 0.0, -sight.dot(ground.normal)) - behind).max(0.0);
    }
    if down <= 0.0 {
        return behind;
    }
    let grazed = air_above(params, (ground.foot.length() - 1.0).max(0.0), 0.0);
    (2.0 * grazed - behind).max(0.0)
}

pub(super) fn beside(params: &Params, ground: &Ground) -> Vec4 {
    let map = &params.base_map;
    let share = 1.0 - (-air_along(params, ground)).exp();
    let sun = ground.foot.dot(params.view.sun) / ground.foot.length().max(1.0e-6);
    let lit = map.air * daylight(params, sun);
    lit.extend(1.0) * share + map.sky.extend(1.0) * (map.sky_alpha * (1.0 - share))
}

pub(super) fn rim(params: &Params, ground: &Ground) -> Vec3 {
    let map = &params.base_map;
    let sun = ground.foot.dot(params.view.sun) / ground.foot.length().max(1.0e-6);
    let share = 1.0 - (-0.5 * air_along(params, ground)).exp();
    mix(map.sea, map.air, share) * daylight(params, sun)
}

pub(super) fn hazy(params: &Params, colour: Vec3, ground: &Ground) -> Vec3 {
    let lit = params.base_map.air * daylight(params, ground.normal.dot(params.view.sun));
    mix(colour, lit, 1.0 - (-air_along(params, ground)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::compose::base_map::BaseMapParams;
    use crate::stages::params::ViewParams;

    fn params(height: f32) -> Params {
        Params {
            view: ViewParams {
                eye: Vec3::new(0.0, 0.0, 1.0 + height),
                ..ViewParams::default()
            },
            base_map: BaseMapParams {
                air_depth: 0.04,
                air_height: 0.01,
                ..BaseMapParams::default()
            },
            ..Params::default()
        }
    }

    /// Depth of the air along a line from a place, summed up in double precision.
    fn summed(from: [f64; 2], toward: [f64; 2], length: f64) -> f64 {
        let steps = 400_000;
        let step = length / f64::from(steps);
        let density = |i: u32| {
            let along = (f64::from(i) + 0.5) * step;
            let place = [0, 1].map(|k| from[k] + toward[k] * along);
            (-(place[0].hypot(place[1]) - 1.0) / 0.01).exp()
        };
        // A vertical column has `air_depth`.
        (0..steps).map(density).sum::<f64>() * step * 0.04 / 0.01
    }

    #[test]
    fn the_air_past_the_globe_is_what_a_sum_along_the_line_comes_to() {
        let params = params(2.0);
        for height in [0.0, 0.01, 0.03, 0.06_f32] {
            let foot = 1.0 + height;
            let ground = Ground {
                foot: Vec3::new(foot, 0.0, 0.0),
                nearest_at: (9.0 - foot * foot).sqrt(),
                ..Ground::default()
            };
            let expected = summed([f64::from(foot), -4.0], [0.0, 1.0], 8.0);
            let found = f64::from(air_along(&params, &ground));
            assert!(
                (found / expected - 1.0).abs() < 0.05,
                "{height}: {found} {expected}"
            );
        }
    }

    #[test]
    fn the_air_before_the_ground_is_what_a_sum_along_the_line_comes_to() {
        for (cosine, within) in [
            (1.0, 0.01),
            (0.5, 0.03),
            (0.2, 0.05),
            (0.05, 0.06),
            (0.0, 0.02),
        ] {
            let (sine, params) = ((1.0_f64 - cosine * cosine).sqrt(), params(2.0));
            let found = f64::from(air_above(&params, 0.0, cosine as f32));
            let expected = summed([1.0, 0.0], [cosine, sine], 3.0);
            assert!(
                (found / expected - 1.0).abs() < within,
                "{cosine}: {found} {expected}"
            );
        }
        // An eye within the air has less of it before itself.
        let low = params(0.01);
        let ground = Ground {
            on_ground: true,
            normal: Vec3::Z,
            nearest_at: 1.01,
            ..Ground::default()
        };
        let share = air_along(&low, &ground) / air_along(&params(2.0), &ground);
        assert!((share - (1.0 - (-1.0_f32).exp())).abs() < 0.02, "{share}");
    }
}
