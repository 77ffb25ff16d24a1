//! How far ingest has come, told to whoever draws it.

use std::path::Path;

use crate::notice::Outcome;

/// A stage of the pipeline, in the order of the stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The file is read.
    Fetch,
    /// Its contents are listed.
    Inspect,
    /// What to read and what it becomes is settled.
    Plan,
    /// A step is read.
    Decode,
    /// Its values are checked.
    Check,
    /// Its field is made.
    Encode,
    /// Its field is stored.
    Put,
    /// The manifest is published.
    Commit,
}

/// Whoever wants to know how far ingest has come. Called from several tasks at once.
pub trait Progress: Send + Sync {
    /// A file enters a stage; `step` of `steps` time steps (0 of 0 before they are known).
    fn stage(&self, file: &Path, stage: Stage, step: usize, steps: usize);
    /// A file is done.
    fn done(&self, outcome: &Outcome);
}

/// Tells nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn stage(&self, _file: &Path, _stage: Stage, _step: usize, _steps: usize) {}
    fn done(&self, _outcome: &Outcome) {}
}
