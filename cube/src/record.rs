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

    /// Reads what is wanted of one of [`RECORD_BYTES`] bytes, and whether it holds sums; the rest stays what it is.
    ///
    /// # Errors
    /// It begins as no record does.
    pub(crate) fn read(&mut self, bytes: &[u8], wanted: Numbers) -> Result<(), String> {
        self.is_summed = match bytes.first() {
            Some(0) => true,
            Some(&UNSUMMED) => false,
            other => {
                return Err(format!(
                    "it begins with {other:?}, as no record of sums does"
                ));
            }
        };
        let (planes, _rest) = bytes[HEADER_BYTES..].as_chunks::<RUN_STEPS>();
        // Planes of each number one after the other.
        let (valid, rest) = planes.split_at(8);
        if wanted == Numbers::Valid {
            self.valid.copy_from_slice(&words(valid));
            return Ok(());
        }
        let (counts, rest) = rest.split_at(4);
        self.counts.copy_from_slice(&halves(counts));
        let (weights, mut rest) = rest.split_at(8);
        for (own, weight) in self.weights.iter_mut().zip(words(weights)) {
            *own = weight.cast_signed();
        }
        let squares = (wanted == Numbers::SumsAndSquares).then_some(&mut self.squares);
        for sums in [Some(&mut self.sums), squares].into_iter().flatten() {
            let (low, high) = (words(rest), words(&rest[8..]));
            for (own, (low, high)) in sums.iter_mut().zip(low.into_iter().zip(high)) {
                *own = i128::from(high.cast_signed()) << 64 | i128::from(low);
            }
            rest = &rest[16..];
        }
        Ok(())
    }
}

/// Numbers of a record that somebody needs: sums need no cells, and a block on the coast is read for its cells alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// Cells of the block itself that hold data.
    Valid,
    /// Counts, weights and sums.
    Sums,
    /// These, and squares.
    SumsAndSquares,
}

/// The same byte of the word of every step.
type Plane = [u8; RUN_STEPS];

/// Words of four bytes, of planes of the lowest byte first.
///
/// Bytes are paired, then pairs, in plain loops: compilers make them interleave sixteen and more of them at a time.
fn halves(planes: &[Plane]) -> [u32; RUN_STEPS] {
    let (mut low, mut high) = ([0u16; RUN_STEPS], [0u16; RUN_STEPS]);
    for (pairs, planes) in [&mut low, &mut high]
        .into_iter()
        .zip(planes.chunks_exact(2))
    {
        for ((pair, low), high) in pairs.iter_mut().zip(&planes[0]).zip(&planes[1]) {
            *pair = u16::from(*low) | u16::from(*high) << 8;
        }
    }
    let mut words = [0; RUN_STEPS];
    for ((word, low), high) in words.iter_mut().zip(&low).zip(&high) {
        *word = u32::from(*low) | u32::from(*high) << 16;
    }
    words
}

/// Words of eight bytes, of as many planes or more.
fn words(planes: &[Plane]) -> [u64; RUN_STEPS] {
    let (low, high) = (halves(planes), halves(&planes[4..]));
    let mut words = [0; RUN_STEPS];
    for ((word, low), high) in words.iter_mut().zip(&low).zip(&high) {
        *word = u64::from(*low) | u64::from(*high) << 32;
    }
    words
}

#[cfg(test)]
mod tests {
    use std::array::from_fn;

    use super::*;

    #[test]
    fn words_are_made_of_the_bytes_of_their_planes() {
        let byte = |place: usize, step: usize| ((place * RUN_STEPS + step) * 7919 % 251) as u8;
        let planes: Vec<Plane> = (0..8)
            .map(|place| from_fn(|step| byte(place, step)))
            .collect();
        for step in 0..RUN_STEPS {
            let bytes: [u8; 8] = from_fn(|place| byte(place, step));
            assert_eq!(words(&planes)[step], u64::from_le_bytes(bytes), "{step}");
            let bytes: [u8; 4] = from_fn(|place| byte(place, step));
            assert_eq!(halves(&planes)[step], u32::from_le_bytes(bytes), "{step}");
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
            back.read(&bytes, Numbers::SumsAndSquares).unwrap();
            let nothing = Record::default();
            assert_eq!(back.valid, nothing.valid);
            let mut without = Record::default();
            without.read(&bytes, Numbers::Sums).unwrap();
            assert_eq!((&without.sums, &without.valid), (&own.sums, &nothing.valid));
            assert_eq!(without.squares, nothing.squares);
            let mut cells = Record::default();
            cells.read(&bytes, Numbers::Valid).unwrap();
            assert_eq!((&cells.valid, &cells.sums), (&own.valid, &nothing.sums));
            assert_eq!(cells.is_summed, is_summed);
            back.read(&bytes, Numbers::Valid).unwrap();
            assert_eq!(back, own);
        }
        bytes[0] = 2;
        assert!(Record::default().read(&bytes, Numbers::Sums).is_err());
    }
}
