//! Tests in a process of their own, whose most memory is that of one piece of work.

use std::path::Path;
use std::process::Command;

/// Names the folder of the inner process.
const INNER: &str = "FLUXGLOBE_TEST_PEAK_IN";

/// Most memory that this process had so far, bytes.
pub(crate) fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:"));
    let kib = line.unwrap().split_whitespace().nth(1).unwrap();
    kib.parse::<u64>().unwrap() << 10
}

/// Runs the test of this name again in a process of its own; true in that one, which then does the work.
pub(crate) fn is_inner(name: &str) -> bool {
    if std::env::var_os(INNER).is_some() {
        return true;
    }
    let ran = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(INNER, Path::new("1"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{said}");
    assert!(said.contains("MiB were taken"), "it did not run: {said}");
    eprintln!("{}", said.lines().last().unwrap_or_default());
    false
}

/// Says what was taken since the peak was `before`, and fails if it is too much.
pub(crate) fn check(before: u64, most_bytes: u64) {
    let taken = peak_bytes() - before;
    eprintln!("{} MiB were taken", taken >> 20);
    assert!(taken < most_bytes, "{} MiB were taken", taken >> 20);
}
