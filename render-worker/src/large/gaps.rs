//! A level of a field whose gaps are filled in, values for the gaps of finer windows out: bilinear between centres of its cells, so that
//! whichever window a gap lies in, it is filled alike. Pure.

use contract::grid::Grid;
use render::stages::fill::Filled;
use render::stages::layout::is_missing;

/// A whole level without gaps.
pub(super) struct Coarse {
    grid: Grid,
    values: Vec<f32>,
    errors: Vec<f32>,
    /// The largest of them, above 0: what was filled is seen to be.
    pub(super) largest_error: f32,
}

impl Coarse {
    pub(super) fn new(grid: Grid, filled: Filled) -> Self {
        let errors = filled.errors.iter().copied();
        let errors = errors.filter(|error| !is_missing(*error));
        Self {
            largest_error: errors.fold(f32::MIN_POSITIVE, f32::max),
            grid,
            values: filled.values,
            errors: filled.errors,
        }
    }

    /// Value and estimated error at a place, degrees; none where no cell around it has one.
    pub(super) fn at(&self, lat_deg: f64, lon_deg: f64) -> Option<[f32; 2]> {
        let grid = &self.grid;
        let east = (lon_deg - grid.west_deg).rem_euclid(360.0) / grid.dlon_deg - 0.5;
        let south = (grid.north_deg - lat_deg) / grid.dlat_deg - 0.5;
        let (left, top) = (east.floor(), south.floor());
        let (right_share, lower_share) = (east - left, south - top);
        let mut sums = [0.0; 3];
        for (down, row_share) in [(0.0, 1.0 - lower_share), (1.0, lower_share)] {
            for (across, col_share) in [(0.0, 1.0 - right_share), (1.0, right_share)] {
                let row = (top + down).clamp(0.0, f64::from(grid.rows) - 1.0);
                let col = if grid.is_periodic() {
                    (left + across).rem_euclid(f64::from(grid.cols))
                } else {
                    (left + across).clamp(0.0, f64::from(grid.cols) - 1.0)
                };
                let cell = row as usize * grid.cols as usize + col as usize;
                let value = self.values[cell];
                if is_missing(value) || !value.is_finite() {
                    continue;
                }
                let share = row_share * col_share;
                sums[0] += f64::from(value) * share;
                sums[1] += f64::from(self.errors[cell]) * share;
                sums[2] += share;
            }
        }
        let [value, error, share] = sums;
        // A place on the centre of a cell without a value has none around it either.
        (share > 0.0).then(|| {
            let error = (error / share) as f32;
            [(value / share) as f32, error.max(f32::MIN_POSITIVE)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::stages::layout::MISSING;

    const GRID: Grid = Grid {
        rows: 2,
        cols: 4,
        north_deg: 20.0,
        west_deg: -180.0,
        dlat_deg: 10.0,
        dlon_deg: 90.0,
    };

    #[test]
    fn gaps_are_filled_between_centres_and_round_the_date_line() {
        let filled = Filled {
            values: vec![1.0, 2.0, 3.0, 5.0, 10.0, MISSING, 30.0, 50.0],
            errors: vec![0.0, 0.5, 0.0, 0.0, 0.0, MISSING, 0.0, 0.0],
        };
        let coarse = Coarse::new(GRID, filled);
        assert_eq!(coarse.largest_error.to_bits(), 0.5f32.to_bits());
        let value = |lat, lon| coarse.at(lat, lon).map(|[value, _]| value);
        assert_eq!(value(15.0, -135.0), Some(1.0));
        assert_eq!(value(15.0, -90.0), Some(1.5));
        assert_eq!(value(10.0, -135.0), Some(5.5));
        // Half-way between the last column and the first.
        assert_eq!(value(15.0, 180.0), Some(3.0));
        assert_eq!(value(15.0, -180.0), Some(3.0));
        // Beyond the centres of the outer rows.
        assert_eq!(value(19.9, -135.0), Some(1.0));
        assert_eq!(value(0.1, -135.0), Some(10.0));
        // What is missing takes no part.
        assert_eq!(value(5.0, -90.0), Some(10.0));
        let [_, error] = coarse.at(15.0, -90.0).unwrap();
        assert_eq!(error.to_bits(), 0.25f32.to_bits());
        assert!(
            coarse.at(15.0, 45.0).unwrap()[1] > 0.0,
            "it was not measured"
        );
    }
}
