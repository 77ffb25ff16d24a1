//! Whole numbers one behind the other, as accumulators pass from process to process: little-endian.

/// Reads them.
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(super) fn i128(&mut self) -> Option<i128> {
        self.take().map(i128::from_le_bytes)
    }

    /// A number as [`put_short`] writes it; none if it is cut off, or of more bits.
    pub(super) fn short(&mut self) -> Option<u128> {
        // Nearly all have few bits.
        let mut low = 0;
        for at in 0..LOW_BYTES {
            let byte = *self.0.get(at as usize)?;
            low |= u64::from(byte & LOW) << (BITS * at);
            if byte & MORE == 0 {
                self.0 = &self.0[at as usize + 1..];
                return Some(low.into());
            }
        }
        self.long()
    }

    /// The same of a number of any bits.
    fn long(&mut self) -> Option<u128> {
        let mut number = 0;
        for at in 0..SHORT_BYTES {
            let [byte] = self.take()?;
            let part = u128::from(byte & LOW) << (BITS * at);
            if part >> (BITS * at) != u128::from(byte & LOW) {
                return None;
            }
            number |= part;
            if byte & MORE == 0 {
                return Some(number);
            }
        }
        None
    }
}

/// Bits of a number in a byte, the lowest first; the highest bit of the byte says that more follow.
const BITS: u32 = 7;
const LOW: u8 = 0x7f;
const MORE: u8 = 0x80;
/// Bytes of a number of 128 bits.
const SHORT_BYTES: u32 = u128::BITS.div_ceil(BITS);

/// Bytes of a number that 64 bits hold, whatever it is.
const LOW_BYTES: u32 = u64::BITS / BITS;

/// Writes a number in as few bytes as its bits need (LEB128).
pub(super) fn put_short(out: &mut Vec<u8>, mut number: u128) {
    loop {
        let low = number as u8 & LOW;
        number >>= BITS;
        if number == 0 {
            out.push(low);
            return;
        }
        out.push(low | MORE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_are_read_as_they_are_written() {
        for number in [
            0,
            1,
            127,
            128,
            1 << 62,
            (1 << 63) - 1,
            1 << 63,
            u128::MAX >> 1,
            u128::MAX,
        ] {
            let mut out = vec![];
            put_short(&mut out, number);
            let bits = u128::BITS - number.leading_zeros();
            assert_eq!(out.len() as u32, bits.div_ceil(BITS).max(1));
            let mut reader = Reader::new(&out);
            assert_eq!((reader.short(), reader.is_empty()), (Some(number), true));
            assert_eq!(Reader::new(&out[..out.len() - 1]).short(), None);
        }
        // A bit too many, and no end.
        let mut long = [MORE; 19];
        long[18] = 0x04;
        assert_eq!(Reader::new(&long).short(), None);
        assert_eq!(Reader::new(&[0xff; 30]).short(), None);
    }
}
