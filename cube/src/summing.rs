//! Values of a shard of the time-major copy in, records of sums of its blocks out: whole numbers, as questions sum them.

use crate::layout::{BLOCK_CELLS, RUN_STEPS};
use crate::record::{RECORD_BYTES, Record};
use crate::scale::{Counter, Scale};

const SIDE: usize = BLOCK_CELLS as usize;

/// Records of all blocks of a shard, row by row. `values` are `[step, row, col]`, stored unit, NaN no data, of whole blocks in
/// `cols` columns; `row_weights` is what a cell of each row weighs, fewer where the grid ends.
pub(crate) fn records(values: &[f32], cols: usize, row_weights: &[i64], scale: Scale) -> Vec<u8> {
    let map_values = values.len() / RUN_STEPS;
    let rows = map_values / cols;
    let mut out = vec![0; rows / SIDE * (cols / SIDE) * RECORD_BYTES];
    let mut written = out.chunks_exact_mut(RECORD_BYTES);
    let (mut row, mut cells) = (Row::new(scale), [0.0; SIDE * RUN_STEPS]);
    for top in (0..rows).step_by(SIDE) {
        let mut own = Record::default();
        for left in (0..cols).step_by(SIDE) {
            own.valid.fill(0);
            for at in 0..SIDE {
                let first = (top + at) * cols + left;
                for (step, map) in values.chunks_exact(map_values).enumerate() {
                    for (cell, value) in map[first..first + SIDE].iter().enumerate() {
                        cells[cell * RUN_STEPS + step] = *value;
                    }
                }
                let weight = row_weights.get(top + at).copied();
                row.add(&cells, at * SIDE, weight.unwrap_or(0), &mut own);
            }
            if let Some(out) = written.next() {
                own.write(out);
            }
        }
    }
    out
}

/// Sums of cells of a row, which weigh the same, before they are multiplied.
struct Row {
    scale: Scale,
    counter: Counter,
    counts: [u32; RUN_STEPS],
    sums: [i64; RUN_STEPS],
    squares: [i64; RUN_STEPS],
}

impl Row {
    fn new(scale: Scale) -> Self {
        Self {
            scale,
            counter: scale.counter(),
            counts: [0; RUN_STEPS],
            sums: [0; RUN_STEPS],
            squares: [0; RUN_STEPS],
        }
    }

    /// Adds cells, `[cell, step]`, the first of which has this place in its block.
    fn add(&mut self, cells: &[f32], first_cell: usize, weight: i64, record: &mut Record) {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        self.counts.fill(0);
        self.sums.fill(0);
        self.squares.fill(0);
        for (cell, values) in cells.chunks_exact(RUN_STEPS).enumerate() {
            for (step, value) in values.iter().enumerate() {
                let is_there = !value.is_nan();
                record.valid[step] |= u64::from(is_there) << (first_cell + cell);
                self.counts[step] += u32::from(is_there);
                let [steps, squares] = self.counter.of(*value);
                // What is beyond anything physical is found below.
                self.sums[step] = self.sums[step].wrapping_add(if is_there { steps } else { 0 });
                let square = if is_there { squares } else { 0 };
                self.squares[step] = self.squares[step].wrapping_add(square);
                low = if *value < low { *value } else { low };
                high = if *value > high { *value } else { high };
            }
        }
        if low > high {
            return;
        }
        if !self.scale.holds(low) || !self.scale.holds(high) {
            record.is_summed = false;
        }
        for step in 0..RUN_STEPS {
            let weighed = |sum: i64| i128::from(sum) * i128::from(weight);
            record.counts[step] += self.counts[step];
            record.weights[step] += i64::from(self.counts[step]) * weight;
            record.sums[step] += weighed(self.sums[step]);
            record.squares[step] += weighed(self.squares[step]);
        }
    }
}

#[cfg(test)]
mod tests {
    use contract::quantity::Quantity;

    use super::*;
    use crate::record::Numbers;

    /// Two rows of three blocks.
    const COLS: usize = 24;
    const ROWS: usize = 16;

    fn value(row: usize, col: usize, step: usize) -> f32 {
        match (row * 31 + col * 7 + step) % 11 {
            0 => f32::NAN,
            at => (at as f32 - 4.5) * 1.3e-8,
        }
    }

    fn values() -> Vec<f32> {
        let cells = (0..ROWS * COLS * RUN_STEPS).map(|at| {
            let (step, cell) = (at / (ROWS * COLS), at % (ROWS * COLS));
            value(cell / COLS, cell % COLS, step)
        });
        cells.collect()
    }

    fn read(records: &[u8], block: usize) -> Record {
        let mut own = Record::default();
        let bytes = &records[block * RECORD_BYTES..][..RECORD_BYTES];
        own.read(bytes, Numbers::SumsAndSquares).unwrap();
        own.read(bytes, Numbers::Valid).unwrap();
        own
    }

    #[test]
    fn records_are_sums_from_the_west_on() {
        let scale = Scale::of(Quantity::CarbonFlux).unwrap();
        // The grid has 13 of these rows.
        let weights: Vec<i64> = (0..13).map(|row| (1 << 36) + 7 * row).collect();
        let mut values = values();
        for map in values.chunks_exact_mut(ROWS * COLS) {
            map[13 * COLS..].fill(f32::NAN);
        }
        let found = records(&values, COLS, &weights, scale);
        for block in 0..6 {
            let own = read(&found, block);
            let (top, east) = (block / 3 * SIDE, (block % 3 + 1) * SIDE);
            for step in [0, 1, 77, RUN_STEPS - 1] {
                let (mut count, mut valid) = (0, 0);
                let (mut weight, mut sum, mut squares) = (0, 0, 0);
                for (at, row) in (top..(top + SIDE).min(13)).enumerate() {
                    for col in 0..east {
                        let value = value(row, col, step);
                        if value.is_nan() {
                            continue;
                        }
                        count += 1;
                        weight += weights[row];
                        sum += i128::from(scale.steps(value)) * i128::from(weights[row]);
                        let square = i128::from(scale.square_steps(value));
                        squares += square * i128::from(weights[row]);
                        if col + SIDE >= east {
                            valid |= 1u64 << (at * SIDE + col + SIDE - east);
                        }
                    }
                }
                assert_eq!((own.counts[step], own.valid[step]), (count, valid));
                assert_eq!((own.weights[step], own.sums[step]), (weight, sum));
                assert_eq!(own.squares[step], squares);
            }
        }
    }

    #[test]
    fn what_cannot_be_summed_spoils_what_lies_east_of_it_and_nothing_else() {
        let scale = Scale::of(Quantity::CarbonFlux).unwrap();
        let mut values = values();
        values[5 * ROWS * COLS + 3 * COLS + SIDE] = f32::INFINITY;
        let found = records(&values, COLS, &[1 << 36; ROWS], scale);
        let summed: Vec<bool> = (0..6).map(|block| read(&found, block).is_summed).collect();
        assert_eq!(summed, [true, false, false, true, true, true]);
    }
}
