//! What is stored of a block of cells and a run of steps: sums of it and of all blocks west of it in its shard, and which of
//! its own cells hold data. Numbers in, bytes out, and back.
//!
//! Sums along a row of blocks lead to those of any blocks side by side by one difference, however many they are.

use crate::layout::RUN_STEPS;

/// Bytes before the numbers.
const HEADER_BYTES: usize = 8;
/// Bytes of all numbers of a step: cells with data, their count, their weight, sum and squares.
const STEP_BYTES: usize = 8 + 4 + 8 + 16 + 16;
/// Bytes of a record.
pub(crate) const RECORD_BYTES: usize = HEADER_BYTES + RUN_STEPS * STEP_BYTES;
/// First byte of a record that holds no sums.
const UNSUMMED: u8 = 1;

/// Numbers of a block at every step of a run; all zero where it and those west of it have no data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// Could all values be summed? Else only `valid` says anything.
    pub is_summed: bool,
    /// Cells of this block that hold data, a bit each: the first of its first row is the lowest.
    pub valid: Vec<u64>,
    /// Values that are there, of this block and those west of it in its shard.
    pub counts: Vec<u32>,
    /// Their weight.
    pub weights: Vec<i64>,
    /// Weight x value, in steps of the scale.
    pub sums: Vec<i128>,
    /// Weight x its square, in steps of squares.
    pub squares: Vec<i128>,
}

impl Default for Record {
    fn default() -> Self {
        Self {
            is_summed: true,
            valid: vec![0; RUN_STEPS],
            counts: vec![0; RUN_STEPS],
            weights: vec![0; RUN_STEPS],
            sums: vec![0; RUN_STEPS],
            squares: vec![0; RUN_STEPS],
        }
    }
}

impl Record {
    /// Writes it: the same byte of all steps side by side, so that what does not change is compressed away.
    pub(crate) fn write(&self, out: &mut [u8]) {
        let (header, out) = out.split_at_mut(HEADER_BYTES);
        header.fill(0);
        header[0] = if self.is_summed { 0 } else { UNSUMMED };
        let mut planes = out.chunks_exact_mut(RUN_STEPS);
        let mut put = |count: usize, word: &dyn Fn(usize) -> u64| {
            let mut words = [0; RUN_STEPS];
            for (step, own) in words.iter_mut().enumerate() {
                *own = word(step);
            }
            for (place, plane) in planes.by_ref().take(count).enumerate() {
                for (own, word) in plane.iter_mut().zip(&words) {
                    *own = (word >> (8 * place)) as u8;
                }
            }
        };
        put(8, &|step| self.valid[step]);
        put(4, &|step| self.counts[step].into());
        put(8, &|step| self.weights[step].cast_unsigned());
        for sums in [&self.sums, &self.squares] {
            put(8, &|step| sums[step] as u64);
            put(8, &|step| (sums[step] >> 64) as u64);
        }
    }

    /// Reads one of [`RECORD_BYTES`] bytes; squares stay what they are unless they are wanted.
    ///
    /// # Errors
    /// It begins as no record does.
    pub(crate) fn read(&mut self, bytes: &[u8], with_squares: bool) -> Result<(), String> {
        self.is_summed = match bytes.first() {
            Some(0) => true,
            Some(&UNSUMMED) => false,
            other => {
                return Err(format!(
                    "it begins with {other:?}, as no record of sums does"
                ));
            }
        };
        let mut rest = &bytes[HEADER_BYTES..];
        let mut word = |count: usize| {
            let (planes, others) = rest.split_at(count * RUN_STEPS);
            rest = others;
            words(planes)
        };
        self.valid.copy_from_slice(&word(8));
        for (own, count) in self.counts.iter_mut().zip(word(4)) {
            *own = count as u32;
        }
        for (own, weight) in self.weights.iter_mut().zip(word(8)) {
            *own = weight.cast_signed();
        }
        let squares = with_squares.then_some(&mut self.squares);
        for sums in [Some(&mut self.sums), squares].into_iter().flatten() {
            let (low, high) = (word(8), word(8));
            for (own, (low, high)) in sums.iter_mut().zip(low.into_iter().zip(high)) {
                *own = i128::from(high.cast_signed()) << 64 | i128::from(low);
            }
        }
        Ok(())
    }
}

/// Side of the squares of bytes that are turned at a time.
const SIDE: usize = size_of::<u64>();

/// Words of up to eight bytes, from planes of the lowest byte of all steps, the next one of all, and so on.
fn words(planes: &[u8]) -> [u64; RUN_STEPS] {
    let mut words = [0; RUN_STEPS];
    for (at, words) in words.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
        let mut square = [0; SIDE];
        for (row, plane) in square.iter_mut().zip(planes.as_chunks::<RUN_STEPS>().0) {
            *row = u64::from_le_bytes(plane.as_chunks().0[at]);
        }
        *words = turned(square);
    }
    words
}

/// A square of bytes with its rows as columns: halves are exchanged, then quarters, then single bytes.
fn turned(mut rows: [u64; SIDE]) -> [u64; SIDE] {
    for (distance, mask) in [
        (4, 0x0000_0000_FFFF_FFFF),
        (2, 0x0000_FFFF_0000_FFFF),
        (1, 0x00FF_00FF_00FF_00FF),
    ] {
        for row in (0..SIDE).filter(|row| row & distance == 0) {
            let other = row + distance;
            let exchanged = ((rows[row] >> (8 * distance)) ^ rows[other]) & mask;
            rows[other] ^= exchanged;
            rows[row] ^= exchanged << (8 * distance);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_made_of_the_bytes_of_their_planes() {
        for count in [1, 4, 8] {
            let planes: Vec<u8> = (0..count * RUN_STEPS)
                .map(|at| (at * 7919 % 251) as u8)
                .collect();
            for (step, word) in words(&planes).into_iter().enumerate() {
                let byte =
                    |place: usize| u64::from(planes[place * RUN_STEPS + step]) << (8 * place);
                assert_eq!(word, (0..count).map(byte).sum::<u64>(), "{count} {step}");
            }
        }
    }

    #[test]
    fn bytes_lead_back_and_nothing_is_all_zeros() {
        let mut bytes = vec![7; RECORD_BYTES];
        Record::default().write(&mut bytes);
        assert!(bytes.iter().all(|byte| *byte == 0));
        let mut own = Record::default();
        for step in 0..RUN_STEPS {
            let number = step as i128 + 3;
            own.valid[step] = u64::MAX / (step as u64 + 1);
            own.counts[step] = u32::MAX - step as u32;
            own.weights[step] = i64::MAX - step as i64;
            own.sums[step] = -(number << 90) + 5;
            own.squares[step] = i128::MAX / number;
        }
        for is_summed in [true, false] {
            own.is_summed = is_summed;
            own.write(&mut bytes);
            let mut back = Record::default();
            back.read(&bytes, true).unwrap();
            assert_eq!(back, own);
            let mut without = Record::default();
            without.read(&bytes, false).unwrap();
            assert_eq!((&without.sums, &without.valid), (&own.sums, &own.valid));
            assert_eq!(without.squares, Record::default().squares);
        }
        bytes[0] = 2;
        assert!(Record::default().read(&bytes, true).is_err());
    }
}
