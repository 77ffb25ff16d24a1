//! What earlier versions of this program wrote, kept in `storage/tests/frozen`; its README says how it is made.

use std::path::{Path, PathBuf};

/// What is frozen of a version of the manifest.
pub fn folder(version: u32) -> PathBuf {
    let all = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../storage/tests/frozen"
    ));
    all.join(version.to_string())
}

/// The folder that a test is to freeze what it writes in, if that is asked for.
pub fn to_freeze() -> Option<PathBuf> {
    super::variable("FLUXGLOBE_FREEZE")
}

/// Copies a part of what is frozen of a version: no test may change what is kept.
///
/// # Panics
/// If it is not there.
pub fn copy(version: u32, part: &str, to: &Path) {
    copy_all(&folder(version).join(part), to);
}

fn copy_all(from: &Path, to: &Path) {
    let failed = |e| panic!("{} to {}: {e}", from.display(), to.display());
    std::fs::create_dir_all(to).unwrap_or_else(failed);
    for entry in std::fs::read_dir(from).unwrap_or_else(|e| panic!("{}: {e}", from.display())) {
        let from = entry
            .unwrap_or_else(|e| panic!("{}: {e}", from.display()))
            .path();
        let to = to.join(from.file_name().expect("an entry of a folder has a name"));
        if from.is_dir() {
            copy_all(&from, &to);
        } else {
            std::fs::copy(&from, &to).unwrap_or_else(|e| panic!("{}: {e}", from.display()));
        }
    }
}
