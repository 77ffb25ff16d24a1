//! Whole numbers that cells weigh in sums: steps of a power of two.

use contract::earth::Earth;
use contract::grid::Grid;
use serde::{Deserialize, Serialize};

use crate::scale::nearest;

/// Steps of the largest weight, as a power of two: a share of 1e-11 of a cell is told.
pub const WEIGHT_BITS: i32 = 36;

/// Size of a step of weight: a power of two of m², m, or shares of a place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WeightUnit(i32);

impl WeightUnit {
    /// The one whose steps the largest weight has some 2³⁶ of.
    pub fn of(largest: f64) -> Self {
        Self(largest.log2().floor() as i32 - WEIGHT_BITS)
    }

    /// What a step is.
    pub fn size(self) -> f64 {
        f64::from(self.0).exp2()
    }

    /// The nearest number of steps, but at least one of what there is.
    pub fn steps(self, weight: f64) -> i64 {
        self.counting()(weight)
    }

    /// The same of many weights: what they have in common is worked out once.
    pub fn counting(self) -> impl Fn(f64) -> i64 + Copy {
        // A power of two: to multiply with the reciprocal is as exact.
        let per_step = 1.0 / self.size();
        move |weight| {
            if weight > 0.0 {
                nearest(weight * per_step).max(1)
            } else {
                0
            }
        }
    }
}

/// Area of the largest cell of a grid, m².
pub fn largest_cell_m2(grid: &Grid, earth: Earth) -> f64 {
    let areas = (0..grid.rows).map(|row| grid.cell_area_m2(row, earth));
    areas.fold(0.0, f64::max)
}

/// What a whole cell of each row of a grid weighs in questions of areas, in steps.
pub(crate) fn row_weights(grid: &Grid, earth: Earth) -> Vec<i64> {
    let unit = WeightUnit::of(largest_cell_m2(grid, earth));
    let weight = |row: u32| unit.steps(grid.cell_area_m2(row, earth));
    (0..grid.rows).map(weight).collect()
}
