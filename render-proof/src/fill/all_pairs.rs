//! All pairs in float64, cell by cell, written for truth and not for speed: what every form of filling is compared with.

use contract::grid::Grid;

use render::stages::fill::scaled::holds;
use render::stages::fill::sphere::Sphere;

/// Mean of all data weighted by one over the squared chord (Shepard 1968, power 2), for each of `cells`; NaN without
/// data.
///
/// `values`: `[row, col]`, any unit, missing where there is none; the cells themselves must be missing.
pub fn answers_at(grid: &Grid, values: &[f32], cells: &[usize]) -> Vec<f64> {
    let sphere = Sphere::of(grid);
    let by_cols: Vec<f64> = (0..grid.cols)
        .map(|col| sphere.half_sine_sq_cols(f64::from(col)))
        .collect();
    let cols = grid.cols as usize;
    let answer = |cell: &usize| {
        let (row, col) = (cell / cols, cell % cols);
        let cosine = sphere.lat_rad(row as f64).cos();
        let (mut weights, mut sum) = (0.0, 0.0);
        for (other, line) in values.chunks_exact(cols).enumerate() {
            let base = sphere.half_sine_sq_rows(row as f64 - other as f64);
            let both = cosine * sphere.lat_rad(other as f64).cos();
            for (source, value) in line.iter().enumerate().filter(|(_, value)| holds(**value)) {
                let weight = 1.0 / (base + both * by_cols[col.abs_diff(source)]);
                weights += weight;
                sum += weight * f64::from(*value);
            }
        }
        sum / weights
    };
    cells.iter().map(answer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: u32, cols: u32, north_deg: f64, step_deg: f64) -> Grid {
        Grid {
            rows,
            cols,
            north_deg,
            west_deg: 0.0,
            dlat_deg: step_deg,
            dlon_deg: step_deg,
        }
    }

    #[test]
    fn weights_are_inverse_squared_distances_on_the_sphere() {
        let gap = f32::NAN;
        // On the equator, 1 from the 1 and 2 from the 4: (1/1 * 1 + 1/4 * 4) / (1/1 + 1/4) = 1.6.
        let row = answers_at(&grid(1, 4, 0.005, 0.01), &[1.0, gap, gap, 4.0], &[1]);
        assert!((row[0] - 1.6).abs() < 1e-6, "{row:?}");
        // At 60 N, twice as far from the 0 in the north as from the 1 in the west: 1 / (1 + 1/4) = 0.8.
        let mut values = [gap; 9];
        (values[1], values[3]) = (0.0, 1.0);
        let square = answers_at(&grid(3, 3, 60.015, 0.01), &values, &[4]);
        assert!((square[0] - 0.8).abs() < 1e-3, "{square:?}");
        let empty = answers_at(&grid(1, 2, 0.0, 1.0), &[gap, gap], &[0]);
        assert!(empty[0].is_nan());
    }
}
