//! How much of the sun's light comes to a place: the exact optical depth of all clouds between it and the sun.

use glam::DVec3;

use super::cloud::Cloud;
use super::space::Space;

/// Clouds by where they are seen from the sun.
pub(super) struct Sky<'a> {
    clouds: &'a [Cloud],
    space: &'a Space,
    /// Across the beam of light.
    across: [DVec3; 2],
    /// Side of a bin.
    side: f64,
    origin: [f64; 2],
    bins: [usize; 2],
    /// Clouds that reach into a bin, bins row by row.
    lists: Vec<Vec<u32>>,
}

impl<'a> Sky<'a> {
    pub(super) fn new(clouds: &'a [Cloud], space: &'a Space) -> Self {
        let aside = if space.sun.z.abs() < 0.9 {
            DVec3::Z
        } else {
            DVec3::X
        };
        let east = space.sun.cross(aside);
        let east = east / east.length();
        let across = [east, space.sun.cross(east)];
        // Bins as wide as a cloud hold few clouds that a beam through them misses.
        let side = clouds.iter().map(|cloud| cloud.radius).fold(1e-9, f64::max);
        let reach = |axis: usize| {
            let places = clouds.iter().map(|cloud| cloud.center.dot(across[axis]));
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place - side), high.max(place + side)]
            })
        };
        let reaches = [reach(0), reach(1)];
        let bins = reaches.map(|[low, high]| ((high - low).max(0.0) / side) as usize + 1);
        let mut sky = Self {
            clouds,
            space,
            across,
            side,
            origin: reaches.map(|[low, _]| low),
            bins,
            lists: vec![vec![]; bins[0] * bins[1]],
        };
        for (i, cloud) in (0u32..).zip(clouds) {
            let [xs, ys] = [0, 1].map(|axis| {
                let place = cloud.center.dot(across[axis]) - sky.origin[axis];
                let [low, high] = [place - cloud.radius, place + cloud.radius]
                    .map(|edge| (edge / side).max(0.0) as usize);
                low..(high + 1).min(bins[axis])
            });
            for y in ys {
                for x in xs.clone() {
                    sky.lists[y * bins[0] + x].push(i);
                }
            }
        }
        sky
    }

    pub(super) fn clouds(&self) -> &'a [Cloud] {
        self.clouds
    }

    pub(super) fn space(&self) -> &'a Space {
        self.space
    }

    /// Share of the light that comes through.
    pub(super) fn light(&self, place: DVec3) -> f64 {
        let bin = [0, 1].map(|axis| {
            let at = (place.dot(self.across[axis]) - self.origin[axis]) / self.side;
            (at >= 0.0 && at < self.bins[axis] as f64).then_some(at as usize)
        });
        let [Some(x), Some(y)] = bin else {
            return 1.0;
        };
        let mut depth = 0.0;
        for &i in &self.lists[y * self.bins[0] + x] {
            let cloud = &self.clouds[i as usize];
            let toward = cloud.center - place;
            let along = toward.dot(self.space.sun);
            if along > -cloud.radius {
                let miss_sq = toward.length_squared() - along * along;
                depth += cloud.depth_between(-along, cloud.radius, miss_sq);
            }
        }
        (-self.space.light_depth * depth).exp()
    }
}
