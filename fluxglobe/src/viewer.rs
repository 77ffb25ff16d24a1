//! Where the built viewer is.

use std::path::{Path, PathBuf};

/// The viewer in the checkout that this program was built in, or installed.
pub(crate) fn built() -> Option<PathBuf> {
    let checkout = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tile-server/web/dist");
    let installed = PathBuf::from("/usr/share/fluxglobe/viewer");
    [checkout, installed]
        .into_iter()
        .find(|folder| folder.join("index.html").is_file())
}
