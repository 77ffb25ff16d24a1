//! Is there a graphics device to test with? No adapter is a failure unless `NO_GPU=1` says that it is meant.

/// False if it is switched off for this run.
pub(crate) fn is_wanted(test: &str) -> bool {
    #[expect(clippy::disallowed_methods, reason = "a test's own switch")]
    let is_off = std::env::var("NO_GPU").is_ok_and(|value| value == "1");
    if is_off {
        println!("skipped without a GPU: {test}");
    }
    !is_off
}
