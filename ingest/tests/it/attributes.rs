//! HDF5 files with attributes of any size and number: what is kept of them is bounded, and the file lands. One whose attributes are
//! damaged does not.

use contract::event::RejectReason;
use hdf5::Location;
use ingest::Outcome;

use crate::fixture::{Place, SmallFile, refusal, text};

/// More than the reader may say of a file.
const HUGE_BYTES: usize = 32 << 20;

/// Numbers in the room of an attribute, 64 KiB: together more than the reader may say of a file.
fn many_numbers(owner: &Location) {
    for index in 0..160 {
        let attribute = owner.new_attr::<f64>().shape(8000);
        let attribute = attribute.create(&*format!("numbers{index}")).unwrap();
        attribute.write_raw(&vec![0.1; 8000]).unwrap();
    }
}

/// Texts as long as they are kept, five times as many as are looked at.
fn many_texts(owner: &Location) {
    let value = "x".repeat(4096);
    for index in 0..5 * 1024 {
        text(owner, &format!("text{index}"), &value);
    }
}

/// Writes attributes of an owner.
type Write = fn(&Location);

#[tokio::test]
async fn attributes_of_any_size_and_number_are_bounded_and_their_file_lands() {
    let cases: [(&str, Write); 3] = [
        ("long.h5", |owner| {
            text(owner, "history", &"x".repeat(HUGE_BYTES));
        }),
        ("numbers.h5", many_numbers),
        ("texts.h5", many_texts),
    ];
    for (name, add) in cases {
        let place = Place::new();
        let path = place.path(name);
        let file = SmallFile::new().write_hdf5_open(&path);
        let beside = file.new_dataset::<i8>().shape([1]).create("beside");
        add(&beside.unwrap());
        file.close().unwrap();
        let outcomes = place.land(&[path]).await;
        assert!(
            matches!(outcomes[..], [Outcome::Landed { .. }]),
            "{name}: {outcomes:?}"
        );
    }
}

/// In the newest format, whose headers and blocks have checksums, a file of one dataset with more attributes than its header holds.
/// One byte of the last block of a kind is another.
fn damaged(place: &Place, kind: [u8; 4]) -> std::path::PathBuf {
    let path = place.path("damaged.h5");
    let file = hdf5::File::with_options()
        .with_fapl(hdf5::plist::FileAccessBuilder::libver_latest)
        .create(&path)
        .unwrap();
    let dataset = file.new_dataset::<f32>().shape([2]).create("beside");
    let dataset = dataset.unwrap();
    for index in 0..16 {
        let attribute = dataset.new_attr::<f64>().create(&*format!("number{index}"));
        attribute.unwrap().write_scalar(&0.01).unwrap();
    }
    drop(dataset);
    file.close().unwrap();
    let mut content = std::fs::read(&path).unwrap();
    let found = content.windows(4).rposition(|bytes| *bytes == kind);
    content[found.expect("there is such a block")] ^= 1;
    std::fs::write(&path, content).unwrap();
    path
}

#[tokio::test]
async fn damaged_attributes_and_datasets_are_not_taken_for_none() {
    // The block of attributes, and the header of the dataset.
    for kind in [*b"FHDB", *b"OHDR"] {
        let place = Place::new();
        let path = damaged(&place, kind);
        let (reason, line) = refusal(&place.land(&[path]).await);
        assert_eq!(reason, RejectReason::Corrupt, "{line}");
        assert!(line.contains("beside"), "{line}");
        assert!(line.contains("fetch it again"), "{line}");
    }
}
