//! Colour along every sight line: depths exact, scattered light in short steps.

use std::thread;

use glam::DVec3;

use super::Fineness;
use super::cloud::Cloud;
use super::sky::Sky;
use super::space::{Ray, Space};
use crate::plan::Plan;

/// Screen tiles that clouds are sorted into, pixels a side.
const TILE_PX: u32 = 8;
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
            ambient: f64::from(plan.params.ambient),
            direct: f64::from(plan.params.direct),
        }
    }
}

/// Part of one cloud in one step of a sight line.
struct Piece {
    step: usize,
    depth: f64,
    color: DVec3,
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
        for (i, cloud) in (0u32..).zip(clouds) {
            let Some((place, reach)) = space
                .seen(cloud.center, cloud.radius)
                .filter(|_| cloud.is_seen)
            else {
                continue;
            };
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
        let mut rows: Vec<_> = (0..height).zip(picture.chunks_exact_mut(width as usize)).collect();
        let mut shares: Vec<Vec<_>> = (0..threads).map(|_| Vec::with_capacity(rows_each)).collect();
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

    fn pixel(&self, x: u32, y: u32) -> [f64; 4] {
        let list = &self.lists[(y / TILE_PX * self.tiles_x + x / TILE_PX) as usize];
        let ray = self.space.ray(x, y);
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
                    color: cloud.color,
                });
            }
        }
        pieces.sort_by_key(|piece| piece.step);
        self.along(ray, start, &pieces)
    }

    /// Light scattered towards the eye by the pieces of a sight line, in order from the eye.
    fn along(&self, ray: Ray, start: f64, pieces: &[Piece]) -> [f64; 4] {
        let (mut color, mut through) = (DVec3::ZERO, 1.0);
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
                .map(|piece| (piece.color * shade).min(DVec3::ONE) * piece.depth)
                .sum();
            let passing = (-depth).exp();
            color += lit / depth * (through * (1.0 - passing));
            through *= passing;
        }
        [color.x, color.y, color.z, 1.0 - through]
    }
}
