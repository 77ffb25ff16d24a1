//! Words for steps of time, the same for every question.

/// Steps that an answer may have.
pub(super) const STEPS: &str = "native|day|week|month|season|year|total";
