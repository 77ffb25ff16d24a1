//! Is there a graphics device to test with? No adapter is a failure unless `NO_GPU=1` says that it is meant.

/// False if it is switched off for this run.
pub(crate) fn is_wanted(test: &str) -> bool {
    !test_data::is_without_gpu(test)
}
