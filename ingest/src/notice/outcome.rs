//! What became of a file, for people and programs.

use std::fmt::{Display, Formatter};
use std::path::PathBuf;

use contract::event::RejectReason;
use contract::manifest::ManifestId;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::Period;

use crate::error::Rejection;
use crate::observation::Stored;

/// What became of a file. Shown as one line.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// It is in a product now.
    Landed {
        /// The file.
        file: PathBuf,
        /// Manifest that holds it.
        manifest: ManifestId,
        /// Periods it brought.
        periods: Vec<Period>,
        /// Did it replace values that were there?
        revised: bool,
        /// Name of the profile that it was read with; none for a file that follows CF.
        profile: Option<String>,
        /// What was taken for granted, because nothing in the file says it, and which steps are left out. One line each.
        assumptions: Vec<String>,
        /// Cells that it gave a value for and that hold none, steps without any value among them.
        masked: MaskedCells,
    },
    /// The same content was in the product before.
    AlreadyLanded {
        /// The file.
        file: PathBuf,
        /// Newest manifest that holds it.
        manifest: ManifestId,
        /// Its periods.
        periods: Vec<Period>,
        /// Cells that it gave a value for and that hold none.
        masked: MaskedCells,
    },
    /// Files of later notices have its time: it changes nothing.
    Superseded {
        /// The file.
        file: PathBuf,
        /// Newest manifest, which holds the newer files.
        manifest: ManifestId,
    },
    /// It holds observations, which are stored now.
    Observed {
        /// The file.
        file: PathBuf,
        /// Their dataset.
        dataset: ProductId,
        /// What became of them.
        stored: Stored,
        /// Values that it gave and that are no observations.
        masked: MaskedCells,
        /// What was measured and is not read, and why.
        passed_over: Vec<String>,
    },
    /// It was refused.
    Rejected {
        /// The file.
        file: PathBuf,
        /// Class of the reason.
        reason: RejectReason,
        /// What in the file is meant.
        object: String,
        /// What is wrong and what to do.
        detail: String,
    },
}

impl Outcome {
    pub(crate) fn rejected(file: PathBuf, rejection: Rejection) -> Self {
        let Rejection {
            reason,
            object,
            detail,
        } = rejection;
        Self::Rejected {
            file,
            reason,
            object,
            detail,
        }
    }

    /// Was the file refused?
    pub fn is_rejected(&self) -> bool {
        matches!(self, Self::Rejected { .. })
    }

    /// Manifest that holds the file.
    pub fn manifest(&self) -> Option<&ManifestId> {
        match self {
            Self::Landed { manifest, .. }
            | Self::AlreadyLanded { manifest, .. }
            | Self::Superseded { manifest, .. } => Some(manifest),
            Self::Observed { .. } | Self::Rejected { .. } => None,
        }
    }

    /// Cells that the file gave a value for and that hold none, if it is in a product; values that are no observations.
    pub fn masked(&self) -> Option<MaskedCells> {
        match self {
            Self::Landed { masked, .. }
            | Self::AlreadyLanded { masked, .. }
            | Self::Observed { masked, .. } => Some(*masked),
            Self::Superseded { .. } | Self::Rejected { .. } => None,
        }
    }

    /// The file.
    pub fn file(&self) -> &std::path::Path {
        match self {
            Self::Landed { file, .. }
            | Self::AlreadyLanded { file, .. }
            | Self::Superseded { file, .. }
            | Self::Observed { file, .. }
            | Self::Rejected { file, .. } => file,
        }
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let span = |periods: &[Period]| match (periods.first(), periods.last()) {
            (Some(first), Some(last)) => Period {
                start: first.start,
                end: last.end,
            }
            .to_string(),
            _ => "no period".to_owned(),
        };
        match self {
            Self::Landed {
                file,
                manifest,
                periods,
                revised,
                assumptions,
                masked,
                ..
            } => {
                let how = if *revised { "revised" } else { "landed" };
                let gap = if masked.is_none() { "" } else { "; " };
                write!(
                    f,
                    "{}: {how} in {manifest} for {}{gap}{masked}",
                    file.display(),
                    span(periods)
                )?;
                let assumed = |text: &String| write!(f, "; assumed: {text}");
                assumptions.iter().try_for_each(assumed)
            }
            Self::AlreadyLanded { file, manifest, .. } => {
                write!(f, "{}: was in {manifest} already", file.display())
            }
            Self::Superseded { file, manifest } => write!(
                f,
                "{}: left as it is: {manifest} has files of later notices for its time; to land it all the same, send a new notice",
                file.display()
            ),
            Self::Observed {
                file,
                stored,
                masked,
                passed_over,
                ..
            } => {
                let gap = if masked.is_none() { "" } else { "; " };
                write!(
                    f,
                    "{}: {} observations are new, {} replaced, {} were there{gap}{masked}",
                    file.display(),
                    stored.new,
                    stored.replaced,
                    stored.same
                )?;
                let told = |text: &String| write!(f, "; not read: {text}");
                passed_over.iter().try_for_each(told)
            }
            Self::Rejected {
                file,
                object,
                detail,
                ..
            } => write!(f, "{}: {object}: {detail}", file.display()),
        }
    }
}
