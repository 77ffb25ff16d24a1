//! Colour along every sight line: depths exact, scattered light in short steps.

use std::thread;

use render::plan::Plan;

use glam::{DVec2, DVec3};

use super::Fineness;
use super::cloud::Cloud;
use super::sky::Sky;
use super::space::{Ray, Space};

/// Screen tiles that clouds are sorted into, pixels a side.
const TILE_PX: u32 = 8;
/// Clouds with a smaller radius than this, pixels, are seen by several sight lines a pixel: one would meet some and miss
/// others.
const FINE_PX: f64 = 3.0;
/// Most sight lines across a pixel.
const MOST_SAMPLES: f64 = 3.0;
/// What lies behind less light than this is not seen in any number of bits that pictures have.
const DARK: f64 = 1e-7;

pub(super) struct Rays<'a> {
    clouds: &'a [Cloud],
    space: &'a Space,
    sky: &'a Sky<'a>,
    shade: Shade,
    size_px: [u32; 2],
    step: f64,
    tiles_x: u32,
    /// Sight lines across a pixel.
    samples: u32,
    /// Clouds seen in a screen tile, row by row.
    lists: Vec<Vec<u32>>,
}

/// Light that reaches everything, and direct light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shade {
    pub(super) ambient: f64,
    pub(super) direct: f64,
}

impl Shade {
    pub(super) fn of(plan: &Plan) -> Self {
        Self {
            ambient: f64::from(plan.params.lighting.ambient),
            direct: f64::from(plan.params.lighting.direct),
        }
    }
}

/// Part of one cloud in one step of a sight line.
struct Piece {
    step: usize,
    depth: f64,
    colour: DVec3,
}

impl<'a> Rays<'a> {
    pub(super) fn new(
        sky: &'a Sky<'a>,
        shade: Shade,
        size_px: [u32; 2],
        fineness: Fineness,
    ) -> Self {
        let (clouds, space) = (sky.clouds(), sky.space());
        let [tiles_x, tiles_y] = size_px.map(|px| px.div_ceil(TILE_PX));
        let mut lists = vec![vec![]; (tiles_x * tiles_y) as usize];
        let mut least_px = f64::INFINITY;
        for (i, cloud) in (0u32..).zip(clouds) {
            let Some((place, reach)) = space
                .seen(cloud.center, cloud.radius)
                .filter(|_| cloud.is_seen)
            else {
                continue;
            };
            least_px = least_px.min(reach);
            let range = |place: f64, tiles: u32| {
                let tile = |edge: f64| (edge / f64::from(TILE_PX)).clamp(0.0, f64::from(tiles));
                tile(place - reach).floor() as u32..tile(place + reach).ceil() as u32
            };
            for y in range(place.y, tiles_y) {
                for x in range(place.x, tiles_x) {
                    lists[(y * tiles_x + x) as usize].push(i);
                }
            }
        }
        let smallest = clouds
            .iter()
            .map(|cloud| cloud.radius)
            .fold(f64::INFINITY, f64::min);
        Self {
            clouds,
            space,
            sky,
            shade,
            size_px,
            step: smallest / f64::from(fineness.steps_per_radius.max(1)),
            tiles_x,
            samples: (FINE_PX / least_px).ceil().clamp(1.0, MOST_SAMPLES) as u32,
            lists,
        }
    }

    /// All pixels; the same on any number of threads.
    pub(super) fn picture(&self) -> Vec<[f64; 4]> {
        let [width, height] = self.size_px;
        let mut picture = vec![[0.0; 4]; width as usize * height as usize];
        let threads = thread::available_parallelism().map_or(1, usize::from);
        let rows_each = (height as usize).div_ceil(threads).max(1);
        // Neighbouring rows cost alike, so every thread takes each so many rows.
        let mut rows: Vec<_> = (0..height)
            .zip(picture.chunks_exact_mut(width as usize))
            .collect();
        let mut shares: Vec<Vec<_>> = (0..threads)
            .map(|_| Vec::with_capacity(rows_each))
            .collect();
        for (i, row) in rows.drain(..).enumerate() {
            shares[i % threads].push(row);
        }
        thread::scope(|scope| {
            for share in shares {
                scope.spawn(move || {
                    for (y, row) in share {
                        for (x, pixel) in (0..width).zip(row) {
                            *pixel = self.pixel(x, y);
                        }
                    }
                });
            }
        });
        picture
    }

    /// The mean over the sight lines of a pixel.
    fn pixel(&self, x: u32, y: u32) -> [f64; 4] {
        let list = &self.lists[(y / TILE_PX * self.tiles_x + x / TILE_PX) as usize];
        let corner = DVec2::new(f64::from(x), f64::from(y));
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(self.samples);
        let offsets = (0..self.samples * self.samples)
            .map(|i| DVec2::new(share(i % self.samples), share(i / self.samples)));
        let seen = offsets.map(|offset| self.seen(list, self.space.ray(corner + offset)));
        let sum = seen.fold([0.0; 4], |sum, colour| {
            [0, 1, 2, 3].map(|i| sum[i] + colour[i])
        });
        sum.map(|channel| channel / f64::from(self.samples * self.samples))
    }

    fn seen(&self, list: &[u32], ray: Ray) -> [f64; 4] {
        let mut met = vec![];
        let (mut start, mut end) = (f64::INFINITY, f64::NEG_INFINITY);
        for cloud in list.iter().map(|&i| &self.clouds[i as usize]) {
            let toward = cloud.center - ray.start;
            let along = toward.dot(ray.ahead);
            let miss_sq = toward.length_squared() - along * along;
            let half_sq = cloud.radius * cloud.radius - miss_sq;
            if half_sq > 0.0 {
                let half = half_sq.sqrt();
                (start, end) = (start.min(along - half), end.max(along + half));
                met.push((cloud, along, half, miss_sq));
            }
        }
        let mut pieces = vec![];
        for (cloud, along, half, miss_sq) in met {
            let first = ((along - half - start) / self.step) as usize;
            let last = ((along + half - start) / self.step) as usize;
            for step in first..=last {
                let from = start + step as f64 * self.step;
                let depth = cloud.depth_between(from - along, from + self.step - along, miss_sq);
                pieces.push(Piece {
                    step,
                    depth,
                    colour: cloud.colour,
                });
            }
        }
        pieces.sort_by_key(|piece| piece.step);
        self.along(ray, start, &pieces)
    }

    /// Light scattered towards the eye by the pieces of a sight line, in order from the eye.
    fn along(&self, ray: Ray, start: f64, pieces: &[Piece]) -> [f64; 4] {
        let (mut colour, mut through) = (DVec3::ZERO, 1.0);
        for pieces in pieces.chunk_by(|a, b| a.step == b.step) {
            let depth: f64 = pieces.iter().map(|piece| piece.depth).sum();
            if depth <= 0.0 {
                continue;
            }
            if through < DARK {
                through = 0.0;
                break;
            }
            let middle = start + (pieces[0].step as f64 + 0.5) * self.step;
            let place = ray.start + ray.ahead * middle;
            let shade = self.shade.ambient
                + self.shade.direct * self.sky.light(place) * self.space.day(place);
            // A cloud saturates in the light by itself: white does not become whiter.
            let lit: DVec3 = pieces
                .iter()
                .map(|piece| (piece.colour * shade).min(DVec3::ONE) * piece.depth)
                .sum();
            let passing = (-depth).exp();
            colour += lit / depth * (through * (1.0 - passing));
            through *= passing;
        }
        [colour.x, colour.y, colour.z, 1.0 - through]
    }
}

#[cfg(test)]
mod tests {
    use contract::job::{RenderJob, View};

    use super::*;

    /// Two thousand kilometres above 0 N 0 E, the sun straight above as well.
    fn space() -> Space {
        let mut job: RenderJob = crate::ocean::job(View::Globe {
            lon_deg: 0.0,
            lat_deg: 0.0,
            height_m: 2.0e6,
            width_px: 9,
            height_px: 9,
            angles: contract::camera::CameraAngles::NADIR,
        });
        job.style.sun.elevation_deg = 90.0;
        Space::of(&job)
    }

    fn cloud(space: &Space, height_m: f64, depth: f64, colour: DVec3) -> Cloud {
        Cloud {
            center: space.place(0.0, 0.0, 0.0, height_m),
            radius: 0.01,
            depth,
            colour,
            is_seen: true,
        }
    }

    fn middle(space: &Space, clouds: &[Cloud], steps_per_radius: u32) -> [f64; 4] {
        let sky = Sky::new(clouds, space);
        let shade = Shade {
            ambient: 0.5,
            direct: 0.25,
        };
        let rays = Rays::new(&sky, shade, [9, 9], Fineness { steps_per_radius });
        let all: Vec<u32> = (0..).zip(clouds).map(|(i, _)| i).collect();
        rays.seen(&all, space.ray(DVec2::splat(4.5)))
    }

    #[test]
    fn one_cloud_lit_from_the_eye_has_the_colour_of_its_closed_form() {
        let space = space();
        let depth = 1.3;
        let white = cloud(&space, 0.0, depth, DVec3::ONE);
        let [r, g, b, alpha] = middle(&space, &[white], 64);
        assert!((alpha - (1.0 - f64::exp(-depth))).abs() < 1e-9);
        // Sum of exp(-t) (0.5 + 0.25 exp(-0.6 t)) over depths t from 0 to 1.3.
        let expected = 0.5 * (1.0 - f64::exp(-depth)) + 0.25 * (1.0 - f64::exp(-1.6 * depth)) / 1.6;
        for channel in [r, g, b] {
            assert!(
                (channel - expected).abs() < 1e-5,
                "{channel} against {expected}"
            );
        }
    }

    #[test]
    fn what_is_nearer_hides_and_shadows_what_is_farther() {
        let space = space();
        let (red, blue) = (DVec3::X, DVec3::Z);
        let high = cloud(&space, 300_000.0, 2.0, red);
        let low = cloud(&space, 0.0, 2.0, blue);
        let [r, _, b, alpha] = middle(&space, &[low, high], 32);
        assert!((alpha - (1.0 - f64::exp(-4.0))).abs() < 1e-9);
        let own =
            |over: f64| 0.5 * (1.0 - f64::exp(-2.0)) + over * 0.25 * (1.0 - f64::exp(-3.2)) / 1.6;
        assert!((r - own(1.0)).abs() < 1e-4, "{r}");
        let behind = f64::exp(-2.0) * own(f64::exp(-1.2));
        assert!((b - behind).abs() < 1e-4, "{b} against {behind}");
    }
}
