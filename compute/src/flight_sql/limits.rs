//! What all questions to a server may take.

use std::num::NonZeroUsize;

/// What all questions together may take; each has the limits of its [`Sql`](crate::sql::Sql) besides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlightSqlLimits {
    /// Questions that are worked on at a time; others are refused, to be asked again.
    pub questions_at_once: NonZeroUsize,
    /// Most rows of an answer: beyond it is an error, never a part that looks like all.
    pub max_rows: u64,
}
