//! Objects of a cube, that is of an Icechunk repository: chunks of arrays, which end in a checksum of their own, and what
//! names them (snapshots, manifests, logs of transactions, `repo`), which its library compresses and does not check. That
//! is sealed here, where decoders pass over it.

use contract::key::ObjectKey;

use super::seal::{self, Seal};
use super::{Soundness, UNSEALED};

/// Folder of chunks.
const CHUNKS: &str = "chunks";
/// Most chunks of a shard: as many entries has the index at its end.
const MOST_CHUNKS: usize = 1 << 16;
/// Place and length of a chunk in a shard, bytes.
const ENTRY_BYTES: usize = 16;
const CRC_BYTES: usize = 4;

/// The name of an object in its repository, which is a folder of a product in the folder of all cubes.
pub(super) fn name_of(key: &ObjectKey) -> &str {
    key.as_str().splitn(3, '/').nth(2).unwrap_or_default()
}

/// Is this the name of a chunk? Its content is an array's, and its checksum the array's own.
fn is_chunk(name: &str) -> bool {
    name.split('/').next() == Some(CHUNKS)
}

/// The content of an object as it is stored: sealed, unless it is a chunk.
pub fn sealed(name: &str, content: &[u8]) -> Option<Vec<u8>> {
    (!is_chunk(name)).then(|| seal::zstd(content))
}

/// Compares the content of an object with its checksums or its seal; what another program wrote has no seal.
///
/// # Errors
/// Why it is not what was stored.
pub fn check(name: &str, content: &[u8]) -> Result<Soundness, &'static str> {
    if is_chunk(name) {
        return if is_right(content) || is_right_shard(content) {
            Ok(Soundness::Sound)
        } else {
            Err("its bytes are not those of its checksum (crc32c)")
        };
    }
    match seal::of_zstd(content) {
        Seal::Whole => Ok(Soundness::Sound),
        Seal::Broken => Err("its bytes are not those that were sealed"),
        Seal::Absent => Ok(Soundness::Unsealed),
    }
}

/// The same of a cube in a store: nobody else writes there, and all that is there was sealed.
///
/// # Errors
/// Why it is not what was stored.
pub fn check_own(name: &str, content: &[u8]) -> Result<(), &'static str> {
    match check(name, content)? {
        Soundness::Sound => Ok(()),
        Soundness::Unsealed => Err(UNSEALED),
    }
}

/// Does this end in its own checksum?
fn is_right(content: &[u8]) -> bool {
    content
        .split_last_chunk::<CRC_BYTES>()
        .is_some_and(|(data, told)| crc32c::crc32c(data) == u32::from_le_bytes(*told))
}

/// Is this a shard: chunks that end in their checksums, and an index of them that does, too, and nothing besides?
///
/// How many chunks it has is its array's to say, which is not at hand here: from the end backwards its index is as long as
/// makes the chunks that it names fill the rest.
fn is_right_shard(content: &[u8]) -> bool {
    let Some(entries) = content
        .len()
        .checked_sub(CRC_BYTES)
        .map(|at| &content[..at])
    else {
        return false;
    };
    let mut named_bytes = 0_u64;
    for (number, entry) in entries
        .rchunks_exact(ENTRY_BYTES)
        .take(MOST_CHUNKS)
        .enumerate()
    {
        let rest = entries.len() - (number + 1) * ENTRY_BYTES;
        if let Some((_, length)) = place_of(entry) {
            named_bytes = named_bytes.saturating_add(length);
        }
        if named_bytes == rest as u64 {
            let (chunks, index) = content.split_at(rest);
            if is_right(index) {
                return are_right(chunks, &index[..index.len() - CRC_BYTES]);
            }
        }
    }
    false
}

/// Where a chunk lies in its shard, and its length; none of one without data, which is not stored.
fn place_of(entry: &[u8]) -> Option<(u64, u64)> {
    let number = |bytes: &[u8]| bytes.try_into().map_or(u64::MAX, u64::from_le_bytes);
    let (offset, length) = entry.split_at(ENTRY_BYTES / 2);
    let place = (number(offset), number(length));
    (place != (u64::MAX, u64::MAX)).then_some(place)
}

/// Do all chunks that an index names end in their checksums?
fn are_right(chunks: &[u8], index: &[u8]) -> bool {
    index
        .chunks_exact(ENTRY_BYTES)
        .filter_map(place_of)
        .all(|(offset, length)| {
            let end = offset.saturating_add(length).min(chunks.len() as u64);
            let chunk = chunks.get(offset as usize..end as usize);
            chunk.is_some_and(is_right)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_crc(data: &[u8]) -> Vec<u8> {
        [data, &crc32c::crc32c(data).to_le_bytes()].concat()
    }

    /// Chunks of the shard of these tests.
    const SHARD_CHUNKS: usize = 64;

    /// A shard of two chunks.
    fn shard() -> Vec<u8> {
        let (one, two) = (with_crc(b"some values"), with_crc(b"others"));
        let mut index = vec![u64::MAX; SHARD_CHUNKS * 2];
        (index[4], index[5]) = (0, one.len() as u64);
        (index[6], index[7]) = (one.len() as u64, two.len() as u64);
        let index: Vec<u8> = index.iter().flat_map(|it| it.to_le_bytes()).collect();
        [one, two, with_crc(&index)].concat()
    }

    #[test]
    fn no_bit_of_a_chunk_or_a_shard_or_of_what_names_them_can_change_unseen() {
        let metadata = sealed("snapshots/A", b"compressed").unwrap();
        for (name, content) in [
            ("chunks/A", with_crc(b"values")),
            ("chunks/B", shard()),
            ("snapshots/A", metadata),
        ] {
            assert_eq!(check(name, &content), Ok(Soundness::Sound), "{name}");
            for at in 0..content.len() * 8 {
                let mut flipped = content.clone();
                flipped[at / 8] ^= 1 << (at % 8);
                assert!(check(name, &flipped).is_err(), "{name}: bit {at}");
            }
        }
        assert_eq!(sealed("chunks/A", b""), None);
        assert_eq!(check("repo", b"of others"), Ok(Soundness::Unsealed));
        assert!(check("chunks/A", b"").is_err());
    }

    #[test]
    fn what_names_chunks_and_lost_its_seal_is_damaged_in_a_store() {
        let whole = sealed("snapshots/A", b"compressed").unwrap();
        let key: ObjectKey = "cubes/p/snapshots/A".parse().unwrap();
        let is_sound = |content: &[u8]| super::super::of_bytes(&key, content).is_ok();
        assert!(is_sound(&whole));
        for length in 0..whole.len() {
            assert!(!is_sound(&whole[..length]), "{length} bytes");
        }
        assert!(!is_sound(&[&whole[..], b"x"].concat()));
    }

    #[test]
    fn a_shard_with_bytes_that_no_chunk_holds_is_none() {
        let mut longer = shard();
        longer.insert(0, 7);
        assert!(check("chunks/A", &longer).is_err());
    }

    #[test]
    fn the_name_in_its_repository_is_what_follows_the_product() {
        let key: ObjectKey = "cubes/p/chunks/A".parse().unwrap();
        assert_eq!(name_of(&key), "chunks/A");
    }
}
