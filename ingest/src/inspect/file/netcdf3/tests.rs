//! The classic reader against thousands of damaged headers: refusals, never a panic, never more memory than the file.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::*;

/// A CDF-1 file by hand: 2 records of `v(t, x)` int16 with x = 3, and a float64 scalar-like `s(one)`.
fn by_hand() -> Vec<u8> {
    let mut bytes = b"CDF\x01".to_vec();
    let put = |bytes: &mut Vec<u8>, words: &[u32]| {
        bytes.extend(words.iter().flat_map(|w| w.to_be_bytes()));
    };
    let name = |bytes: &mut Vec<u8>, text: &str| {
        bytes.extend((text.len() as u32).to_be_bytes());
        bytes.extend(text.bytes());
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    };
    put(&mut bytes, &[2, 10, 3]);
    for (dimension, len) in [("t", 0), ("x", 3), ("one", 1)] {
        name(&mut bytes, dimension);
        put(&mut bytes, &[len]);
    }
    put(&mut bytes, &[12, 1]);
    name(&mut bytes, "title");
    put(&mut bytes, &[2]);
    name(&mut bytes, "by hand");
    put(&mut bytes, &[11, 2]);
    name(&mut bytes, "v");
    put(&mut bytes, &[2, 0, 1, 0, 0, 3, 6]);
    let begin_of_v = bytes.len();
    put(&mut bytes, &[0]);
    name(&mut bytes, "s");
    put(&mut bytes, &[1, 2, 0, 0, 6, 8]);
    let begin_of_s = bytes.len();
    put(&mut bytes, &[0]);
    let s = bytes.len() as u32;
    bytes.extend(2.5f64.to_be_bytes());
    let v = bytes.len() as u32;
    // The only record variable: records of 6 bytes, without padding.
    let stored = [1i16, 2, 3, -4, -5, -6];
    bytes.extend(stored.iter().flat_map(|n| n.to_be_bytes()));
    bytes[begin_of_v..begin_of_v + 4].copy_from_slice(&v.to_be_bytes());
    bytes[begin_of_s..begin_of_s + 4].copy_from_slice(&s.to_be_bytes());
    bytes
}

fn open(bytes: &[u8]) -> Result<NetCdf3File, Rejection> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.nc");
    std::fs::write(&path, bytes).unwrap();
    NetCdf3File::open(&path, Version::Classic)
}

#[test]
fn a_file_written_by_hand_reads_as_written() {
    let mut file = open(&by_hand()).unwrap();
    assert_eq!(file.description().attributes.text("title"), Some("by hand"));
    assert_eq!(
        file.read("v", &[Part::All, Part::All]).unwrap(),
        [1.0, 2.0, 3.0, -4.0, -5.0, -6.0]
    );
    assert_eq!(
        file.read("v", &[Part::At(1), Part::All]).unwrap(),
        [-4.0, -5.0, -6.0]
    );
    assert_eq!(
        file.read("v", &[Part::All, Part::At(2)]).unwrap(),
        [3.0, -6.0]
    );
    assert_eq!(file.read("v", &[Part::At(1), Part::At(0)]).unwrap(), [-4.0]);
    let some = |first, count| Part::Some { first, count };
    let rows = [some(0, 2), some(1, 1), Part::All].map(|part| file.read("v", &[part, some(1, 2)]));
    let found = rows.map(Result::unwrap);
    assert_eq!(found[0], [2.0, 3.0, -5.0, -6.0]);
    assert_eq!((&found[1][..], &found[2]), (&[-5.0, -6.0][..], &found[0]));
    assert!(file.read("v", &[Part::All, some(2, 2)]).is_err());
    assert!(file.read("v", &[some(1, u64::MAX), Part::All]).is_err());
    assert_eq!(file.read("s", &[Part::All]).unwrap(), [2.5]);
    assert!(file.read("v", &[Part::At(2), Part::All]).is_err());
    assert!(file.read("v", &[Part::All]).is_err() && file.read("w", &[]).is_err());
}

#[test]
fn an_open_number_of_records_is_counted_from_the_length() {
    let mut bytes = by_hand();
    bytes[4..8].copy_from_slice(&[0xff; 4]);
    let mut file = open(&bytes).unwrap();
    assert_eq!(
        file.read("v", &[Part::All, Part::At(0)]).unwrap(),
        [1.0, -4.0]
    );
}

#[test]
fn five_thousand_damaged_headers_are_refused_or_read_without_a_panic() {
    let whole = by_hand();
    let hostile: [u32; 8] = [0, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0xffff, 11, 12];
    let (mut refused, mut read) = (0, 0);
    for counter in 0..5000usize {
        let mut bytes = whole.clone();
        let word = (counter * 7 + counter / 90) % (whole.len() / 4) * 4;
        match counter % 3 {
            0 => bytes[word..word + 4].copy_from_slice(&hostile[counter % 8].to_be_bytes()),
            1 => bytes[(counter * 13) % whole.len()] ^= 1 << (counter % 8),
            _ => {
                bytes[word..word + 4].copy_from_slice(&hostile[counter / 3 % 8].to_be_bytes());
                bytes.truncate((counter * 31) % whole.len());
            }
        }
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut file = open(&bytes)?;
            for variable in file.description().variables.clone() {
                // What the reader process checks before it reads.
                if variable.cell_count() <= 1000 {
                    file.read(&variable.name, &vec![Part::All; variable.dimensions.len()])?;
                }
            }
            Ok::<_, Rejection>(())
        }));
        match outcome.unwrap_or_else(|_| panic!("counter {counter} made the reader panic")) {
            Ok(()) => read += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(
        refused > 1000 && read > 100,
        "{refused} refused, {read} read: the damage is not of both kinds"
    );
}
