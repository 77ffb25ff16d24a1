//! Journals with a flipped bit, a torn end, lines of before they had checks.

use super::*;

/// As it was written before lines had checks.
const OLD: &str = concat!(
    r#"{"messages":[["granule.notice","{\"path\":\"a.nc\"}"]]}"#,
    "\n",
    r#"{"offsets":{"granule.notice/ingest":1}}"#,
    "\n"
);

fn entry(number: u64) -> Entry {
    Entry {
        messages: vec![(
            Topic::GranuleNotice,
            format!("{{\"path\":\"{number}.nc\"}}"),
        )],
        time: TimeMs::new(1_000_000_000_000 + number as i64).ok(),
        offsets: [("granule.notice/ingest".to_owned(), number)].into(),
    }
}

/// A journal of some old lines and `new` new ones.
fn journal(old: &str, new: u64) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal.jsonl");
    std::fs::write(&path, old).unwrap();
    let (mut journal, _) = Journal::open(path.clone()).unwrap();
    for number in 0..new {
        journal.append(&entry(number)).unwrap();
    }
    (folder, path)
}

fn read(path: &Path) -> Result<Vec<Entry>, StorageError> {
    Journal::open(path.to_owned()).map(|(_, entries)| entries)
}

/// Whole lines.
fn lines_in(content: &[u8]) -> usize {
    content.split(|&byte| byte == b'\n').count() - 1
}

/// Flips each bit from a byte on; how the error must name its entry.
fn assert_every_bit_counts(path: &Path, from: usize, names: impl Fn(usize) -> Vec<usize>) {
    let whole = std::fs::read(path).unwrap();
    for at in from * 8..whole.len() * 8 {
        let mut flipped = whole.clone();
        flipped[at / 8] ^= 1 << (at % 8);
        std::fs::write(path, &flipped).unwrap();
        let error = read(path).expect_err(&format!("bit {at} can change unseen"));
        assert!(matches!(error, StorageError::Damaged { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains(path.to_str().unwrap()), "{text}");
        let line = lines_in(&whole[..at / 8]);
        let named = names(line + 1);
        assert!(
            named
                .iter()
                .any(|entry| text.contains(&format!("entry {entry} of"))),
            "bit {at}, one of {named:?}: {text}"
        );
        let after = std::fs::read(path).unwrap();
        assert_eq!(after, flipped, "a damaged journal is left as it is");
    }
    std::fs::write(path, whole).unwrap();
}

#[test]
fn no_bit_of_a_journal_can_change_unseen() {
    let (_folder, path) = journal("", 3);
    assert_eq!(read(&path).unwrap(), [0, 1, 2].map(entry));
    assert_every_bit_counts(&path, 0, |line| vec![line]);
    assert_eq!(read(&path).unwrap(), [0, 1, 2].map(entry));
}

#[test]
fn the_check_of_a_line_vouches_for_those_before_lines_had_checks_too() {
    let (_folder, path) = journal(OLD, 2);
    let entries = read(&path).unwrap();
    assert_eq!((entries.len(), &entries[3]), (4, &entry(1)));
    assert_eq!(entries[1].offsets["granule.notice/ingest"], 1);
    // What is JSON still is found by the first check after it.
    assert_every_bit_counts(
        &path,
        0,
        |line| if line <= 2 { vec![1, 2, 3] } else { vec![line] },
    );
    let whole = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, whole.replacen("a.nc", "b.nc", 1)).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("one of the 2 before it"), "{error}");
}

#[test]
fn old_lines_alone_are_read_and_none_may_follow_a_checked_one() {
    let (_folder, path) = journal(OLD, 0);
    assert_eq!(read(&path).unwrap().len(), 2);
    let (_folder, path) = journal("", 1);
    let mut content = std::fs::read_to_string(&path).unwrap();
    content += OLD;
    std::fs::write(&path, content).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(
        error.contains("entry 2") && error.contains("check"),
        "{error}"
    );
}

#[test]
fn a_line_that_is_gone_twice_there_or_elsewhere_is_found() {
    let (_folder, path) = journal("", 3);
    let whole = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    for (order, damaged) in [
        (&[0, 2][..], 2),
        (&[1, 2], 1),
        (&[0, 0, 1, 2], 2),
        (&[0, 2, 1], 2),
    ] {
        let content: String = order.iter().map(|&line| lines[line]).collect();
        std::fs::write(&path, content).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(
            error.contains(&format!("entry {damaged} of")),
            "{order:?}: {error}"
        );
    }
}

#[test]
fn a_journal_cut_anywhere_holds_the_whole_lines_before_the_cut_and_goes_on_from_there() {
    for old in ["", OLD] {
        let (_folder, path) = journal(old, 3);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            Journal::check(&path).unwrap();
            assert_eq!(
                std::fs::read(&path).unwrap().len(),
                length,
                "it was changed"
            );
            let before = lines_in(&whole[..length]);
            let (mut journal, entries) = Journal::open(path.clone()).unwrap();
            assert_eq!(entries.len(), before, "{length} bytes");
            journal.append(&entry(9)).unwrap();
            let entries = read(&path).unwrap();
            assert_eq!(
                (entries.len(), entries.last()),
                (before + 1, Some(&entry(9)))
            );
        }
    }
}

#[test]
fn a_file_that_something_else_changed_is_not_written_to() {
    let (_folder, path) = journal("", 1);
    let (mut journal, _) = Journal::open(path.clone()).unwrap();
    std::fs::write(&path, "").unwrap();
    let error = journal.append(&entry(1)).unwrap_err().to_string();
    assert!(error.contains("something else"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"");
}
