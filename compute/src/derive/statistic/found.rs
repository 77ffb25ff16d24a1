//! Values of the steps of a product in, what they hold together out: a bit a cell, their ends, and how many they are.

use storage::domain::Cells;

/// What all steps together hold.
pub(super) struct Found {
    /// Cells that hold data in some step.
    pub(super) cells: Cells,
    /// Lowest and highest value.
    pub(super) range: [f64; 2],
    /// How many values there were.
    pub(super) valid_cells: u64,
}

impl Found {
    pub(super) fn nothing(cell_count: usize) -> Self {
        Self {
            cells: Cells::none(cell_count),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            valid_cells: 0,
        }
    }

    /// Adds values of a step, from a place on. Which cells hold data is told where it was said at first that it is to be.
    pub(super) fn add(&mut self, first: usize, values: &[f32]) {
        if self.cells.map_count() > 0 {
            self.cells.add_valued(first, values);
        }
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for value in values {
            low = if *value < low { *value } else { low };
            high = if *value > high { *value } else { high };
        }
        let has_data = values.iter().filter(|value| !value.is_nan());
        self.merge(&Self {
            cells: Cells::none(0),
            range: [low, high].map(f64::from),
            valid_cells: has_data.count() as u64,
        });
    }

    /// A cell, by its place, holds data.
    pub(super) fn has_data(&mut self, place: usize) {
        self.cells.insert(place);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        if other.cells.map_count() > 0 {
            self.cells.add(&other.cells);
        }
        self.valid_cells += other.valid_cells;
        let ([low, high], [other_low, other_high]) = (self.range, other.range);
        self.range = [low.min(other_low), high.max(other_high)];
    }
}
