//! Where tests find files that nobody on this project made, and who may end without having run. What is missing is a
//! failure, but for the tests on a named list, which need what not everybody can have: those say so, and `make test`
//! counts them. And where servers of theirs may listen, and what ends these.
//!
//! | data | where | when missing |
//! |---|---|---|
//! | the FluxEngine wheel's `verification_data` | `FLUXGLOBE_FLUXENGINE`; `make test` fetches it by package name | failure |
//! | further sets | `FLUXGLOBE_TEST_DATA`, else `../shared/data` beside the checkout | failure where the variable is set or the test is not in [`LIST`] |
#![expect(clippy::print_stderr, reason = "a test that does not run says so")]

pub mod frozen;
mod graphics;
mod ports;
mod stopper;

use std::io::Write as _;
use std::path::{Path, PathBuf};

pub use graphics::is_without_gpu;
pub use ports::free_port;
pub use stopper::Stopper;

/// Tests that may end without having run, a name a line.
pub const LIST: &str = include_str!("../may-not-run.txt");

/// How many tests are in [`LIST`]: one more is a decision, not an accident.
pub const LISTED_COUNT: usize = 20;

/// Names of the tests in [`LIST`].
pub fn listed() -> impl Iterator<Item = &'static str> {
    LIST.lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
}

/// A folder inside the FluxEngine wheel's `verification_data`, such as `takahashi09`; `""` is the folder itself.
///
/// # Panics
/// If it is not there: these data come with a package that everybody can have.
pub fn fluxengine(inside: &str) -> PathBuf {
    const ADVICE: &str =
        "`make test` fetches it; by hand: export FLUXGLOBE_FLUXENGINE=$(tests/data/fetch.sh)";
    let root = variable("FLUXGLOBE_FLUXENGINE")
        .unwrap_or_else(|| panic!("FLUXGLOBE_FLUXENGINE is not set: {ADVICE}"));
    let folder = root.join(inside);
    assert!(
        folder.is_dir(),
        "there is no folder {}: {ADVICE}",
        folder.display()
    );
    folder
}

/// The share of land that FluxEngine sums with, beside its verification data.
///
/// # Panics
/// If it is not there.
pub fn fluxengine_land() -> PathBuf {
    let file = fluxengine("").with_file_name("onedeg_land.nc");
    assert!(
        file.is_file(),
        "there is no {}: tests/data/fetch.sh fetches it",
        file.display()
    );
    file
}

/// The Python that has what scripts of the tests import.
///
/// # Panics
/// If `deploy/install-tools.sh test` has not made it.
pub fn python() -> PathBuf {
    environment("bin/python")
}

/// The Python that reads products as others do, with Icechunk 2.
///
/// # Panics
/// If `deploy/install-tools.sh test` has not made it.
pub fn interop_python() -> PathBuf {
    environment("interop/bin/python")
}

fn environment(python: &str) -> PathBuf {
    let tools = variable("FLUXGLOBE_TOOLS").or_else(|| {
        let home = variable("HOME")?;
        Some(home.join(".cache/fluxglobe/tools"))
    });
    let python = tools.expect("HOME or FLUXGLOBE_TOOLS is set").join(python);
    assert!(
        python.is_file(),
        "there is no {}: `make test` makes it; by hand: deploy/install-tools.sh test",
        python.display()
    );
    python
}

/// A set of `FLUXGLOBE_TEST_DATA`; none, with a word on standard error and in the file that `FLUXGLOBE_SKIPPED` names,
/// where there are no sets at all and this test is in [`LIST`].
///
/// # Panics
/// If the set is missing and must not be.
pub fn set(name: &str) -> Option<PathBuf> {
    let beside = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let given = variable("FLUXGLOBE_TEST_DATA");
    let is_told = given.is_some();
    let root = given.unwrap_or_else(|| beside.to_owned());
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    let folder = folder.display();
    assert!(
        !is_told && !root.is_dir(),
        "the set {name} is not there (looked in {folder}); set FLUXGLOBE_TEST_DATA to the folder of all sets"
    );
    not_run(&format!(
        "the set {name}, and FLUXGLOBE_TEST_DATA to say where"
    ));
    None
}

/// Says that the calling test does not run for want of something, which its caller then must not go on without.
///
/// # Panics
/// If the test is not in [`LIST`].
pub fn not_run(lacks: &str) {
    let thread = std::thread::current();
    // The test harness names a test's thread after it.
    let test = thread.name().unwrap_or_default();
    assert!(
        listed().any(|known| known == test),
        "{test} lacks {lacks}, and is not in tests/data/may-not-run.txt"
    );
    eprintln!("NOT RUN: {test} lacks {lacks}");
    note(test);
}

/// Adds a line to the file that counts what did not run: the name of a test, or what went without a graphics device.
fn note(line: &str) {
    let Some(file) = variable("FLUXGLOBE_SKIPPED") else {
        return;
    };
    let appended = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(&file)
        .and_then(|mut file| writeln!(file, "{line}"));
    assert!(
        appended.is_ok(),
        "cannot write {}: {appended:?}",
        file.display()
    );
}

fn variable(name: &str) -> Option<PathBuf> {
    #[expect(
        clippy::disallowed_methods,
        reason = "tests have no command line of their own"
    )]
    let text = std::env::var(name).ok();
    text.filter(|text| !text.is_empty()).map(PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_tests_that_need_sets_has_its_length_and_no_test_twice() {
        let names: std::collections::BTreeSet<_> = listed().collect();
        assert_eq!(listed().count(), LISTED_COUNT);
        assert_eq!(names.len(), LISTED_COUNT);
    }

    #[test]
    fn a_missing_set_is_a_failure_for_a_test_that_is_not_listed() {
        // With sets, one that is none of them; without, this test is not listed: a failure either way.
        let failed = std::panic::catch_unwind(|| set("no_such_set"));
        assert!(failed.is_err());
    }
}
