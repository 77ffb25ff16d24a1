//! Why a product could not be written as files.

/// What failed, and of which file.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Something is there.
    #[error("{path} is there: give another place, or remove it")]
    Exists { path: String },
    /// The file system refused.
    #[error("cannot write {path}")]
    Io {
        path: String,
        #[source]
        source: std::io::Error,
    },
    /// A library refused.
    #[error("cannot write {path}: {detail}")]
    Library { path: String, detail: String },
    /// An answer that a form of file cannot hold.
    #[error("{reason}")]
    Form { reason: String },
    /// More or other values than there should be.
    #[error("a step has {found} values where its grid has {cells}")]
    Shape { found: usize, cells: usize },
    /// Other steps than there should be.
    #[error("{found} is not the next step of the product")]
    Step { found: String },
}

impl ExportError {
    pub(crate) fn io(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.display().to_string();
        move |source| Self::Io { path, source }
    }

    pub(crate) fn library<E: std::fmt::Display>(path: &std::path::Path) -> impl FnOnce(E) -> Self {
        let path = path.display().to_string();
        move |error| Self::Library {
            path,
            detail: error.to_string(),
        }
    }
}
