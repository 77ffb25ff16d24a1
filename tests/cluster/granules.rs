//! Files to land: the real monthly fluxes.

use std::path::{Path, PathBuf};

/// Files and the product they land in.
pub(crate) struct Granules {
    pub(crate) files: Vec<PathBuf>,
    pub(crate) product: &'static str,
    /// An instant inside them.
    pub(crate) time: &'static str,
    /// Tiles with data in them: z, x, y.
    pub(crate) tiles: &'static [(u32, u32, u32)],
}

/// The real monthly fluxes, copied into `inbox`.
pub(crate) fn some(inbox: &Path) -> Granules {
    let mut files: Vec<PathBuf> = std::fs::read_dir(test_data::fluxengine("takahashi09"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "nc"))
        .collect();
    files.sort();
    let copied = files.iter().map(|file| {
        let target = inbox.join(file.file_name().unwrap());
        std::fs::copy(file, &target).unwrap();
        target
    });
    Granules {
        files: copied.collect(),
        product: "takahashi09-flux",
        time: "2000-05-20T06:00:00Z",
        tiles: &[(0, 0, 0), (2, 1, 1), (3, 0, 3)],
    }
}
