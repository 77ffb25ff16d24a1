//! What every request passes, from the outside in: counting, security headers, other origins, compression, panics,
//! the time limit and the limit on bodies.

pub(crate) mod body;
pub(crate) mod panics;
pub(crate) mod security;
pub(crate) mod track;
