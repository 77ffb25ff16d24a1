//! Thousands of damaged files: each lands or is refused with a line; the parent process never falls.
//!
//! Headers are damaged most, since that is where lengths are. Mutations come from a counter, so that a failure repeats.

use std::path::Path;
use std::process::Stdio;

use ingest::{Outcome, Quiet};

use crate::fixture::{Place, SmallFile, settings};

/// Files a process start is paid for: about 10 ms each.
const WHOLE_WAY: usize = 150;

/// A number that looks random: the mixing of `SplitMix64`.
fn mixed(counter: u64) -> u64 {
    let mut h = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^ (h >> 31)
}

/// A damaged copy: bytes replaced, counts blown up, or the end cut off.
fn damaged(bytes: &[u8], counter: u64) -> Vec<u8> {
    let mut damaged = bytes.to_vec();
    let header = bytes.len().min(1024) as u64;
    let at = |n: u64| {
        (mixed(counter * 31 + n)
            % if n.is_multiple_of(3) {
                bytes.len() as u64
            } else {
                header
            }) as usize
    };
    match counter % 4 {
        0 => damaged.truncate(at(0)),
        1 => (0..4).for_each(|n| damaged[at(n)] = mixed(counter + n) as u8),
        2 => {
            let start = (at(1) & !3).min(bytes.len() - 4);
            damaged[start..start + 4].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff]);
        }
        _ => {
            let start = (at(1) & !3).min(bytes.len() - 8);
            let other = at(2).min(bytes.len() - 8);
            let moved: Vec<u8> = bytes[other..other + 8].to_vec();
            damaged[start..start + 8].copy_from_slice(&moved);
        }
    }
    damaged
}

async fn survives(bytes: &[u8], name: &str) {
    let place = Place::new();
    let mut refused = 0;
    let paths: Vec<_> = (0..WHOLE_WAY)
        .map(|i| place.path(&format!("{i}-{name}")))
        .collect();
    for (i, path) in paths.iter().enumerate() {
        std::fs::write(path, damaged(bytes, i as u64)).unwrap();
    }
    let mut settings = settings();
    settings.limits.wall = std::time::Duration::from_secs(10);
    let outcomes = place.land_as(settings, &paths, &Quiet).await.unwrap();
    for outcome in &outcomes {
        let line = outcome.to_string();
        assert!(!line.contains('\n') && line.len() < 1000, "{line}");
        refused += usize::from(outcome.is_rejected());
    }
    assert_eq!(outcomes.len(), WHOLE_WAY);
    assert!(
        refused > WHOLE_WAY / 4,
        "only {refused} of {WHOLE_WAY} were refused: the damage does not bite"
    );
    assert!(
        outcomes
            .iter()
            .all(|o| !matches!(o, Outcome::Rejected { detail, .. } if detail.is_empty()))
    );
}

#[tokio::test]
async fn damaged_classic_files_never_fell_the_parent() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    survives(&std::fs::read(place.path("a.nc")).unwrap(), "a.nc").await;
}

#[tokio::test]
async fn damaged_hdf5_files_never_fell_the_parent() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    survives(&std::fs::read(place.path("a.h5")).unwrap(), "a.h5").await;
}

/// How a reader process ends on a file when nobody asks it anything.
fn reader_exit(path: &Path) -> std::process::ExitStatus {
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_decode-file"))
        .arg(path)
        .args(["1073741824", "5", "1000000"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    child.wait().unwrap()
}

/// The classic reader is all ours: it must not even panic, whatever the bytes.
#[test]
fn the_classic_reader_refuses_without_a_panic() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let bytes = std::fs::read(place.path("a.nc")).unwrap();
    for counter in 0..400 {
        let path = place.path("damaged.nc");
        std::fs::write(&path, damaged(&bytes, counter)).unwrap();
        assert!(reader_exit(&path).success(), "counter {counter}");
    }
}

#[test]
fn a_reader_called_wrongly_says_so() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_decode-file"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(64));
}
