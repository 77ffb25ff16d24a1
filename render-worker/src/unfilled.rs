//! What becomes of gaps: filled, as most quantities are, or left.

use contract::job::RenderJob;

/// What becomes of cells that hold data in other steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Gaps {
    /// They get what their neighbours say.
    Filled,
    /// They stay empty: codes and directions have nothing between two of them.
    Left,
}

impl Gaps {
    /// Of the product that a job draws.
    pub(crate) fn of(job: &RenderJob) -> Self {
        if job.style.nearest {
            Self::Left
        } else {
            Self::Filled
        }
    }
}
