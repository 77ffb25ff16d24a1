//! Where files that nobody on this project made lie, if they are on this machine.

use std::path::PathBuf;

/// Folder of the demo's input files (`takahashi09/` and others), from `FLUXGLOBE_FLUXENGINE`.
///
/// Says so on standard error when it is absent: the caller then has nothing to test.
pub fn fluxengine() -> Option<PathBuf> {
    folder("FLUXGLOBE_FLUXENGINE", None)
}

/// Folder of further sets, from `FLUXGLOBE_TEST_DATA`, else `../shared/data` beside the checkout.
pub fn sets() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    folder("FLUXGLOBE_TEST_DATA", Some(beside))
}

#[expect(clippy::print_stderr, reason = "a test that tests nothing must say so")]
fn folder(variable: &str, default: Option<&str>) -> Option<PathBuf> {
    #[expect(
        clippy::disallowed_methods,
        reason = "tests have no command line of their own"
    )]
    let given = std::env::var(variable).ok().filter(|text| !text.is_empty());
    let folder = PathBuf::from(given.as_deref().or(default).unwrap_or_default());
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED: no real files; set {variable} to their folder (looked in \"{}\")",
        folder.display()
    );
    None
}
