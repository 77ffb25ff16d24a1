//! Where the particles of a regional product can be: light and slices of a globe view need not reach beyond.

use contract::grid::Grid;
use glam::DVec3;

use super::camera::axes_at;

/// Widest region whose extent is looked at, degrees: what goes farther round has places everywhere in most views.
const MOST_WIDTH_DEG: f64 = 120.0;
/// Steps along a side of the grid between places that are looked at.
const STEPS: u32 = 64;

/// Places at the lowest and the highest particles of a region; earth radii. All of it, seen or not: what is seen changes
/// place by place as the camera moves, and light and slices must not jump.
pub(super) struct Extent {
    places: Vec<DVec3>,
    /// What lies between two places is no farther out than this.
    sag: f64,
}

impl Extent {
    /// That of a grid between two heights; none if it is not a region.
    pub(super) fn of(grid: &Grid, heights: [f64; 2]) -> Option<Self> {
        let [width_deg, height_deg] = [
            f64::from(grid.cols) * grid.dlon_deg,
            f64::from(grid.rows) * grid.dlat_deg,
        ];
        if width_deg > MOST_WIDTH_DEG {
            return None;
        }
        let step_rad = (width_deg.max(height_deg) / f64::from(STEPS)).to_radians();
        let share = |step: u32| f64::from(step) / f64::from(STEPS);
        let places = (0..=STEPS).flat_map(|y| (0..=STEPS).map(move |x| (x, y)));
        let places = places.map(|(x, y)| {
            let lat_deg = grid.north_deg - share(y) * height_deg;
            let [_east, _north, normal] = axes_at(
                grid.west_deg + share(x) * width_deg,
                lat_deg.clamp(-90.0, 90.0),
            );
            normal
        });
        let places: Vec<DVec3> = places
            .flat_map(|normal| heights.map(|height| normal * (1.0 + height)))
            .collect();
        let sag = step_rad * step_rad / 4.0 * (1.0 + heights[1]) + 1e-6;
        Some(Self { places, sag })
    }

    /// Places all over the region.
    pub(super) fn places(&self) -> impl Iterator<Item = DVec3> {
        self.places.iter().copied()
    }

    /// Least and largest coordinate of the region along a direction.
    pub(super) fn along(&self, direction: DVec3) -> [f64; 2] {
        let reach = self.places.iter().map(|place| place.dot(direction));
        let [low, high] = reach.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
            [low.min(at), high.max(at)]
        });
        [low - self.sag, high + self.sag]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Grid = Grid {
        rows: 41,
        cols: 30,
        north_deg: 41.0,
        west_deg: 100.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn every_place_of_a_region_is_within_its_extent_and_little_else() {
        let [_, _, up] = axes_at(110.0, 10.0);
        let heights = [-0.02, 0.1];
        let extent = Extent::of(&REGION, heights).unwrap();
        let [_, east, _] = axes_at(37.0, 12.0);
        for direction in [up, east, DVec3::Z, -DVec3::X] {
            let [low, high] = extent.along(direction);
            let [mut least, mut most] = [f64::INFINITY, f64::NEG_INFINITY];
            for step in 0..300 * 410 {
                let (x, y) = (step % 300, step / 300);
                let [_, _, normal] =
                    axes_at(100.05 + f64::from(x) * 0.1, 40.95 - f64::from(y) * 0.1);
                for height in heights {
                    let at = normal.dot(direction) * (1.0 + height);
                    assert!((low..=high).contains(&at));
                    (least, most) = (least.min(at), most.max(at));
                }
            }
            assert!(least - low < 0.01 && high - most < 0.01);
        }
    }

    #[test]
    fn the_globe_has_no_extent() {
        let globe = Grid {
            cols: 360,
            ..REGION
        };
        assert!(Extent::of(&globe, [0.0, 0.1]).is_none());
    }
}
