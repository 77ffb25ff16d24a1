//! CPU twin of `window.wgsl`: the same bits.

use crate::stages::fill::cpu::{quotient, split, stencil};
use crate::stages::fill::ladder::Ladder;
use crate::stages::fill::level::FillLevel;

/// The mean and the mean square of every gap, one plane after the other, scaled as `values` are; zero in other cells.
///
/// `values`: `[row, col]`, at least one not missing; `gaps`: 1 for cells to fill.
pub fn answers(ladder: &Ladder, values: &[f32], gaps: &[u32]) -> Vec<f32> {
    let mut planes = vec![split(values)];
    let mut wanted = vec![gaps.to_vec()];
    for (index, rung) in ladder.rungs.iter().enumerate() {
        if rung.level.has_coarser == 1 {
            planes.push(joined(&rung.level, &planes[index]));
            wanted.push(joined_wanted(&rung.level, &wanted[index]));
        }
    }
    let mut answers = vec![];
    for (index, rung) in ladder.rungs.iter().enumerate().rev() {
        let sums = stencil(
            &rung.level,
            &rung.table,
            &planes[index],
            Some(&wanted[index]),
        );
        answers = settled(&rung.level, &sums, &answers, &wanted[index]);
    }
    answers
}

fn joined(level: &FillLevel, fine: &[f32]) -> Vec<f32> {
    let (rows, cols) = (level.rows as usize, level.cols as usize);
    let (coarser_rows, coarser_cols) = (level.coarser_rows as usize, level.coarser_cols as usize);
    let mut coarse = vec![0.0; 3 * coarser_rows * coarser_cols];
    for plane in 0..3 {
        let fine = &fine[plane * rows * cols..(plane + 1) * rows * cols];
        let at = |row: usize, col: usize| {
            if row < rows && col < cols {
                fine[row * cols + col]
            } else {
                0.0
            }
        };
        for row in 0..coarser_rows {
            for col in 0..coarser_cols {
                let north = at(2 * row, 2 * col) + at(2 * row, 2 * col + 1);
                let south = at(2 * row + 1, 2 * col) + at(2 * row + 1, 2 * col + 1);
                coarse[(plane * coarser_rows + row) * coarser_cols + col] = (north + south) * 0.25;
            }
        }
    }
    coarse
}

fn joined_wanted(level: &FillLevel, fine: &[u32]) -> Vec<u32> {
    let (rows, cols) = (level.rows as usize, level.cols as usize);
    let (coarser_rows, coarser_cols) = (level.coarser_rows as usize, level.coarser_cols as usize);
    let is_round = level.periodic == 1;
    let mut coarse = vec![0; coarser_rows * coarser_cols];
    for row in 0..rows {
        for col in 0..cols {
            if fine[row * cols + col] != 0 {
                // A cell reads the answers of the four blocks nearest to it.
                for y in [row / 2, beside(row, coarser_rows, false)] {
                    for x in [col / 2, beside(col, coarser_cols, is_round)] {
                        coarse[y * coarser_cols + x] = 1;
                    }
                }
            }
        }
    }
    coarse
}

fn beside(place: usize, count: usize, is_round: bool) -> usize {
    if place % 2 == 1 {
        if place / 2 + 1 < count {
            return place / 2 + 1;
        }
        return if is_round { 0 } else { count - 1 };
    }
    if place >= 2 {
        return place / 2 - 1;
    }
    if is_round { count - 1 } else { 0 }
}

fn coarser(level: &FillLevel, answers: &[f32], row: usize, col: usize, plane: usize) -> f32 {
    let (rows, cols) = (level.coarser_rows as usize, level.coarser_cols as usize);
    let near = (plane * rows + row / 2) * cols;
    let far = (plane * rows + beside(row, rows, false)) * cols;
    let x = beside(col, cols, level.periodic == 1);
    let own = answers[near + col / 2];
    let sides = answers[near + x] + answers[far + col / 2];
    0.5625 * own + 0.1875 * sides + 0.0625 * answers[far + x]
}

fn settled(level: &FillLevel, sums: &[f32], coarser_answers: &[f32], wanted: &[u32]) -> Vec<f32> {
    let (rows, cols) = (level.rows as usize, level.cols as usize);
    let cells = rows * cols;
    let mut answers = vec![0.0; 2 * cells];
    for row in 0..rows {
        for col in 0..cols {
            let cell = row * cols + col;
            if wanted[cell] == 0 {
                continue;
            }
            let mut total = [sums[cell], sums[cells + cell], sums[2 * cells + cell]];
            if level.has_coarser == 1 {
                let leaned = [0, 1].map(|plane| coarser(level, coarser_answers, row, col, plane));
                total[0] += level.lean;
                total[1] += level.lean * leaned[0];
                total[2] += level.lean * leaned[1];
            }
            answers[cell] = quotient(total[1], total[0]);
            answers[cells + cell] = quotient(total[2], total[0]);
        }
    }
    answers
}
