//! Rows of a field in, rows of its coarser levels out: values of blocks of cells and how much of them holds data. Pure.
//!
//! A level is summed up from the cells themselves, in the order of rows and, within one, of columns, however the rows come: the
//! same bits in bands of any height. What is handed from level to level are sums in double precision and not their rounded means.

use std::ops::Range;
use std::sync::Arc;

use contract::earth::Earth;
use contract::grid::Grid;
use contract::level::{self, Level, WeightedMean};
use contract::quantity::Quantity;

use crate::rounding::rounded;

/// The figure of the earth that cells are weighed on.
pub(crate) const EARTH: Earth = Earth::Wgs84;
/// Coverage of a cell that holds data everywhere; that of others is the nearest step of as many.
pub const WHOLLY_COVERED: u8 = u8::MAX;
/// What a share of the area may be off by rounding.
const SHARE_SLACK: f64 = 1e-9;
/// Mean vectors of directions that are shorter point nowhere.
const LEAST_VECTOR: f64 = 1e-6;

/// What becomes of the values of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Method {
    /// Their mean by area.
    Mean,
    /// Where their mean vector by area points: of angles, of which so many are a turn.
    Direction { turn: f64 },
    /// One of them, that of the cell south-east of the middle or else the first with data: codes of masks and categories have no mean.
    Sample,
}

impl Method {
    /// That of a quantity. Of an open one its unit tells: what has none may be a code.
    pub(crate) fn of(quantity: Quantity) -> Self {
        let Quantity::Open(_) = quantity else {
            return Self::Mean;
        };
        if !quantity.flags().is_empty() || quantity.is_day_of_year() {
            return Self::Sample;
        }
        match (quantity.unit(), quantity.units_per_turn()) {
            ("" | "1", _) => Self::Sample,
            (_, Some(turn)) => Self::Direction { turn },
            (_, None) => Self::Mean,
        }
    }

    /// Name of it in the attributes of levels.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mean => "average",
            Self::Direction { .. } => "vector_average",
            Self::Sample => "nearest",
        }
    }
}

/// A block on its way.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    /// Of values; of directions of their sines.
    mean: WeightedMean,
    /// Of cosines of directions.
    cosine: WeightedMean,
    /// The value that stands for all.
    sample: f32,
    /// Is any value below zero?
    is_signed: bool,
}

impl Block {
    /// One cell.
    fn of(value: f32, area_m2: f64, method: Method) -> Self {
        let mut own = Self::default();
        if !value.is_finite() {
            return own;
        }
        own.sample = value;
        own.is_signed = value < 0.0;
        match method {
            Method::Direction { turn } => {
                let (sine, cosine) = (f64::from(value) / turn * std::f64::consts::TAU).sin_cos();
                own.mean.add(sine, area_m2);
                own.cosine.add(cosine, area_m2);
            }
            Method::Mean | Method::Sample => own.mean.add(f64::from(value), area_m2),
        }
        own
    }

    /// Takes a smaller one in.
    fn take(&mut self, part: &Self, is_middle: bool) {
        if part.mean.weight() <= 0.0 {
            return;
        }
        if self.mean.weight() <= 0.0 || is_middle {
            self.sample = part.sample;
        }
        self.mean.join(&part.mean);
        self.cosine.join(&part.cosine);
        self.is_signed |= part.is_signed;
    }

    fn value(&self, method: Method) -> f32 {
        let Some(mean) = self.mean.mean() else {
            return f32::NAN;
        };
        match method {
            Method::Mean => rounded(mean as f32),
            Method::Direction { turn } => {
                let cosine = self.cosine.mean().unwrap_or_default();
                if mean.hypot(cosine) < LEAST_VECTOR {
                    return f32::NAN;
                }
                let turns = mean.atan2(cosine) / std::f64::consts::TAU;
                let turns = if self.is_signed {
                    turns
                } else {
                    turns.rem_euclid(1.0)
                };
                rounded((turns * turn) as f32)
            }
            Method::Sample => self.sample,
        }
    }

    /// Share of an area that holds data, in steps of [`WHOLLY_COVERED`]: what holds any keeps some, and what lacks any is not whole.
    fn coverage(&self, area_m2: f64) -> u8 {
        let share = self.mean.weight() / area_m2;
        if share <= 0.0 {
            0
        } else if share >= 1.0 - SHARE_SLACK {
            WHOLLY_COVERED
        } else {
            let steps = (share * f64::from(WHOLLY_COVERED)).round();
            steps.clamp(1.0, f64::from(WHOLLY_COVERED - 1)) as u8
        }
    }
}

/// Rows of a level that are done.
#[derive(Debug, Default)]
pub(crate) struct LevelRows {
    /// `[row, col]`, stored unit, NaN no data.
    pub(crate) values: Vec<f32>,
    /// `[row, col]`, in steps of [`WHOLLY_COVERED`].
    pub(crate) coverage: Vec<u8>,
}

/// One level on its way.
struct Joining {
    /// Rows and columns of the level below in a block.
    parts: [u32; 2],
    /// Rows of the level below.
    part_rows: u32,
    /// Area of a block in one column of cells, of every row, m².
    areas_m2: Arc<[f64]>,
    /// Columns of cells in a block of every column.
    widths: Arc<[f64]>,
    /// The row of the level below that comes next.
    next: u32,
    blocks: Vec<Block>,
    done: LevelRows,
}

impl Joining {
    /// Takes a row of the level below, of which those parts that hold data are among the columns of `held`, what a part is made of given
    /// by `part`; the row of blocks that is complete with it.
    fn take<T>(
        &mut self,
        (row, held): (&[T], Range<usize>),
        part: impl Fn(&T) -> Block,
        method: Method,
    ) -> Option<Vec<Block>> {
        let [down, across] = self.parts;
        let (at, own) = (self.next % down, self.next / down);
        let across = across as usize;
        let touched = held.start / across..held.end.div_ceil(across);
        let parts = row.chunks(across).zip(&mut self.blocks);
        for (parts, block) in parts.take(touched.end).skip(touched.start) {
            for (col, own) in parts.iter().enumerate() {
                let is_middle = at == down / 2 && col == across / 2;
                block.take(&part(own), is_middle);
            }
        }
        self.next += 1;
        if at + 1 < down && self.next < self.part_rows {
            return None;
        }
        let area_m2 = self.areas_m2[own as usize];
        for (block, width) in self.blocks.iter().zip(&*self.widths) {
            self.done.values.push(block.value(method));
            self.done.coverage.push(block.coverage(area_m2 * width));
        }
        let blank = vec![Block::default(); self.blocks.len()];
        Some(std::mem::replace(&mut self.blocks, blank))
    }
}

/// All levels of a field on their way.
pub(crate) struct Joiner {
    method: Method,
    cols: usize,
    /// Area of a cell of every row, m².
    cells_m2: Vec<f64>,
    /// The row that comes next.
    next: u32,
    levels: Vec<Joining>,
    /// Smallest and largest value.
    range: Option<[f32; 2]>,
}

impl Joiner {
    /// Of a field that comes from this row on, which begins a row of the coarsest of these levels.
    pub(crate) fn new(grid: &Grid, quantity: Quantity, levels: &[Level], first_row: u32) -> Self {
        let mut below = Level {
            number: 0,
            grid: *grid,
            cells: [1; 2],
        };
        let mut joining = vec![];
        for level in levels {
            let widths = level.col_edges(grid);
            let widths = widths.windows(2).map(|pair| f64::from(pair[1] - pair[0]));
            joining.push(Joining {
                parts: [0, 1].map(|side| level.cells[side] / below.cells[side]),
                part_rows: below.grid.rows,
                areas_m2: level.row_areas_m2(grid, EARTH).into(),
                widths: widths.collect(),
                next: first_row / below.cells[0],
                blocks: vec![Block::default(); level.grid.cols as usize],
                done: LevelRows::default(),
            });
            below = *level;
        }
        let area = |row: u32| grid.cell_area_m2(row, EARTH);
        Self {
            method: Method::of(quantity),
            cols: grid.cols as usize,
            cells_m2: (0..grid.rows).map(area).collect(),
            next: first_row,
            levels: joining,
            range: None,
        }
    }

    /// All levels of a grid.
    pub(crate) fn of_all(grid: &Grid, quantity: Quantity) -> Self {
        Self::new(grid, quantity, &level::levels(grid), 0)
    }

    /// Takes the rows that come next, whole ones.
    pub(crate) fn take(&mut self, values: &[f32]) {
        if self.levels.is_empty() {
            return;
        }
        for row in values.chunks_exact(self.cols) {
            let area_m2 = self.cells_m2[self.next as usize];
            self.next += 1;
            let is_held = |value: &f32| value.is_finite();
            let first = row.iter().position(is_held).unwrap_or(row.len());
            let end = row.iter().rposition(is_held).map_or(first, |last| last + 1);
            for value in row[first..end].iter().filter(|value| value.is_finite()) {
                let [least, most] = self.range.unwrap_or([*value; 2]);
                self.range = Some([least.min(*value), most.max(*value)]);
            }
            let method = self.method;
            let mut levels = self.levels.iter_mut();
            let cell = |value: &f32| Block::of(*value, area_m2, method);
            let mut blocks = levels
                .next()
                .and_then(|level| level.take((row, first..end), cell, method));
            for level in levels {
                let Some(complete) = blocks else { break };
                let all = 0..complete.len();
                blocks = level.take((&complete, all), |part| *part, method);
            }
        }
    }

    /// Smallest and largest of the values that came, 0 and 0 without data.
    pub(crate) fn range(&self) -> [f32; 2] {
        self.range.unwrap_or_default()
    }

    /// Rows of a level, by its place among them, that are done since this was asked last.
    pub(crate) fn done(&mut self, level: usize) -> LevelRows {
        let joining = self.levels.get_mut(level);
        joining.map_or_else(LevelRows::default, |own| std::mem::take(&mut own.done))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_tell_what_becomes_of_values() {
        let of = |unit: &str| Method::of(Quantity::open("own", unit, "Own").unwrap());
        for (unit, method) in [
            ("degree", Method::Direction { turn: 360.0 }),
            ("Degrees_True", Method::Direction { turn: 360.0 }),
            (
                "radian",
                Method::Direction {
                    turn: std::f64::consts::TAU,
                },
            ),
            ("1", Method::Sample),
            ("m s-1", Method::Mean),
        ] {
            assert_eq!(of(unit), method, "{unit}");
        }
        // A known quantity without a unit is a share, and has a mean.
        assert_eq!(Method::of(Quantity::IceFraction), Method::Mean);
        let phase = Quantity::open("sst_annual_phase", "day", "Phase").unwrap();
        assert_eq!(Method::of(phase), Method::Sample);
    }

    #[test]
    fn what_holds_any_data_keeps_some_coverage_and_what_lacks_any_is_not_whole() {
        let coverage = |share: f64| {
            let mut block = Block::default();
            block.take(&Block::of(1.0, share, Method::Mean), false);
            block.coverage(1.0)
        };
        for (share, steps) in [
            (0.0, 0),
            (1e-6, 1),
            (0.5, 128),
            (1.0 - 1e-6, WHOLLY_COVERED - 1),
            (1.0 - 1e-12, WHOLLY_COVERED),
            (1.0, WHOLLY_COVERED),
        ] {
            assert_eq!(coverage(share), steps, "{share}");
        }
    }
}
