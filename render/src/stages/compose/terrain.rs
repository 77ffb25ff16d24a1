//! CPU twin of `terrain.wgsl`: height and slope of the terrain at a place between cell centres.

use glam::{Vec2, Vec3};

use crate::stages::layout::{Axis, is_missing};
use crate::stages::params::Params;

/// East and west of a place so near a pole no slope is told: meridians meet.
const LEAST_COS_LAT: f32 = 0.02;

/// What is known of the ground at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Above the level of the sea.
    pub height_m: f32,
    /// Rise for each unit of way east and north, exaggerated.
    pub slope: Vec2,
}

fn cell(params: &Params, terrain: &[f32], row: i32, col: i32) -> f32 {
    let terrain_grid = &params.terrain_grid;
    let cols = terrain_grid.cols as i32;
    let x = if terrain_grid.periodic == 1 {
        col.rem_euclid(cols)
    } else {
        col.clamp(0, cols - 1)
    };
    let y = row.clamp(0, terrain_grid.rows as i32 - 1);
    terrain[y as usize * terrain_grid.cols as usize + x as usize]
}

fn is_inside(params: &Params, x: Axis, y: Axis) -> bool {
    let terrain_grid = &params.terrain_grid;
    let east = x.index as f32 + x.fraction + 0.5;
    let south = y.index as f32 + y.fraction + 0.5;
    let is_across = terrain_grid.periodic == 1 || (0.0..=terrain_grid.cols as f32).contains(&east);
    is_across && (0.0..=terrain_grid.rows as f32).contains(&south)
}

/// Bilinear height, and the gradient of Horn (1981), doi:10.1109/PROC.1981.11918, bilinear between the four cells round
/// the place; none outside the grid and where less than half the weight is on cells with data.
pub fn ground_at(
    params: &Params,
    terrain: &[f32],
    x: Axis,
    y: Axis,
    cos_lat: f32,
) -> Option<Ground> {
    if !is_inside(params, x, y) {
        return None;
    }
    let mut z: [f32; 16] = std::array::from_fn(|i| {
        let i = i as i32;
        cell(params, terrain, y.index - 1 + i / 4, x.index - 1 + i % 4)
    });
    let corners = [5, 6, 9, 10]
        .into_iter()
        .zip(shares(x.fraction, y.fraction));
    let (mut height, mut weight) = (0.0, 0.0);
    for (at, share) in corners.clone() {
        if !is_missing(z[at]) {
            height += z[at] * share;
            weight += share;
        }
    }
    if weight < 0.5 {
        return None;
    }
    let height_m = height / weight;
    for own in &mut z {
        if is_missing(*own) {
            *own = height_m;
        }
    }
    let mut rise = Vec2::ZERO;
    for (at, share) in corners {
        let east =
            (z[at - 3] + 2.0 * z[at + 1] + z[at + 5]) - (z[at - 5] + 2.0 * z[at - 1] + z[at + 3]);
        let north =
            (z[at - 5] + 2.0 * z[at - 4] + z[at - 3]) - (z[at + 3] + 2.0 * z[at + 4] + z[at + 5]);
        rise += Vec2::new(east, north) * share;
    }
    let per_rad = Vec2::new(
        params.terrain_grid.cols_per_rad / cos_lat.max(LEAST_COS_LAT),
        params.terrain_grid.rows_per_rad,
    );
    Some(Ground {
        height_m,
        slope: rise * per_rad * params.context.terrain_slope,
    })
}

/// Bilinear weights of the corners north-west, north-east, south-west and south-east.
fn shares(east: f32, south: f32) -> [f32; 4] {
    [
        (1.0 - east) * (1.0 - south),
        east * (1.0 - south),
        (1.0 - east) * south,
        east * south,
    ]
}

fn mix(a: Vec3, b: [f32; 3], t: f32) -> Vec3 {
    let t = t.clamp(0.0, 1.0);
    a * (1.0 - t) + Vec3::from(b) * t
}

/// Colour of a height: greens to pale rock above the sea, blues to the deep below.
pub fn tint(height_m: f32) -> Vec3 {
    if height_m < 0.0 {
        let shelf = Vec3::new(0.21, 0.36, 0.42);
        let sea = mix(shelf, [0.14, 0.28, 0.38], height_m / -200.0);
        let sea = mix(sea, [0.09, 0.20, 0.32], (height_m + 200.0) / -2300.0);
        let sea = mix(sea, [0.055, 0.13, 0.24], (height_m + 2500.0) / -2500.0);
        return mix(sea, [0.025, 0.06, 0.13], (height_m + 5000.0) / -4000.0);
    }
    let plain = Vec3::new(0.27, 0.35, 0.25);
    let land = mix(plain, [0.40, 0.44, 0.30], height_m / 300.0);
    let land = mix(land, [0.53, 0.49, 0.36], (height_m - 300.0) / 900.0);
    let land = mix(land, [0.50, 0.43, 0.36], (height_m - 1200.0) / 1800.0);
    mix(land, [0.80, 0.79, 0.78], (height_m - 3000.0) / 2500.0)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;
    use crate::stages::compose::params::ContextParams;
    use crate::stages::layout::MISSING;
    use crate::stages::params::GridParams;

    /// A grid of 8 x 8 cells of a tenth of a radian.
    fn params() -> Params {
        Params {
            terrain_grid: GridParams {
                rows: 8,
                cols: 8,
                cols_per_rad: 10.0,
                rows_per_rad: 10.0,
                ..GridParams::default()
            },
            context: ContextParams {
                terrain_slope: 1.0 / 8.0 / 1000.0,
                ..ContextParams::default()
            },
            ..Params::default()
        }
    }

    fn at(index: i32, fraction: f32) -> Axis {
        Axis { index, fraction }
    }

    #[test]
    fn a_plane_has_its_height_and_slope_everywhere() {
        // 30 m a cell up to the east, 20 m a cell up to the south.
        let plane: Vec<f32> = (0..64)
            .map(|i| (30 * (i % 8) + 20 * (i / 8)) as f32)
            .collect();
        for (x, y) in [(at(2, 0.0), at(3, 0.0)), (at(4, 0.25), at(2, 0.75))] {
            let ground = ground_at(&params(), &plane, x, y, 0.5).unwrap();
            let (east, south) = (x.index as f32 + x.fraction, y.index as f32 + y.fraction);
            assert!((ground.height_m - 30.0 * east - 20.0 * south).abs() < 1e-3);
            // 30 m over a tenth of 1000 m, half as wide at this latitude.
            assert!((ground.slope.x - 0.6).abs() < 1e-5, "{:?}", ground.slope);
            assert!((ground.slope.y - -0.2).abs() < 1e-5, "{:?}", ground.slope);
        }
    }

    #[test]
    fn beside_missing_cells_the_ground_is_level_and_within_them_unknown() {
        let mut flat = vec![100.0; 64];
        flat[3 * 8 + 3] = MISSING;
        let beside = ground_at(&params(), &flat, at(4, 0.0), at(3, 0.5), 1.0).unwrap();
        assert_eq!((beside.height_m, beside.slope), (100.0, Vec2::ZERO));
        assert_eq!(
            ground_at(&params(), &flat, at(3, 0.1), at(3, 0.1), 1.0),
            None
        );
        assert_eq!(
            ground_at(&params(), &flat, at(-2, 0.9), at(3, 0.0), 1.0),
            None
        );
        // To the very edge of the outermost cells.
        let corner = ground_at(&params(), &flat, at(-1, 0.5), at(7, 0.5), 1.0);
        assert_eq!(corner.unwrap().height_m, 100.0);
        let mut round = params();
        round.terrain_grid.periodic = 1;
        assert!(ground_at(&round, &flat, at(-1, 0.2), at(7, 0.5), 1.0).is_some());
    }

    #[test]
    fn higher_land_and_shallower_sea_are_lighter() {
        let light = |height_m: f32| tint(height_m).element_sum();
        let heights = [-11_000.0, -6000.0, -3000.0, -1000.0, -100.0, -1.0];
        assert!(
            heights
                .windows(2)
                .all(|pair| light(pair[0]) < light(pair[1]))
        );
        assert!(light(8000.0) > light(2000.0) && light(500.0) > light(1.0));
        assert!(tint(-1.0).z > tint(-1.0).x && tint(1.0).y > tint(1.0).z);
    }
}
