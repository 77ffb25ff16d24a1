//! CPU twin of `pairs.wgsl`: the same bits, from the tiled and from the naive form.

use contract::grid::Grid;

use crate::stages::fill::cpu::quotient;
use crate::stages::layout::is_missing;

/// The mean and the mean square of every gap, one plane after the other, scaled as `values` are; zero in other cells.
///
/// `values`: `[row, col]`; `gaps`: 1 for cells to fill; `tables`: see [`super::tables`].
pub fn answers(grid: &Grid, tables: &[f32], values: &[f32], gaps: &[u32]) -> Vec<f32> {
    let (rows, cols) = (grid.rows as usize, grid.cols as usize);
    let (by_rows, rest) = tables.split_at(rows);
    let (by_cols, cosines) = rest.split_at(cols);
    let mut answers = vec![0.0; 2 * rows * cols];
    for row in 0..rows {
        let targets: Vec<usize> = (0..cols)
            .filter(|col| gaps[row * cols + col] != 0)
            .collect();
        let mut totals = vec![[0.0f32; 3]; targets.len()];
        let other_rows = if targets.is_empty() { 0 } else { rows };
        for other in 0..other_rows {
            let (base, both) = (by_rows[row.abs_diff(other)], cosines[row] * cosines[other]);
            let weights: Vec<f32> = by_cols
                .iter()
                .map(|apart| quotient(1.0, base + both * apart))
                .collect();
            let line = &values[other * cols..(other + 1) * cols];
            let sources: Vec<(usize, f32)> = line
                .iter()
                .copied()
                .enumerate()
                .filter(|(_, value)| !is_missing(*value))
                .collect();
            for (col, total) in targets.iter().zip(&mut totals) {
                let mut line = [0.0f32; 3];
                for (source, value) in &sources {
                    let near = weights[col.abs_diff(*source)];
                    let weighted = near * value;
                    line = [
                        line[0] + near,
                        line[1] + weighted,
                        line[2] + weighted * value,
                    ];
                }
                *total = [total[0] + line[0], total[1] + line[1], total[2] + line[2]];
            }
        }
        for (col, total) in targets.iter().zip(totals) {
            answers[row * cols + col] = quotient(total[1], total[0]);
            answers[rows * cols + row * cols + col] = quotient(total[2], total[0]);
        }
    }
    answers
}
