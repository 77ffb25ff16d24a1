//! The check of one row of a stored table: readers of parts of a file have nothing else to compare with.
//!
//! A CRC-32 (ISO 3309) of what says which row it is, and of its values: it finds every flipped bit, every run of flipped
//! bits up to 32, and a row that stands for another.

use crc32fast::Hasher;

/// Values added at a time; their bytes fit the nearest cache.
const AT_ONCE: usize = 1024;

/// A check under way; the order of what is added counts.
#[derive(Debug, Clone, Default)]
pub struct RowCheck(Hasher);

impl RowCheck {
    /// Nothing added yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a number of a row: its chunk, its block.
    #[must_use]
    pub fn u32(mut self, number: u32) -> Self {
        self.0.update(&number.to_le_bytes());
        self
    }

    /// Adds an instant, ms.
    #[must_use]
    pub fn i64(mut self, number: i64) -> Self {
        self.0.update(&number.to_le_bytes());
        self
    }

    /// Adds values bit by bit.
    #[must_use]
    pub fn f32s(mut self, values: &[f32]) -> Self {
        let mut bytes = [0; 4 * AT_ONCE];
        for some in values.chunks(AT_ONCE) {
            for (to, value) in bytes.chunks_exact_mut(4).zip(some) {
                to.copy_from_slice(&value.to_le_bytes());
            }
            self.0.update(&bytes[..4 * some.len()]);
        }
        self
    }

    /// The same of wider values.
    #[must_use]
    pub fn f64s(mut self, values: &[f64]) -> Self {
        let mut bytes = [0; 8 * AT_ONCE];
        for some in values.chunks(AT_ONCE) {
            for (to, value) in bytes.chunks_exact_mut(8).zip(some) {
                to.copy_from_slice(&value.to_le_bytes());
            }
            self.0.update(&bytes[..8 * some.len()]);
        }
        self
    }

    /// The check.
    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_is_the_published_one() {
        // The check value of CRC-32/ISO-HDLC: of the text 123456789, here as two numbers and a value.
        let first = u32::from_le_bytes(*b"1234");
        let value = f32::from_le_bytes(*b"5678");
        assert_eq!(
            RowCheck::new().u32(first).f32s(&[value]).finish(),
            crc32fast::hash(b"12345678")
        );
        assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn every_bit_and_the_place_of_a_row_count() {
        let values: Vec<f32> = (0..2500).map(|i| i as f32).collect();
        let of = |chunk, values: &[f32]| RowCheck::new().u32(chunk).f32s(values).finish();
        assert_ne!(of(1, &values), of(2, &values));
        for at in [0, 1023, 1024, 2499] {
            for bit in 0..32 {
                let mut flipped = values.clone();
                flipped[at] = f32::from_bits(flipped[at].to_bits() ^ (1 << bit));
                assert_ne!(of(1, &flipped), of(1, &values));
            }
        }
    }
}
