//! What lies in every pixel of a globe view, by the outlines of land, lakes and borders: exact shares of areas, and lines.

mod by_band;
mod sight;

use std::cell::RefCell;

use glam::DVec2;
use rayon::prelude::*;

use by_band::{BAND_PX, ByBand};
use sight::{Covered, Line, Sight};

use super::camera::Camera;
use crate::coast::ring::{BORDERS, Border, LAKE_RINGS, LAND_RINGS, Ring};
use crate::coast::{Cover, Mask};

/// What is wanted of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) land: bool,
    pub(super) coasts: bool,
    pub(super) borders: bool,
}

/// A word for every pixel: shares of land, lakes, shores and borders, 0 to 255, the first in the lowest bits. Made on all
/// cores, band by band: a camera that moves needs one for every picture. The same words however many cores there are,
/// whatever was in the memory that is given for them.
pub(super) fn mask(
    camera: &Camera,
    size_px: [u32; 2],
    wanted: Wanted,
    words: Vec<u32>,
) -> Vec<u32> {
    let all = Ground {
        land: &LAND_RINGS,
        lakes: &LAKE_RINGS,
        borders: &BORDERS,
    };
    all.mask(camera, size_px, wanted, words)
}

/// What is on the ground.
struct Ground<'a> {
    land: &'a [Ring],
    lakes: &'a [Ring],
    borders: &'a [Border],
}

impl Ground<'_> {
    fn mask(
        &self,
        camera: &Camera,
        size_px: [u32; 2],
        wanted: Wanted,
        mut words: Vec<u32>,
    ) -> Vec<u32> {
        let sight = &Sight::new(camera, size_px);
        let outlines = |rings| {
            wanted
                .land
                .then(|| Outlines::of(&sight.outlines(rings), size_px[1]))
        };
        let lines = |lines: Vec<Line>| ByBand::of(&lines, size_px[1], reached_px);
        let ((land, lakes), (shores, borders)) = rayon::join(
            || rayon::join(|| outlines(self.land), || outlines(self.lakes)),
            || {
                rayon::join(
                    || {
                        wanted
                            .coasts
                            .then(|| lines(sight.shores(self.land, self.lakes)))
                    },
                    || wanted.borders.then(|| lines(sight.borders(self.borders))),
                )
            },
        );
        let areas = [(land, 0), (lakes, 8)];
        let lines = [(shores, 16), (borders, 24)];
        let [width, height] = size_px.map(|px| px as usize);
        words.resize(width * height, 0);
        let bands = words.par_chunks_mut(BAND_PX * width).enumerate();
        bands.for_each(|(number, words)| {
            words.fill(0);
            let first_row = (number * BAND_PX) as u32;
            let size_px = [size_px[0], (words.len() / width) as u32];
            SUMS.with_borrow_mut(|sums| {
                for (outlines, shift) in &areas {
                    let Some(outlines) = outlines else {
                        continue;
                    };
                    let mut cover = Cover::within(std::mem::take(sums), first_row, size_px);
                    cover.add_everywhere(outlines.everywhere);
                    for [a, b] in outlines.edges.of_band(number) {
                        cover.add_edge(*a, *b);
                    }
                    cover.write(words, *shift);
                    *sums = cover.into_memory();
                }
            });
            for (lines, shift) in &lines {
                let lines = lines
                    .as_ref()
                    .map_or(&[][..], |lines| lines.of_band(number));
                if lines.is_empty() {
                    continue;
                }
                let mut mask = Mask::new([0.0, f64::from(first_row)], size_px);
                for (pen, [a, b]) in lines {
                    mask.draw(*pen, *a, *b);
                }
                mask.write(words, *shift);
            }
        });
        words
    }
}

/// What outlines cover together.
struct Outlines {
    /// All of the picture, so many times.
    everywhere: i32,
    edges: ByBand<[DVec2; 2]>,
}

impl Outlines {
    fn of(covered: &[Covered], height_px: u32) -> Self {
        let edges: Vec<_> = covered
            .iter()
            .flat_map(|one| one.edges.iter().copied())
            .collect();
        Self {
            everywhere: covered.iter().map(|one| one.everywhere).sum(),
            edges: ByBand::of(&edges, height_px, |[a, b]| [a.y.min(b.y), a.y.max(b.y)]),
        }
    }
}

/// Rows that a line reaches, pixels.
fn reached_px((pen, [a, b]): &Line) -> [f64; 2] {
    let reach_px = pen.reach_px() + 1.0;
    [a.y.min(b.y) - reach_px, a.y.max(b.y) + reach_px]
}

thread_local! {
    /// Memory for the sums of one band: fresh memory costs more than what is done in it.
    static SUMS: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

#[cfg(test)]
mod tests {
    use contract::camera::CameraAngles;
    use contract::job::View;

    use super::*;

    /// Is the middle of a pixel on the globe?
    fn is_on_globe(camera: &Camera, size_px: [u32; 2], at: usize) -> bool {
        let place = DVec2::new(
            f64::from(at as u32 % size_px[0]) + 0.5,
            f64::from(at as u32 / size_px[0]) + 0.5,
        );
        let [east, south] = (place - DVec2::from(size_px.map(f64::from)) / 2.0).to_array();
        let ray = camera.forward * camera.focal_px + camera.right * east - camera.top * south;
        let along = camera.place.dot(ray / ray.length());
        along < 0.0 && along * along > camera.place.length_squared() - 1.0
    }

    #[test]
    fn where_a_run_lies_decides_as_all_of_its_edges_do() {
        let single = |rings: &[Ring]| rings.iter().map(Ring::in_single_edges).collect::<Vec<_>>();
        let (land, lakes) = (single(&LAND_RINGS), single(&LAKE_RINGS));
        let borders: Vec<_> = BORDERS.iter().map(Border::in_single_edges).collect();
        let edge_by_edge = Ground {
            land: &land,
            lakes: &lakes,
            borders: &borders,
        };
        let wanted = Wanted {
            land: true,
            coasts: true,
            borders: true,
        };
        let size_px = [240, 135];
        // From afar, tilted low over coasts, at the pole, with Jamaica and with Eurasia opposite, and from below the sea.
        for (lon_deg, lat_deg, height_m, tilt_deg, heading_deg) in [
            (120.0, -10.0, 2e7, 0.0, 0.0),
            (-70.0, 20.0, 9e5, 60.0, 90.0),
            (170.0, 60.0, 3e5, 75.0, 200.0),
            (5.0, 52.0, 1e5, 70.0, 30.0),
            (0.0, 89.0, 3e6, 30.0, 10.0),
            (102.7, -18.1, 2e7, 0.0, 0.0),
            (-95.0, -50.0, 5e7, 0.0, 0.0),
            (-30.0, 10.0, -4e5, 60.0, 45.0),
        ] {
            let view = View::Globe {
                lon_deg,
                lat_deg,
                height_m,
                width_px: size_px[0],
                height_px: size_px[1],
                angles: CameraAngles {
                    tilt_deg,
                    heading_deg,
                    ..CameraAngles::NADIR
                },
            };
            let camera = Camera::of(&view).unwrap();
            let by_runs = mask(&camera, size_px, wanted, vec![]);
            let expected = edge_by_edge.mask(&camera, size_px, wanted, vec![]);
            // Beside the globe it says nothing: hidden outlines are led round there.
            let is_seen = |at: &usize| camera.is_below() || is_on_globe(&camera, size_px, *at);
            let seen: Vec<usize> = (0..expected.len()).filter(is_seen).collect();
            assert!(
                seen.iter().any(|at| expected[*at] != 0),
                "{view:?} has no land"
            );
            // Sums of other parts of the same whole round in another way.
            let share = |word: u32, shift: u32| (word >> shift) & 255;
            let is_apart = |at: usize| {
                [0, 8, 16, 24]
                    .map(|shift| share(by_runs[at], shift).abs_diff(share(expected[at], shift)))
                    .into_iter()
                    .max()
                    > Some(1)
            };
            let apart = seen.iter().filter(|at| is_apart(**at)).count();
            assert_eq!(apart, 0, "{view:?}");
        }
    }

    #[test]
    fn what_was_in_the_memory_of_a_mask_does_not_show() {
        let view = View::Globe {
            lon_deg: 10.0,
            lat_deg: 45.0,
            height_m: 4e6,
            width_px: 90,
            height_px: 50,
            angles: CameraAngles::NADIR,
        };
        let camera = Camera::of(&view).unwrap();
        let wanted = Wanted {
            land: true,
            coasts: true,
            borders: true,
        };
        let of = |memory: Vec<u32>| mask(&camera, [90, 50], wanted, memory);
        let fresh = of(vec![]);
        assert!(fresh.iter().any(|word| *word != 0));
        for memory in [vec![u32::MAX; 4500], vec![7; 10], vec![7; 9999]] {
            assert!(of(memory) == fresh);
        }
    }
}
