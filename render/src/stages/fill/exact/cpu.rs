//! CPU twin of `exact.wgsl`: the same bits.
#![expect(
    clippy::needless_range_loop,
    reason = "same loops and indices as the shader, to be read side by side"
)]

use super::PAD;
use crate::stages::fill::cpu::{quotient, split, stencil};
use crate::stages::fill::ladder::Ladder;
use crate::stages::fill::level::FillLevel;

/// Weights of the six nodes around the middle between two: Lagrange, exact for polynomials of degree 5.
const SHARES: [f32; 6] = [
    3.0 / 256.0,
    -25.0 / 256.0,
    150.0 / 256.0,
    150.0 / 256.0,
    -25.0 / 256.0,
    3.0 / 256.0,
];

/// The mean and the mean square of every gap, one plane after the other, scaled as `values` are; zero in other cells.
///
/// `values`: `[row, col]`, at least one not missing; `gaps`: 1 for cells to fill.
pub fn answers(ladder: &Ladder, values: &[f32], gaps: &[u32]) -> Vec<f32> {
    let mut planes = vec![split(values)];
    for (index, rung) in ladder.rungs.iter().enumerate() {
        if rung.level.has_coarser == 1 {
            planes.push(gathered(&rung.level, &planes[index]));
        }
    }
    let mut coarser: Vec<f32> = vec![];
    for (index, rung) in ladder.rungs.iter().enumerate().rev() {
        let wanted = (rung.level.is_masked == 1).then_some(gaps);
        let mut sums = stencil(&rung.level, &rung.table, &planes[index], wanted);
        if rung.level.has_coarser == 1 {
            raise(&rung.level, &coarser, wanted, &mut sums);
        }
        coarser = sums;
    }
    finished(&coarser, gaps)
}

fn finer(place: usize, tap: usize, pad: u32) -> i32 {
    let own = 2 * (place as i32 - pad as i32);
    if tap == 6 {
        own
    } else {
        own + 2 * (2 - tap as i32) + 1
    }
}

fn gathered(level: &FillLevel, fine: &[f32]) -> Vec<f32> {
    let (rows, cols) = (level.rows as i32, level.cols as i32);
    let (coarser_rows, coarser_cols) = (level.coarser_rows as usize, level.coarser_cols as usize);
    let mut coarse = vec![0.0; 3 * coarser_rows * coarser_cols];
    for plane in 0..3 {
        let fine = &fine[plane * (rows * cols) as usize..(plane + 1) * (rows * cols) as usize];
        let at = |row: i32, col: i32| {
            let x = if level.periodic == 1 {
                col.rem_euclid(cols)
            } else {
                col
            };
            if row < 0 || row >= rows || x < 0 || x >= cols {
                0.0
            } else {
                fine[(row * cols + x) as usize]
            }
        };
        for row in 0..coarser_rows {
            for col in 0..coarser_cols {
                let mut total = 0.0;
                for i in 0..7 {
                    let y = finer(row, i, PAD);
                    let mut line = 0.0;
                    for k in 0..6 {
                        line += SHARES[k] * at(y, finer(col, k, level.coarser_pad_cols));
                    }
                    line += at(y, finer(col, 6, level.coarser_pad_cols));
                    total += if i == 6 { line } else { SHARES[i] * line };
                }
                coarse[(plane * coarser_rows + row) * coarser_cols + col] = total;
            }
        }
    }
    coarse
}

fn raise(level: &FillLevel, coarse: &[f32], wanted: Option<&[u32]>, sums: &mut [f32]) {
    let (rows, cols) = (level.rows as usize, level.cols as usize);
    let (coarser_rows, coarser_cols) = (level.coarser_rows as usize, level.coarser_cols as usize);
    let coarse_col = |col: usize, k: usize| {
        if level.periodic == 1 {
            (col / 2 + k + 3 * coarser_cols - 2) % coarser_cols
        } else {
            col / 2 + k
        }
    };
    for plane in 0..3 {
        let coarse =
            &coarse[plane * coarser_rows * coarser_cols..(plane + 1) * coarser_rows * coarser_cols];
        let across = |row: usize, col: usize| {
            let at = |k: usize| coarse[row * coarser_cols + coarse_col(col, k)];
            if col.is_multiple_of(2) {
                return at(2);
            }
            let mut line = 0.0;
            for k in 0..6 {
                line += SHARES[k] * at(k);
            }
            line
        };
        for row in 0..rows {
            for col in 0..cols {
                let cell = row * cols + col;
                if wanted.is_some_and(|wanted| wanted[cell] == 0) {
                    continue;
                }
                let mut total = 0.0;
                if row.is_multiple_of(2) {
                    total = across(row / 2 + PAD as usize, col);
                } else {
                    for k in 0..6 {
                        total += SHARES[k] * across(row / 2 + k, col);
                    }
                }
                sums[plane * rows * cols + cell] += total;
            }
        }
    }
}

fn finished(sums: &[f32], gaps: &[u32]) -> Vec<f32> {
    let cells = gaps.len();
    let mut answers = vec![0.0; 2 * cells];
    for cell in 0..cells {
        if gaps[cell] != 0 {
            answers[cell] = quotient(sums[cells + cell], sums[cell]);
            answers[cells + cell] = quotient(sums[2 * cells + cell], sums[cell]);
        }
    }
    answers
}
