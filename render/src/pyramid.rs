//! Coarser versions of scenes: where many cells share a pixel, cells are drawn in blocks of four, of sixteen and so on.
//!
//! Nothing is lost on the way: value times area times coverage, summed over a level, is that of the level below. Coverage
//! is the share of a block's area that holds data (the domain keeps it), and what a block is drawn with: a quarter of
//! the depth for a quarter of sea. Values are means by covered area, errors and what sums lack likewise, as if cells
//! were wrong together; accumulated carbon is its mass over the covered area, for a cell that lacks it has accumulated
//! nothing. Every coarser version is made once and kept with what it was made from. The terrain has a grid and coarser
//! versions of its own, means by area.

use std::sync::Arc;

use contract::earth::Earth;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob};
use contract::level::WeightedMean;
use rayon::prelude::*;

use crate::plan::cell_px;
use crate::scene::{Cells, Field, Interval, Scene, Terrain, Whole};
use crate::stages::layout::{COVERED, is_missing};

/// Cells smaller than this are joined, pixels: blocks then measure half a pixel to one.
const LEAST_CELL_PX: f64 = 0.5;
/// The same where particles drift: a cell sends out one at least, whose trail is many times as long.
const LEAST_FLOW_CELL_PX: f64 = 4.0;
/// Cells of the terrain smaller than this are joined, pixels: one pixel shows one cell, so what lies between is lost.
const LEAST_TERRAIN_CELL_PX: f64 = 1.0;

/// In the place of the number of a domain: every cell counts all over.
const ALL_OVER: u64 = u64::MAX;

/// The earth whose areas pictures go by.
const EARTH: Earth = Earth::Wgs84;

/// The version of a scene that a job is drawn from; none if it is the scene itself.
pub fn suited(job: &RenderJob, scene: &Scene) -> Option<Scene> {
    let product = suited_product(job, scene);
    let terrain = scene.terrain.as_ref();
    let Some(terrain) = terrain.and_then(|terrain| suited_terrain(job, terrain)) else {
        return product;
    };
    let mut suited = product.unwrap_or_else(|| scene.clone());
    suited.terrain = Some(terrain);
    Some(suited)
}

/// The coarser terrain that a job is drawn from; none if it is the terrain itself.
fn suited_terrain(job: &RenderJob, terrain: &Terrain) -> Option<Terrain> {
    let mut suited: Option<Terrain> = None;
    loop {
        let finest = suited.as_ref().unwrap_or(terrain);
        if cell_px(&job.view, &finest.grid) >= LEAST_TERRAIN_CELL_PX {
            return suited;
        }
        let Some(grid) = halved(&finest.grid) else {
            return suited;
        };
        let blocks = Blocks::new(&finest.grid, &grid, EARTH, None);
        let elevation = finest
            .elevation
            .coarser_mean(ALL_OVER, |cells| blocks.mean(cells));
        suited = Some(Terrain { grid, elevation });
    }
}

/// Cells of a mode that are smaller are joined, pixels.
fn least_cell_px(mode: Mode) -> f64 {
    match mode {
        Mode::Flow => LEAST_FLOW_CELL_PX,
        Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => LEAST_CELL_PX,
    }
}

/// How often a grid is halved before a job is drawn on it, and what it becomes.
pub fn halvings(job: &RenderJob, grid: &Grid) -> (u32, Grid) {
    let (mut count, mut suited) = (0, *grid);
    while cell_px(&job.view, &suited) < least_cell_px(job.mode) {
        let Some(next) = halved(&suited) else { break };
        (count, suited) = (count + 1, next);
    }
    (count, suited)
}

fn suited_product(job: &RenderJob, scene: &Scene) -> Option<Scene> {
    let least_px = least_cell_px(job.mode);
    let mut suited: Option<Scene> = None;
    loop {
        let finest = suited.as_ref().unwrap_or(scene);
        if cell_px(&job.view, &finest.grid) >= least_px {
            return suited;
        }
        let Some(coarser) = joined(finest, job.style.nearest) else {
            return suited;
        };
        suited = Some(coarser);
    }
}

/// A grid of blocks of two by two cells, if such blocks fit the earth; where one row or column is left, of pairs.
fn halved(fine: &Grid) -> Option<Grid> {
    let grid = fine.halved();
    // An odd number of columns all round, or of rows down to a pole, cannot be halved.
    let fits = grid.validate().is_ok() && (fine.rows >= 2 || fine.cols >= 2);
    fits.then_some(grid)
}

/// The same scene in blocks of two by two cells, if such blocks fit the earth; its terrain stays as it is.
pub fn coarser(scene: &Scene) -> Option<Scene> {
    joined(scene, false)
}

/// The same, of values that have nothing between two of them: a block has that of one of its cells.
fn joined(scene: &Scene, has_no_mean: bool) -> Option<Scene> {
    let fine = &scene.grid;
    // Whether blocks fit is for all of a grid to say, so that windows of it are joined alike.
    let whole = match &scene.whole {
        Some(whole) => Some(Whole {
            grid: halved(&whole.grid)?,
            row: whole.row / 2,
            col: whole.col / 2,
        }),
        None => None,
    };
    let grid = match whole {
        Some(_) => fine.halved(),
        None => halved(fine)?,
    };
    let blocks = Blocks::new(fine, &grid, EARTH, Some(scene.domain.content()));
    // One field is drawn with those of several products, whose blocks are weighed by other domains.
    let domain = scene.domain.id();
    let mean = |field: &Arc<Field>| {
        field.coarser_mean(domain, |cells| {
            if has_no_mean {
                blocks.sample(cells)
            } else {
                blocks.mean(cells)
            }
        })
    };
    let mass = |field: &Arc<Field>| field.coarser_mass(domain, |cells| blocks.mass(cells));
    let both = |interval: &Interval, coarser: &dyn Fn(&Arc<Field>) -> Arc<Field>| Interval {
        before: coarser(&interval.before),
        after: coarser(&interval.after),
        weight: interval.weight,
    };
    Some(Scene {
        grid,
        domain: Cells::coarser(&scene.domain, |_cells| blocks.coverage()),
        value: both(&scene.value, &mean),
        accumulated: scene
            .accumulated
            .as_ref()
            .map(|interval| both(interval, &mass)),
        terrain: scene.terrain.clone(),
        northward: scene
            .northward
            .as_ref()
            .map(|interval| both(interval, &mean)),
        trails: scene.trails.clone(),
        whole,
    })
}

/// Cells of a grid joined to blocks of two by two.
struct Blocks<'a> {
    fine: &'a Grid,
    grid: &'a Grid,
    /// Area of a cell and of a block of every row, m².
    fine_m2: Vec<f64>,
    block_m2: Vec<f64>,
    /// How much of every cell holds data in some step; none where that is not known and all counts.
    domain: Option<&'a [u32]>,
}

impl<'a> Blocks<'a> {
    fn new(fine: &'a Grid, grid: &'a Grid, earth: Earth, domain: Option<&'a [u32]>) -> Self {
        let areas_m2 = |grid: &Grid| -> Vec<f64> {
            let rows = 0..grid.rows;
            rows.map(|row| grid.cell_area_m2(row, earth)).collect()
        };
        Self {
            fine,
            grid,
            fine_m2: areas_m2(fine),
            block_m2: areas_m2(grid),
            domain,
        }
    }

    /// One number for every block from its row and the cells in it, each with its covered area, m²; on all cores.
    fn each<T: Clone + Default + Send>(
        &self,
        block: impl Fn(usize, &mut dyn Iterator<Item = (usize, f64)>) -> T + Sync,
    ) -> Vec<T> {
        let cols = self.grid.cols as usize;
        let mut blocks = vec![T::default(); self.grid.cell_count()];
        let rows = blocks.par_chunks_mut(cols).enumerate();
        rows.for_each(|(row, blocks)| {
            for (col, own) in blocks.iter_mut().enumerate() {
                *own = block(row, &mut self.cells(row, col));
            }
        });
        blocks
    }

    /// The cells of a block that are on the fine grid, each with its covered area, m².
    fn cells(&self, row: usize, col: usize) -> impl Iterator<Item = (usize, f64)> {
        let (rows, cols) = (self.fine.rows as usize, self.fine.cols as usize);
        let down = 2 * row..(2 * row + 2).min(rows);
        let across = 2 * col..(2 * col + 2).min(cols);
        down.flat_map(move |row| {
            let area_m2 = self.fine_m2[row];
            across.clone().map(move |col| {
                let cell = row * cols + col;
                let covered = self.domain.map_or(COVERED, |domain| domain[cell]);
                (cell, area_m2 * f64::from(covered) / f64::from(COVERED))
            })
        })
    }

    /// Share of every block that holds data in some step, of [`COVERED`]; what holds any keeps some.
    fn coverage(&self) -> Vec<u32> {
        self.each(|row, cells| {
            let covered_m2: f64 = cells.map(|(_, covered_m2)| covered_m2).sum();
            let share = covered_m2 / self.block_m2[row];
            let covered = (share * f64::from(COVERED)).round() as u32;
            covered.clamp(u32::from(covered_m2 > 0.0), COVERED)
        })
    }

    /// Means of what has a value, by covered area.
    fn mean(&self, values: &[f32]) -> Vec<f32> {
        self.each(|_, cells| {
            let mut mean = WeightedMean::default();
            for (cell, covered_m2) in cells {
                if !is_missing(values[cell]) {
                    mean.add(f64::from(values[cell]), covered_m2);
                }
            }
            mean.mean().map_or(f32::NAN, |mean| mean as f32)
        })
    }

    /// The value of the cell south-east of the middle, or else the first that there is: as levels of cubes have it.
    fn sample(&self, values: &[f32]) -> Vec<f32> {
        self.each(|_, cells| {
            let held = cells.map(|(cell, _)| values[cell]);
            let held: Vec<f32> = held.filter(|value| !is_missing(*value)).collect();
            // Of a block the last of its four cells lies there.
            match held[..] {
                [] => f32::NAN,
                [.., last] if held.len() == 4 => last,
                [first, ..] => first,
            }
        })
    }

    /// Mass over all covered area: what has no value has none. No value where none has one.
    fn mass(&self, kg_m2: &[f32]) -> Vec<f32> {
        self.each(|_, cells| {
            let (mut mass_kg, mut whole_m2) = (None, 0.0);
            for (cell, covered_m2) in cells {
                whole_m2 += covered_m2;
                if !is_missing(kg_m2[cell]) && covered_m2 > 0.0 {
                    let own_kg = f64::from(kg_m2[cell]) * covered_m2;
                    mass_kg = Some(mass_kg.unwrap_or(0.0) + own_kg);
                }
            }
            mass_kg.map_or(f32::NAN, |mass_kg: f64| (mass_kg / whole_m2) as f32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a level holds: grid, domain, flux and accumulated carbon.
    struct Level {
        grid: Grid,
        domain: Vec<u32>,
        flux: Vec<f32>,
        carbon: Vec<f32>,
    }

    /// Sea with a ragged coast, islands and a pole of land; sinks and sources; carbon that some of the sea lacks.
    fn sea(grid: Grid) -> Level {
        let places = (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
        let places: Vec<_> = places
            .map(|(row, col)| grid.cell_center(row, col))
            .collect();
        let is_land = |lon: f64, lat: f64| {
            let coast = 20.0 * (lat * 0.11).sin() + 5.0 * (lat * 1.7).sin();
            (lon - coast).abs() < 25.0 || (lon * 0.9).sin() * (lat * 1.1).cos() > 0.9 || lat > 80.0
        };
        let value = |number: &dyn Fn(f64, f64) -> f64| -> Vec<f32> {
            let numbers = places.iter().map(|place| {
                if is_land(place.lon, place.lat) {
                    f32::NAN
                } else {
                    number(place.lon, place.lat) as f32
                }
            });
            let field = Field::new(numbers.collect());
            field.cells.content().to_vec()
        };
        let flux = value(&|lon, lat| 1e-9 * ((lon * 0.05).sin() + 0.4 * (lat * 0.2).cos()));
        let carbon = value(&|lon, lat| {
            let is_lacking = (lon * 0.3).sin() > 0.95;
            if is_lacking {
                f64::NAN
            } else {
                0.02 * (lat * 0.06).sin() + 0.005
            }
        });
        let domain = flux
            .iter()
            .map(|value| u32::from(!is_missing(*value)) * COVERED);
        Level {
            domain: domain.collect(),
            grid,
            flux,
            carbon,
        }
    }

    impl Level {
        fn coarser(&self, earth: Earth) -> Option<Self> {
            let grid = halved(&self.grid)?;
            let blocks = Blocks::new(&self.grid, &grid, earth, Some(&self.domain));
            Some(Self {
                domain: blocks.coverage(),
                flux: Field::new(blocks.mean(&self.flux)).cells.content().to_vec(),
                carbon: Field::new(blocks.mass(&self.carbon))
                    .cells
                    .content()
                    .to_vec(),
                grid,
            })
        }

        /// Covered area, m², what passes through it, kg s⁻¹, what lies in it, kg; of each of the latter two what there is of
        /// either sign, too.
        fn sums(&self, earth: Earth) -> [f64; 5] {
            let mut sums = [0.0; 5];
            for (cell, &covered) in self.domain.iter().enumerate() {
                let row = cell as u32 / self.grid.cols;
                let share = f64::from(covered) / f64::from(COVERED);
                let area_m2 = self.grid.cell_area_m2(row, earth) * share;
                let of = |values: &[f32]| {
                    let value = Some(values[cell]).filter(|value| !is_missing(*value));
                    value.map_or(0.0, |value| f64::from(value) * area_m2)
                };
                let (flux, mass) = (of(&self.flux), of(&self.carbon));
                let own = [area_m2, flux, mass, flux.abs(), mass.abs()];
                sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            }
            sums
        }
    }

    fn grid(rows: u32, cols: u32, [north_deg, west_deg]: [f64; 2], step_deg: f64) -> Grid {
        Grid {
            rows,
            cols,
            north_deg,
            west_deg,
            dlat_deg: step_deg,
            dlon_deg: step_deg,
        }
    }

    #[test]
    fn every_level_down_to_one_cell_holds_the_area_the_flux_and_the_carbon_of_the_finest() {
        let round = Grid {
            dlat_deg: 180.0 / 128.0,
            ..grid(128, 256, [90.0, -180.0], 360.0 / 256.0)
        };
        // Rows and columns that cannot be halved evenly, up to a pole and short of it.
        let ragged = grid(77, 131, [71.5, -63.0], 0.9);
        let polar = grid(45, 64, [90.0, -20.0], 1.0);
        for grid in [round, ragged, polar] {
            for earth in [Earth::Wgs84, Earth::Sphere] {
                let mut level = sea(grid);
                let finest = level.sums(earth);
                assert!(finest[1].abs() > 0.0 && finest[2].abs() > 0.0);
                let mut levels = 0;
                while let Some(coarser) = level.coarser(earth) {
                    level = coarser;
                    levels += 1;
                    let sums = level.sums(earth);
                    // Sinks and sources cancel: the tolerance is of what passes either way.
                    for (sum, whole) in [(0, 0), (1, 3), (2, 4)] {
                        let apart = (sums[sum] - finest[sum]).abs() / finest[whole];
                        assert!(
                            apart < 1e-6,
                            "{:?} level {levels} on {earth}: sum {sum} is {apart:e} off",
                            level.grid
                        );
                    }
                }
                assert_eq!(level.grid.cell_count(), 1, "{:?}", level.grid);
                assert!(levels >= 6);
            }
        }
    }

    #[test]
    fn a_field_is_joined_by_the_domain_that_it_is_drawn_with_whoever_drew_it_before() {
        let grid = grid(4, 8, [90.0, -180.0], 45.0);
        let values = (0..grid.cell_count()).map(|cell| cell as f32).collect();
        let field = Arc::new(Field::new(values));
        let scene = |domain: fn(usize) -> bool| {
            let interval = Interval {
                before: Arc::clone(&field),
                after: Arc::clone(&field),
                weight: 0.0,
            };
            Scene {
                grid,
                domain: Scene::domain_of((0..grid.cell_count()).map(domain)),
                value: interval,
                accumulated: None,
                terrain: None,
                northward: None,
                trails: None,
                whole: None,
            }
        };
        let first = |scene: &Scene| coarser(scene).unwrap().value.before.cells.content()[0];
        // Of the cells 0, 1, 8 and 9 the first two, or the last one.
        let (north, one) = (scene(|cell| cell < 8), scene(|cell| cell == 9));
        let (of_north, of_one) = (first(&north), first(&one));
        assert!((of_north - 0.5).abs() < 1e-6 && (of_one - 9.0).abs() < 1e-6);
        assert_eq!(first(&north).to_bits(), of_north.to_bits());
    }

    #[test]
    fn a_quarter_of_sea_is_a_quarter_covered_with_the_value_of_the_sea() {
        // At the equator, where cells of two rows are as large as one another.
        let fine = grid(2, 2, [1.0, 10.0], 1.0);
        let coarse = halved(&fine).unwrap();
        let values = [7.0, f32::NAN, f32::NAN, f32::NAN];
        let field = Field::new(values.to_vec());
        let domain = [COVERED, 0, 0, 0];
        let blocks = Blocks::new(&fine, &coarse, Earth::Wgs84, Some(&domain));
        assert_eq!(blocks.mean(field.cells.content()), [7.0]);
        assert_eq!(blocks.mass(field.cells.content()), [7.0]);
        assert_eq!(blocks.coverage(), [COVERED / 4]);
        // Wholly covered to the last digit, whatever areas round to.
        let open = [COVERED; 4];
        let blocks = Blocks::new(&fine, &coarse, Earth::Wgs84, Some(&open));
        assert_eq!(blocks.coverage(), [COVERED]);
    }

    #[test]
    fn larger_cells_weigh_more_and_covered_ones_too() {
        // From 60 to 62 N the southern row is larger by a thirtieth.
        let fine = grid(2, 1, [62.0, 10.0], 1.0);
        let coarse = halved(&fine).unwrap();
        let [north_m2, south_m2] = [0, 1].map(|row| fine.cell_area_m2(row, Earth::Wgs84));
        let mean = |domain: [u32; 2]| {
            Blocks::new(&fine, &coarse, Earth::Wgs84, Some(&domain)).mean(&[0.0, 1.0])[0]
        };
        let expected = south_m2 / (north_m2 + south_m2);
        assert!(expected > 0.507);
        assert!((f64::from(mean([COVERED; 2])) - expected).abs() < 1e-6);
        let expected = 0.25 * south_m2 / (north_m2 + 0.25 * south_m2);
        assert!((f64::from(mean([COVERED, COVERED / 4])) - expected).abs() < 1e-6);
    }

    #[test]
    fn all_cores_make_the_same_blocks_as_one() {
        let level = sea(grid(700, 500, [60.0, -120.0], 0.1));
        let coarse = halved(&level.grid).unwrap();
        let blocks = Blocks::new(&level.grid, &coarse, Earth::Wgs84, Some(&level.domain));
        let alone: Vec<f32> = (0..350)
            .flat_map(|row| (0..250).map(move |col| (row, col)))
            .map(|(row, col)| {
                let (mut sum, mut whole) = (0.0, 0.0);
                for (cell, m2) in blocks.cells(row, col) {
                    if !is_missing(level.flux[cell]) {
                        sum += f64::from(level.flux[cell]) * m2;
                        whole += m2;
                    }
                }
                if whole > 0.0 {
                    (sum / whole) as f32
                } else {
                    f32::NAN
                }
            })
            .collect();
        let bits =
            |values: Vec<f32>| -> Vec<u32> { values.into_iter().map(f32::to_bits).collect() };
        assert_eq!(bits(blocks.mean(&level.flux)), bits(alone));
    }
}
