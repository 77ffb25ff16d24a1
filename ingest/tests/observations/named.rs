//! Names of platforms in NetCDF-4 files: numbers, letters and texts of every kind, and lengths that lie.
//!
//! The three files of this folder were written by Python's netCDF4 1.7; the others are these with other names.

use std::path::{Path, PathBuf};
use std::str::FromStr as _;

use contract::event::RejectReason;
use hdf5::types::{FixedAscii, FixedUnicode, H5Type, VarLenAscii, VarLenUnicode};
use hdf5::{Dataset, Extents, File};

use crate::made::{observations, refusal, seen};

fn stored(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/observations/files")
        .join(name)
}

/// What all of the files hold, but for the names of the two platforms.
fn truth(first: &str, second: &str) -> Vec<(String, i64, i64, i64)> {
    let row = |name: &str, hour, lon, value| (name.to_owned(), hour, lon, value);
    let mut rows = vec![
        row(first, 1, 100, 11),
        row(first, 2, 100, 12),
        row(second, 4, -160, 21),
        row(second, 5, -160, 22),
    ];
    rows.sort();
    rows
}

/// The numbered file with other names: `make` gives the dataset.
fn renamed(folder: &Path, make: impl FnOnce(&File) -> Dataset) -> PathBuf {
    // A name of its own each time: a reader process that is being started may still hold the lock of the one before.
    let file = tempfile::Builder::new().suffix(".nc").tempfile_in(folder);
    let (_, path) = file.unwrap().keep().unwrap();
    std::fs::copy(stored("numbered.nc"), &path).unwrap();
    let file = File::open_rw(&path).unwrap();
    file.unlink("name").unwrap();
    let dataset = make(&file);
    let role = dataset
        .new_attr::<VarLenUnicode>()
        .create("cf_role")
        .unwrap();
    let value = VarLenUnicode::from_str("timeseries_id").unwrap();
    role.write_scalar(&value).unwrap();
    path
}

fn written<T: H5Type, S: Into<Extents>>(file: &File, shape: S, texts: &[T]) -> Dataset {
    let dataset = file.new_dataset::<T>().shape(shape).create("name").unwrap();
    dataset.write_raw(texts).unwrap();
    dataset
}

#[tokio::test]
async fn numbers_letters_and_texts_of_another_library_name_platforms() {
    let found = observations(&stored("numbered.nc")).await;
    assert_eq!(seen(&found), truth("44005", "44006"));
    let found = observations(&stored("named.nc")).await;
    assert_eq!(seen(&found), truth("aa", "bb"));
    let found = observations(&stored("lettered.nc")).await;
    assert_eq!(seen(&found), truth("aa-1", "b2"));
}

#[tokio::test]
async fn texts_of_fixed_and_of_free_length_name_platforms() {
    let folder = tempfile::tempdir().unwrap();
    let path = renamed(folder.path(), |file| {
        let texts = ["Kaimana", "B 2"].map(|t| FixedAscii::<12>::from_ascii(t).unwrap());
        written(file, 2, &texts)
    });
    assert_eq!(
        seen(&observations(&path).await),
        truth("Kaimana", "B 2"),
        "fixed ASCII"
    );
    let path = renamed(folder.path(), |file| {
        let texts = ["Kélá", "\u{6d77}"].map(|t| FixedUnicode::<9>::from_str(t).unwrap());
        written(file, 2, &texts)
    });
    let expected = truth("Kélá", "\u{6d77}");
    assert_eq!(seen(&observations(&path).await), expected, "fixed UTF-8");
    let path = renamed(folder.path(), |file| {
        let texts = ["x", "y"].map(|t| VarLenAscii::from_ascii(t).unwrap());
        written(file, 2, &texts)
    });
    assert_eq!(seen(&observations(&path).await), truth("x", "y"), "free");
    // A text that was never written, and one of which only the beginning fits: no letter is cut in two.
    let path = renamed(folder.path(), |file| {
        let long = format!("a{}", "é".repeat(100));
        let texts = ["", &long].map(|t| VarLenUnicode::from_str(t).unwrap());
        written(file, 2, &texts)
    });
    let cut = format!("a{}", "é".repeat(31));
    assert_eq!(seen(&observations(&path).await), truth("1", &cut), "long");
}

#[tokio::test]
async fn names_that_would_fill_the_memory_are_refused_before_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    // Two bytes on the disk, half a gigabyte when read.
    let path = renamed(folder.path(), |file| {
        let texts = file.new_dataset::<FixedAscii<4096>>().shape(120_000);
        texts.create("name").unwrap()
    });
    let refused = refusal(&path).await;
    assert_eq!(refused.reason, RejectReason::TooLarge, "{refused}");
    // One text of 40 MB that a hundred platforms share in size: 70 MB is beyond what is read of all together.
    let path = renamed(folder.path(), |file| {
        let long = VarLenAscii::from_ascii(&"x".repeat(35 << 20)).unwrap();
        written(file, 2, &[long.clone(), long])
    });
    let refused = refusal(&path).await;
    assert_eq!(refused.reason, RejectReason::TooLarge, "{refused}");
    assert!(refused.detail.contains("bytes of text"), "{refused}");
    let path = renamed(folder.path(), |file| {
        let letters = file
            .new_dataset::<FixedAscii<1>>()
            .chunk((1000, 256))
            .shape((100_001, 256));
        letters.create("name").unwrap()
    });
    let refused = refusal(&path).await;
    assert_eq!(refused.reason, RejectReason::TooLarge, "{refused}");
}

#[tokio::test]
async fn names_of_another_type_are_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    let path = renamed(folder.path(), |file| written(file, 2, &[[1i32, 2], [3, 4]]));
    let refused = refusal(&path).await;
    assert_eq!(refused.reason, RejectReason::Unreadable, "{refused}");
    assert!(
        refused.detail.contains("neither numbers nor text"),
        "{refused}"
    );
}

/// Every byte of the text's own parts of a good file changed: a refusal or observations, never a hang or a crash of ours.
#[tokio::test(flavor = "multi_thread")]
async fn mutated_files_with_texts_end_in_observations_or_a_refusal() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = crate::made::settings();
    // Some send the library round in circles: the limit of the reader process ends that.
    settings.limits.cpu_s = 2;
    let good = std::fs::read(stored("named.nc")).unwrap();
    let path = folder.path().join("mutated.nc");
    let heap = good
        .windows(4)
        .position(|bytes| bytes == b"GCOL")
        .expect("texts of free length lie in a heap");
    let (mut read, mut refused) = (0, 0);
    for at in (heap..heap + 64).step_by(3) {
        for byte in [0u8, 0xff] {
            let mut bytes = good.clone();
            bytes[at] = byte;
            std::fs::write(&path, &bytes).unwrap();
            match crate::made::read(&path, &settings).await {
                Ok((all, _masked)) => {
                    assert!(all.iter().all(|o| o.validate().is_ok()));
                    read += 1;
                }
                Err(_refusal) => refused += 1,
            }
        }
    }
    assert!(read > 0 && refused > 0, "{read} read, {refused} refused");
}
