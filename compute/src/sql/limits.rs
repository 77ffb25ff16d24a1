//! What a question may take.

use std::time::Duration;

/// What one question may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SqlLimits {
    /// For what it must hold: groups, sorted rows, a side of a join.
    pub memory_bytes: usize,
    /// From its text to its last row.
    pub time: Duration,
}
