//! Seals: the digest of an object's bytes, kept inside it where readers of its format pass over it.
//!
//! A JSON document ends in a member `sha256`, the digest of the text without that member. A Parquet file has a mark and
//! the digest of all its other bytes between its last page and its footer, where no address in it points to. What is
//! compressed with zstd to its end has both in a frame of its own there, of the kind that decoders skip. One flipped bit breaks a seal or what it seals, never both: what had a seal is then broken, or no file of its format any more.

use contract::digest::Digest;
use sha2::{Digest as _, Sha256};

/// Before the digest in a Parquet file.
const MARK: &[u8; 8] = b"FLUXSEAL";
const DIGEST_BYTES: usize = 32;
const SEAL_BYTES: usize = MARK.len() + DIGEST_BYTES;
/// Length of the footer and the format's name, the last bytes of a Parquet file.
const END_BYTES: usize = 8;
/// The same, for who reads them first.
pub(crate) const PARQUET_END_BYTES: u64 = END_BYTES as u64;
const PARQUET: &[u8; 4] = b"PAR1";
/// Begins a frame that decoders of zstd skip (RFC 8878, section 3.1.2), and the length of what follows in it.
const SKIPPED: [u8; 4] = 0x184D_2A50_u32.to_le_bytes();
const SKIPPED_BYTES: [u8; 4] = (SEAL_BYTES as u32).to_le_bytes();
/// Before the digest in a document.
const MEMBER: &[u8] = b",\"sha256\":\"";
/// After it.
const MEMBER_END: &[u8] = b"\"}";
const HEX_BYTES: usize = 64;

/// What became of an object's seal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seal {
    /// The bytes are those that were sealed.
    Whole,
    /// They are others.
    Broken,
    /// There is none.
    Absent,
}

/// Seals the text of a JSON object that has members.
pub fn json(mut text: Vec<u8>) -> Vec<u8> {
    let digest = Digest::of(&text);
    debug_assert!(text.len() > 2 && text.ends_with(b"}"), "an object");
    text.pop();
    text.extend_from_slice(MEMBER);
    text.extend_from_slice(digest.to_string().as_bytes());
    text.extend_from_slice(MEMBER_END);
    text
}

/// The text of a document without its seal.
pub fn opened(content: &[u8]) -> Vec<u8> {
    match parts_of_json(content) {
        Some((before, _)) => [before, b"}"].concat(),
        None => content.to_vec(),
    }
}

/// The seal of a JSON document.
pub(crate) fn of_json(content: &[u8]) -> Seal {
    match parts_of_json(content) {
        None => Seal::Absent,
        Some((before, told)) => {
            let found = digest_of(before, b"}");
            whole_if(found.to_string().as_bytes() == told)
        }
    }
}

/// What stands before the seal, and the digest in it.
fn parts_of_json(content: &[u8]) -> Option<(&[u8], &[u8])> {
    let rest = content.strip_suffix(MEMBER_END)?;
    let (rest, told) = rest.split_at_checked(rest.len().checked_sub(HEX_BYTES)?)?;
    Some((rest.strip_suffix(MEMBER)?, told))
}

/// Seals a Parquet file; bytes that are none are left as they are.
pub fn parquet(mut content: Vec<u8>) -> Vec<u8> {
    if let Some(footer) = footer_of(&content) {
        let digest: [u8; DIGEST_BYTES] = Sha256::digest(&content).into();
        content.splice(footer..footer, MARK.iter().copied().chain(digest));
    }
    content
}

/// The seal of a Parquet file.
pub(crate) fn of_parquet(content: &[u8]) -> Seal {
    let sealed = || {
        let footer = footer_of(content)?;
        let (before, end) = content.split_at(footer);
        let (data, seal) = before.split_at_checked(before.len().checked_sub(SEAL_BYTES)?)?;
        let (mark, told) = seal.split_at(MARK.len());
        let told: [u8; DIGEST_BYTES] = told.try_into().ok()?;
        let is_right = digest_of(data, end) == Digest::from_bytes(told);
        Some((mark == MARK, is_right))
    };
    match sealed() {
        Some((true, true)) => Seal::Whole,
        // A mark or a digest alone: the other one was there.
        Some((true, false) | (false, true)) => Seal::Broken,
        Some((false, false)) | None => Seal::Absent,
    }
}

/// Seals a Parquet file whose pages are hashed already: `end` is all behind the last of them, indexes of pages and footer.
pub(crate) fn parquet_end(mut pages: Sha256, mut end: Vec<u8>) -> Vec<u8> {
    if let Some(footer) = footer_of(&end) {
        pages.update(&end);
        let digest: [u8; DIGEST_BYTES] = pages.finalize().into();
        end.splice(footer..footer, MARK.iter().copied().chain(digest));
    }
    end
}

/// The seal of a Parquet file that comes piece by piece.
pub(crate) struct SealCheck {
    /// Where the seal should lie; none if the file has no place for one.
    place: Option<std::ops::Range<u64>>,
    at: u64,
    others: Sha256,
    seal: Vec<u8>,
}

impl SealCheck {
    /// Of a file of so many bytes that ends in these ([`PARQUET_END_BYTES`] of them).
    pub(crate) fn new(size_bytes: u64, end: &[u8]) -> Self {
        let place = || {
            let (length, name) = end.split_first_chunk::<4>()?;
            let footer = u64::from(u32::from_le_bytes(*length)) + PARQUET_END_BYTES;
            let seal_end = size_bytes.checked_sub(footer).filter(|_| name == PARQUET)?;
            Some(seal_end.checked_sub(SEAL_BYTES as u64)?..seal_end)
        };
        Self {
            place: place(),
            at: 0,
            others: Sha256::new(),
            seal: vec![],
        }
    }

    /// Takes the next bytes.
    pub(crate) fn update(&mut self, piece: &[u8]) {
        let (start, end) = self.place.clone().map_or((0, 0), |p| (p.start, p.end));
        let inside = |place: u64| {
            let offset = place.clamp(self.at, self.at + piece.len() as u64) - self.at;
            offset as usize
        };
        let (first, last) = (inside(start), inside(end));
        self.others.update(&piece[..first]);
        self.seal.extend_from_slice(&piece[first..last]);
        self.others.update(&piece[last..]);
        self.at += piece.len() as u64;
    }

    /// What became of the seal.
    pub(crate) fn finish(self) -> Seal {
        if self.seal.len() != SEAL_BYTES {
            return Seal::Absent;
        }
        let (mark, told) = self.seal.split_at(MARK.len());
        let found: [u8; DIGEST_BYTES] = self.others.finalize().into();
        match (mark == MARK, told == found) {
            (true, true) => Seal::Whole,
            // A mark or a digest alone: the other one was there.
            (true, false) | (false, true) => Seal::Broken,
            (false, false) => Seal::Absent,
        }
    }
}

/// Seals content that is compressed with zstd to its end.
pub fn zstd(content: &[u8]) -> Vec<u8> {
    let digest: [u8; DIGEST_BYTES] = Sha256::digest(content).into();
    [content, &SKIPPED, &SKIPPED_BYTES, MARK, &digest].concat()
}

/// The seal of such content.
pub(crate) fn of_zstd(content: &[u8]) -> Seal {
    let begin = [&SKIPPED[..], &SKIPPED_BYTES, MARK].concat();
    let at = content.len().checked_sub(begin.len() + DIGEST_BYTES);
    let Some((data, seal)) = at.and_then(|at| content.split_at_checked(at)) else {
        return Seal::Absent;
    };
    let (found, told) = seal.split_at(begin.len());
    let told: Result<[u8; DIGEST_BYTES], _> = told.try_into();
    let is_right = told.is_ok_and(|told| Digest::of(data) == Digest::from_bytes(told));
    match (found == begin, is_right) {
        (true, true) => Seal::Whole,
        // Its beginning or a digest alone: the other one was there.
        (true, false) | (false, true) => Seal::Broken,
        (false, false) => Seal::Absent,
    }
}

/// Where the footer of a Parquet file begins.
fn footer_of(content: &[u8]) -> Option<usize> {
    let (before, end) = content.split_at_checked(content.len().checked_sub(END_BYTES)?)?;
    let (length, name) = end.split_first_chunk::<4>()?;
    if name != PARQUET {
        return None;
    }
    before
        .len()
        .checked_sub(u32::from_le_bytes(*length) as usize)
}

fn digest_of(a: &[u8], b: &[u8]) -> Digest {
    let mut hasher = Sha256::new();
    hasher.update(a);
    hasher.update(b);
    Digest::from_bytes(hasher.finalize().into())
}

fn whole_if(is_whole: bool) -> Seal {
    if is_whole { Seal::Whole } else { Seal::Broken }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sealed_document_is_json_and_opens_as_what_it_was() {
        let text = br#"{"schema":2,"a":[1,{"b":"}"}]}"#;
        let sealed = json(text.to_vec());
        assert_eq!(of_json(&sealed), Seal::Whole);
        assert_eq!(opened(&sealed), text);
        assert_eq!(
            (of_json(text), &opened(text)[..]),
            (Seal::Absent, &text[..])
        );
        let read: serde_json::Value = serde_json::from_slice(&sealed).unwrap();
        assert_eq!(read["sha256"], Digest::of(text).to_string());
    }

    #[test]
    fn no_bit_of_a_sealed_document_can_change_unseen() {
        let sealed = json(br#"{"schema":2,"a":"text"}"#.to_vec());
        for at in 0..sealed.len() * 8 {
            let mut flipped = sealed.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert_ne!(of_json(&flipped), Seal::Whole, "bit {at}");
        }
    }

    #[test]
    fn no_bit_of_sealed_zstd_can_change_unseen() {
        let content = b"a header and frames";
        assert_eq!(
            (of_zstd(content), of_zstd(b"")),
            (Seal::Absent, Seal::Absent)
        );
        let sealed = zstd(content);
        assert_eq!(of_zstd(&sealed), Seal::Whole);
        for at in 0..sealed.len() * 8 {
            let mut flipped = sealed.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert_eq!(of_zstd(&flipped), Seal::Broken, "bit {at}");
        }
    }

    /// The seal of a file that comes in pieces of seven bytes.
    fn of_pieces(file: &[u8]) -> Seal {
        let end = &file[file.len().saturating_sub(END_BYTES)..];
        let mut check = SealCheck::new(file.len() as u64, end);
        file.chunks(7).for_each(|piece| check.update(piece));
        check.finish()
    }

    #[test]
    fn no_bit_of_a_sealed_table_can_change_unseen() {
        // Pages, a footer of three bytes, its length, the format's name.
        let file = b"PAR1pages\x01\x02\x03\x03\0\0\0PAR1".to_vec();
        assert_eq!(of_parquet(&file), Seal::Absent);
        let sealed = parquet(file.clone());
        let (pages, end) = file.split_at(6);
        let in_parts = parquet_end(Sha256::new_with_prefix(pages), end.to_vec());
        assert_eq!([pages, &in_parts].concat(), sealed);
        assert_eq!(
            (of_parquet(&sealed), of_pieces(&sealed)),
            (Seal::Whole, Seal::Whole)
        );
        assert_eq!(of_pieces(&file), Seal::Absent);
        for at in 0..sealed.len() * 8 {
            let mut flipped = sealed.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert_ne!(of_parquet(&flipped), Seal::Whole, "bit {at}");
            assert_ne!(of_pieces(&flipped), Seal::Whole, "bit {at}");
        }
        assert_eq!(of_parquet(b""), Seal::Absent);
        assert_eq!(of_parquet(b"\xff\xff\xff\xffPAR1"), Seal::Absent);
    }
}
