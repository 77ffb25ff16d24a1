//! What can go wrong between a render job and its stored picture.

use contract::key::ObjectKey;
use cube::CubeError;
use legend::LegendError;
use render::RenderError;
use storage::StorageError;

/// A job whose picture could not be had.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The engine could not draw it.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Reading fields failed.
    #[error("cannot read {what} of {product}")]
    Store {
        what: &'static str,
        product: String,
        source: Box<StorageError>,
    },
    /// Reading a level of a very large field failed.
    #[error("cannot read a window of {product}")]
    Cube {
        product: String,
        source: Box<CubeError>,
    },
    /// A product is too large for what the job asks of it.
    #[error("{product} is too large for this picture: {reason}")]
    Large { product: String, reason: String },
    /// The picture could not be read from the store or put there.
    #[error("cannot {what} picture {key}")]
    Picture {
        what: &'static str,
        key: ObjectKey,
        source: Box<StorageError>,
    },
    /// What is drawn over the picture could not be: a defect.
    #[error("cannot draw annotations")]
    Annotations(#[from] LegendError),
    /// The thread that drew was lost.
    #[error("the drawing thread ended early")]
    Thread(#[source] tokio::task::JoinError),
}

fn is_not_found(error: &CubeError) -> bool {
    matches!(error, CubeError::Storage(source) if source.is_not_found())
}

impl DrawError {
    /// What is stored does not lie on the grid of the job.
    pub(crate) fn mismatch(key: &ObjectKey) -> Self {
        Self::Render(RenderError::GridMismatch {
            product: "the job".to_owned(),
            accumulated: key.to_string(),
        })
    }

    /// May the same job succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Render(error) => error.is_retryable(),
            Self::Store { source, .. } | Self::Picture { source, .. } => source.is_retryable(),
            Self::Cube { source, .. } => source.is_retryable(),
            Self::Thread(_) => true,
            Self::Annotations(_) | Self::Large { .. } => false,
        }
    }

    /// Is the job, not the worker, to blame?
    pub fn is_bad_request(&self) -> bool {
        match self {
            Self::Render(error) => error.is_bad_request(),
            Self::Large { .. } => true,
            Self::Store { .. }
            | Self::Cube { .. }
            | Self::Picture { .. }
            | Self::Annotations(_)
            | Self::Thread(_) => false,
        }
    }

    /// Does the job name something that is not stored?
    pub fn is_not_found(&self) -> bool {
        match self {
            Self::Store { source, .. } => source.is_not_found(),
            Self::Cube { source, .. } => is_not_found(source),
            _ => false,
        }
    }

    /// Is the device to blame, so that a fresh one may draw the job?
    pub fn is_device_fault(&self) -> bool {
        match self {
            Self::Render(error) => error.is_device_fault(),
            // Drivers and the library over them give up by a panic where they have no error to return.
            Self::Thread(lost) => lost.is_panic(),
            Self::Store { .. }
            | Self::Cube { .. }
            | Self::Large { .. }
            | Self::Picture { .. }
            | Self::Annotations(_) => false,
        }
    }

    /// Would every worker fail at this job, now and later? What a job that was tried on a fresh device fails with is
    /// its own; a store or a machine that cannot be used is not.
    pub fn is_final(&self) -> bool {
        match self {
            Self::Render(error) => error.is_final(),
            Self::Thread(_) | Self::Annotations(_) | Self::Large { .. } => true,
            Self::Cube { source, .. } => !source.is_retryable(),
            Self::Store { source, .. } => {
                source.is_not_found() || matches!(**source, StorageError::Damaged { .. })
            }
            Self::Picture { .. } => false,
        }
    }

    /// Has whoever wanted the picture gone?
    pub fn is_not_wanted(&self) -> bool {
        matches!(self, Self::Render(RenderError::NotWanted))
    }

    /// The error and what it came from, in one line.
    pub fn in_full(&self) -> String {
        let mut text = self.to_string();
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            text.push_str(": ");
            text.push_str(&error.to_string());
            cause = error.source();
        }
        text
    }
}
