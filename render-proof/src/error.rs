//! Why nothing can be proved of a job.

use render::RenderError;

/// A picture that cannot be drawn another way, or at all.
#[derive(Debug, thiserror::Error)]
pub enum ProofError {
    /// The engine, or the plan of the job, refused.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Only volumes without a globe behind them are drawn another way.
    #[error(
        "the reference draws volumes alone: no globe behind them, no surroundings, no uncertainty, no sun of an instant"
    )]
    NoReference,
}
