//! The checks that a PNG holds of its own parts (ISO/IEC 15948, 5.3): every chunk ends in a CRC-32 of itself.

const SIGNATURE: &[u8; 8] = b"\x89PNG\r\n\x1a\n";
/// Length and kind before the data of a chunk, and the check after them.
const LENGTH_BYTES: usize = 4;
const KIND_BYTES: usize = 4;
const CHECK_BYTES: usize = 4;

/// Are all parts of a picture as they were written, from the signature to the end?
pub(super) fn check(content: &[u8]) -> Result<(), &'static str> {
    let mut rest = content
        .strip_prefix(SIGNATURE)
        .ok_or("it does not begin as a PNG does")?;
    loop {
        let (length, after) = rest
            .split_first_chunk::<LENGTH_BYTES>()
            .ok_or("it ends early")?;
        let length = u32::from_be_bytes(*length) as usize;
        let checked = after.get(..KIND_BYTES + length).ok_or("it ends early")?;
        let told = after[checked.len()..]
            .first_chunk::<CHECK_BYTES>()
            .ok_or("it ends early")?;
        if crc32fast::hash(checked) != u32::from_be_bytes(*told) {
            return Err("a part of it differs from its check");
        }
        rest = &after[checked.len() + CHECK_BYTES..];
        if checked.starts_with(b"IEND") {
            return if rest.is_empty() {
                Ok(())
            } else {
                Err("something follows its end")
            };
        }
    }
}

/// One black pixel, as another program wrote it.
#[cfg(test)]
pub(super) const PIXEL: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0\x3a\x7e\x9b\x55\
    \0\0\0\nIDAT\x78\xda\x63\x60\0\0\0\x02\0\x01\xe5\x27\xde\xfc\0\0\0\0IEND\xae\x42\x60\x82";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_flipped_anywhere_in_a_picture_is_found() {
        assert_eq!(check(PIXEL), Ok(()));
        for at in 0..PIXEL.len() * 8 {
            let mut flipped = PIXEL.to_vec();
            flipped[at / 8] ^= 1 << (at % 8);
            assert!(check(&flipped).is_err(), "bit {at}");
        }
        for length in 0..PIXEL.len() {
            assert!(check(&PIXEL[..length]).is_err(), "{length} bytes");
        }
    }
}
