//! Log lines on standard error.

use harness::program;

/// Journals and files are searched for words such as `service="executor"`, which colours would cut up.
#[test]
fn log_lines_have_no_colours_where_there_is_no_terminal() {
    let data = tempfile::tempdir().unwrap();
    // A service that says where its health is told, and ends: its store would be a folder where a file is.
    let file = data.path().join("file");
    std::fs::write(&file, "").unwrap();
    let store = format!("file:{}", file.display());
    let words = ["executor", "--admin", "127.0.0.1:0", "--log", "info"];
    let talk = program::fail(data.path(), &[&words[..], &["--store", &store]].concat()).unwrap();
    assert!(talk.contains(r#"service="executor""#), "{talk:?}");
    assert!(!talk.contains('\u{1b}'), "{talk:?}");
}
