//! CPU twins of `fill.wgsl` and `stencil.wgsl`: the same operations on single numbers in the same order, so that both
//! give the same bits.

use rayon::prelude::*;

use super::level::{FillLevel, Table};

/// Gaps closer than this are computed as one run: whole runs go through the processor's vector units.
const JOINED_COLS: usize = 8;

/// `a / b` for positive `b` by Newton's iteration.
pub fn quotient(a: f32, b: f32) -> f32 {
    let mut inverse = f32::from_bits(0x7ef3_11c7_u32.wrapping_sub(b.to_bits()));
    for _ in 0..3 {
        inverse *= 2.0 - b * inverse;
    }
    a * inverse
}

/// Presence, value and square of every cell, one plane after the other; `values` scaled, missing where there is none.
pub fn split(values: &[f32]) -> Vec<f32> {
    let held = |value: &f32| !crate::stages::layout::is_missing(*value);
    let plane = |of: &dyn Fn(f32) -> f32| -> Vec<f32> {
        values
            .iter()
            .map(|value| if held(value) { of(*value) } else { 0.0 })
            .collect()
    };
    [
        plane(&|_| 1.0),
        plane(&|value| value),
        plane(&|value| value * value),
    ]
    .concat()
}

/// The weighted sums of the three planes of `source` around each wanted cell; zero in the others.
pub fn stencil(
    level: &FillLevel,
    table: &Table,
    source: &[f32],
    wanted: Option<&[u32]>,
) -> Vec<f32> {
    let cells = level.rows as usize * level.cols as usize;
    let rims: Vec<Rimmed> = source
        .chunks_exact(cells)
        .map(|plane| Rimmed::new(level, plane))
        .collect();
    let mut sums = vec![0.0f32; 3 * cells];
    let cols = level.cols as usize;
    let (counts, rest) = sums.split_at_mut(cells);
    let (values, squares) = rest.split_at_mut(cells);
    let rows = counts
        .par_chunks_mut(cols)
        .zip(values.par_chunks_mut(cols))
        .zip(squares.par_chunks_mut(cols));
    rows.enumerate()
        .for_each(|(row, ((counts, values), squares))| {
            let wanted = wanted.map(|wanted| &wanted[row * cols..(row + 1) * cols]);
            for (rim, sums) in rims.iter().zip([counts, values, squares]) {
                row_sums(level, table, rim, row, wanted, sums);
            }
        });
    sums
}

fn row_sums(
    level: &FillLevel,
    table: &Table,
    source: &Rimmed,
    row: usize,
    wanted: Option<&[u32]>,
    sums: &mut [f32],
) {
    let width = 2 * table.reach_rows as usize + 1;
    for (start, end) in runs(wanted, sums.len()) {
        for step in 0..width {
            let line = row * width + step;
            let span = table.spans[line] as usize;
            let y = (row + step).checked_sub(table.reach_rows as usize);
            let Some(y) = y.filter(|y| span > 0 && *y < level.rows as usize) else {
                continue;
            };
            let weights = &table.weights[line * (table.reach_cols as usize + 1)..][..span];
            let sums = &mut sums[start..end];
            for (sum, near) in sums.iter_mut().zip(source.run(y, start, 0)) {
                *sum += weights[0] * near;
            }
            for (dx, weight) in weights.iter().enumerate().skip(1) {
                let (west, east) = (
                    source.run(y, start, -(dx as isize)),
                    source.run(y, start, dx as isize),
                );
                for ((sum, west), east) in sums.iter_mut().zip(west).zip(east) {
                    *sum += weight * (west + east);
                }
            }
        }
        if let Some(wanted) = wanted {
            for (sum, _) in sums[start..end]
                .iter_mut()
                .zip(&wanted[start..end])
                .filter(|(_, wanted)| **wanted == 0)
            {
                *sum = 0.0;
            }
        }
    }
}

/// Runs of wanted columns, first and end.
fn runs(wanted: Option<&[u32]>, cols: usize) -> Vec<(usize, usize)> {
    let Some(wanted) = wanted else {
        return vec![(0, cols)];
    };
    let mut runs: Vec<(usize, usize)> = vec![];
    for (col, _) in wanted
        .iter()
        .enumerate()
        .filter(|(_, wanted)| **wanted != 0)
    {
        match runs.last_mut() {
            Some((_, end)) if col < *end + JOINED_COLS => *end = col + 1,
            _ => runs.push((col, col + 1)),
        }
    }
    runs
}

/// A plane with rims to the west and the east: zeros, or on a grid that goes all the way round its other end.
struct Rimmed {
    content: Vec<f32>,
    cols: usize,
    rim: usize,
}

impl Rimmed {
    fn new(level: &FillLevel, plane: &[f32]) -> Self {
        let (cols, rim) = (level.cols as usize, level.reach_cols as usize);
        let mut content = Vec::with_capacity(level.rows as usize * (cols + 2 * rim));
        for row in plane.chunks_exact(cols) {
            if level.periodic == 1 {
                content.extend_from_slice(&row[cols - rim..]);
                content.extend_from_slice(row);
                content.extend_from_slice(&row[..rim]);
            } else {
                content.resize(content.len() + rim, 0.0);
                content.extend_from_slice(row);
                content.resize(content.len() + rim, 0.0);
            }
        }
        Self {
            content,
            cols: cols + 2 * rim,
            rim,
        }
    }

    /// The cells of a row from a column on, seen from `shift` columns further.
    fn run(&self, row: usize, col: usize, shift: isize) -> &[f32] {
        let first = row * self.cols + (self.rim + col).strict_add_signed(shift);
        &self.content[first..(row + 1) * self.cols]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_are_right_to_the_last_bits() {
        for (a, b) in [
            (1.0f32, 3.0f32),
            (2.5, 1e-6),
            (-7.0, 12345.0),
            (1e-3, 0.7),
            (0.0, 2.0),
        ] {
            let exact = f64::from(a) / f64::from(b);
            assert!(
                (f64::from(quotient(a, b)) - exact).abs() <= 3e-7 * exact.abs(),
                "{a} / {b}"
            );
        }
    }

    #[test]
    fn runs_join_close_gaps_and_keep_far_ones_apart() {
        let mut wanted = vec![0u32; 40];
        for col in [0, 3, 20, 39] {
            wanted[col] = 1;
        }
        assert_eq!(runs(Some(&wanted), 40), [(0, 4), (20, 21), (39, 40)]);
        assert_eq!(runs(None, 7), [(0, 7)]);
    }
}
