//! What a generator makes up: a grid, what its file says of itself, and the map of every month by bands of rows.

use std::ops::Range;

use super::grid::FileGrid;

/// What stands for no data in the file.
pub(super) const FILL: f32 = -9999.0;

/// What is made up.
pub(super) trait MadeUp {
    /// Cells of the file.
    fn grid(&self) -> FileGrid;

    /// What the file says of itself.
    fn texts(&self) -> Texts;

    /// Flux of a month, counted from January 2009, mmol m⁻² d⁻¹, positive out of the sea, `[row, col]` from the south, of
    /// some rows; land and cloud filled.
    fn month_values(&self, month: usize, rows: Range<u32>) -> Vec<f32>;
}

/// What a file says of itself.
pub(super) struct Texts {
    /// Of what the flux is, as in "China Sea".
    pub(super) sea: &'static str,
    /// The command of `fluxglobe generate`; profiles know the file by it.
    pub(super) command: &'static str,
    /// The seed.
    pub(super) seed: u64,
}

/// Maps of one month that are kept while days of it are written, cells: days of a year make a map twelve times, not 365. Larger
/// grids have every day made anew, and memory stays that of a band.
const KEPT_CELLS: usize = 1 << 24;

/// Bands of the month that was asked for last.
#[derive(Default)]
pub(super) struct KeptMonth {
    month: usize,
    bands: Vec<(u32, Vec<f32>)>,
}

impl KeptMonth {
    /// Values of a day: those of its month times `strength`.
    pub(super) fn day_values(
        &mut self,
        made_up: &dyn MadeUp,
        (month, strength): (usize, f32),
        rows: Range<u32>,
    ) -> Vec<f32> {
        let day = |values: &[f32]| values.iter().map(|v| stronger(*v, strength)).collect();
        if self.month != month {
            self.bands.clear();
            self.month = month;
        }
        if let Some((_, values)) = self.bands.iter().find(|(first, _)| *first == rows.start) {
            return day(values);
        }
        let (first, values) = (rows.start, made_up.month_values(month, rows));
        let values_of_day = day(&values);
        let kept: usize = self.bands.iter().map(|(_, values)| values.len()).sum();
        if kept + values.len() <= KEPT_CELLS {
            self.bands.push((first, values));
        }
        values_of_day
    }
}

fn stronger(value: f32, strength: f32) -> f32 {
    if value == FILL {
        FILL
    } else {
        value * strength
    }
}
