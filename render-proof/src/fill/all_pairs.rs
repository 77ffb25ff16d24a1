//! All pairs in float64, cell by cell, written for truth and not for speed: what every form is compared with.

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
