//! The harness itself: what it must notice, it notices.

use harness::program;

#[test]
fn a_failing_command_is_not_taken_for_a_success() {
    let data = tempfile::tempdir().unwrap();
    let words = ["budget", "--product", "nothing"];
    assert!(program::succeed(data.path(), &words).is_err());
    assert!(program::fail(data.path(), &words).is_ok());
}

#[test]
fn a_succeeding_command_is_not_taken_for_a_failure() {
    let data = tempfile::tempdir().unwrap();
    assert!(program::fail(data.path(), &["products"]).is_err());
}

#[test]
fn output_that_is_no_json_is_reported() {
    let data = tempfile::tempdir().unwrap();
    assert!(program::json(data.path(), &["--version"]).is_err());
}
