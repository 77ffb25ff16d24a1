//! What can go wrong with a cube: which array, which chunk, and what to do.

use contract::time::Period;
use storage::StorageError;

/// What the text of a failure of the store begins with that may pass: the libraries of repositories and of arrays hand failures on as text,
/// in which it cannot be told otherwise.
pub(crate) const MAY_PASS: &str = "the store fails at the moment";

/// What Icechunk says of clocks: states are in the order of their times, and those are times of the store.
const OF_CLOCKS: [&str; 2] = [
    "invalid snapshot timestamp ordering",
    "verify if the machine clock has drifted",
];

/// A cube that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CubeError {
    /// The store refused or lost a request.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The same, behind the libraries of repositories and of arrays, where it may pass.
    #[error("{what}: {reason}; try again")]
    Away { what: String, reason: String },
    /// Something is where a new cube was to be.
    #[error("{place} is not empty: give another place, or remove what is there")]
    Exists { place: String },
    /// There is no cube.
    #[error("there is no repository of a product in {place}")]
    Missing { place: String },
    /// The cube has no such version.
    #[error("{place} has no version {version:?}; it has {there}")]
    NoVersion {
        place: String,
        version: String,
        there: String,
    },
    /// What is there was not written by this crate, or is not whole.
    #[error("{array} in {place} is not as this program writes it: {reason}")]
    Foreign {
        place: String,
        array: String,
        reason: String,
    },
    /// A chunk cannot be read, or does not hold what was written.
    #[error(
        "chunk {chunk:?} of {array} cannot be read: {reason}; if its object is damaged, land the file of this step again, \
         or restore the object from a copy"
    )]
    Chunk {
        array: String,
        /// Index of the chunk along time, rows and columns.
        chunk: Vec<u64>,
        reason: String,
    },
    /// A step does not hold the values that its digest names.
    #[error(
        "step {period} of {array} does not hold the values of its digest: land its file again, or restore it from a copy"
    )]
    Step { array: String, period: Period },
    /// The cube of a version does not hold what the version's fields do.
    #[error(
        "{array} of {version} in {place} is not what its fields are: {reason}; the fields are untouched and stay what is true: \
         remove this folder, and the cube is made anew from them"
    )]
    Differs {
        place: String,
        array: String,
        version: String,
        /// Step and cell, and both values.
        reason: String,
    },
    /// A step would cover a part of the period of another one.
    #[error("the step {step} overlaps {there}, which is there: one period has one step")]
    Overlap { step: Period, there: Period },
    /// Values and grid do not belong together.
    #[error("{found} values for a window of {expected} cells")]
    Shape { expected: usize, found: usize },
    /// There is no such step or window.
    #[error("{what} is outside the cube of {steps} steps, {rows} x {cols} cells")]
    Outside {
        what: String,
        steps: usize,
        rows: u32,
        cols: u32,
    },
    /// Others were faster every time.
    #[error("{place} was changed by others in each of {attempts} attempts to commit: try again")]
    Contended { place: String, attempts: u32 },
    /// By this machine's clock nothing can be committed: it is behind the newest state, or far from the clock of the store.
    #[error(
        "nothing can be committed to {place}: {reason}; set this machine's clock right, or that of the store, and do the same again"
    )]
    Clock { place: String, reason: String },
    /// The library of the repository or of the arrays failed.
    #[error("{place}: {doing}: {reason}")]
    Library {
        place: String,
        doing: &'static str,
        reason: String,
    },
}

impl CubeError {
    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Storage(error) => error.is_retryable(),
            Self::Away { .. } | Self::Contended { .. } => true,
            Self::Exists { .. }
            | Self::Missing { .. }
            | Self::NoVersion { .. }
            | Self::Foreign { .. }
            | Self::Chunk { .. }
            | Self::Step { .. }
            | Self::Differs { .. }
            | Self::Overlap { .. }
            | Self::Shape { .. }
            | Self::Outside { .. }
            | Self::Clock { .. }
            | Self::Library { .. } => false,
        }
    }

    /// A failure of the libraries, without the trace of spans that Icechunk's errors carry behind their first lines; of the store behind them, if
    /// that is what failed and may pass. So are the next two. Of clocks, if those are why nothing is committed.
    pub(crate) fn library(
        place: &str,
        doing: &'static str,
        reason: impl std::fmt::Display,
    ) -> Self {
        let reason = first_lines(&reason);
        if let Some(away) = Self::away(&reason, || format!("{place}: {doing}")) {
            return away;
        }
        let place = place.to_owned();
        if OF_CLOCKS.iter().any(|text| reason.contains(text)) {
            return Self::Clock { place, reason };
        }
        Self::Library {
            place,
            doing,
            reason,
        }
    }

    /// A chunk that cannot be read.
    pub(crate) fn chunk(array: String, chunk: Vec<u64>, reason: String) -> Self {
        let away = Self::away(&reason, || format!("chunk {chunk:?} of {array}"));
        away.unwrap_or(Self::Chunk {
            array,
            chunk,
            reason,
        })
    }

    /// What a library does not take for what this crate writes.
    pub(crate) fn foreign(place: &str, array: String, reason: impl std::fmt::Display) -> Self {
        let reason = first_lines(&reason);
        let away = Self::away(&reason, || format!("{array} in {place}"));
        away.unwrap_or_else(|| Self::Foreign {
            place: place.to_owned(),
            array,
            reason,
        })
    }

    /// A failure of the store that may pass, if a library tells of one.
    fn away(reason: &str, what: impl FnOnce() -> String) -> Option<Self> {
        reason.contains(MAY_PASS).then(|| Self::Away {
            what: what(),
            reason: reason.to_owned(),
        })
    }
}

/// An error's text up to the trace that Icechunk adds.
pub(crate) fn first_lines(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    let end = text.find("\n\ncontext:").unwrap_or(text.len());
    text[..end].trim().to_owned()
}

#[cfg(test)]
mod tests {
    use chrono::DateTime;
    use icechunk::format::IcechunkFormatErrorKind;
    use icechunk::session::SessionErrorKind;

    use super::*;

    #[test]
    fn what_the_store_fails_at_may_pass_however_it_is_handed_on_and_the_rest_stays() {
        let all = |reason: &str| {
            [
                CubeError::library("s3://b/p", "reading a key", reason),
                CubeError::chunk("sst".to_owned(), vec![1, 0, 0], reason.to_owned()),
                CubeError::foreign("s3://b/p", "the group".to_owned(), reason),
            ]
        };
        for error in all(&format!(
            "storage error: {MAY_PASS}: 503\n\ncontext:\n 0: x"
        )) {
            let text = error.to_string();
            assert!(error.is_retryable(), "{text}");
            assert!(
                text.contains("503") && !text.contains("land the file"),
                "{text}"
            );
        }
        for error in all("the checksum differs") {
            assert!(!error.is_retryable(), "{error}");
        }
    }

    #[test]
    fn what_icechunk_refuses_for_the_clock_says_what_to_do() {
        let [parent, child] = [1_000, 0].map(|s| DateTime::from_timestamp(s, 0).unwrap());
        let all = [
            SessionErrorKind::InvalidSnapshotTimestampOrdering { parent, child }.to_string(),
            SessionErrorKind::InvalidSnapshotTimestamp {
                object_store_time: parent,
                snapshot_time: child,
            }
            .to_string(),
            IcechunkFormatErrorKind::InvalidUpdateTimestamp {
                latest_time: parent,
                new_time: child,
            }
            .to_string(),
        ];
        for reason in all {
            let error = CubeError::library("s3://b/p", "committing", reason);
            assert!(matches!(error, CubeError::Clock { .. }), "{error:?}");
            assert!(error.to_string().contains("set this machine's clock right"));
        }
    }
}
