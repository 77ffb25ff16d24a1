//! What every request passes, from the outside in: counting, security headers, other origins, what compression leaves unsaid,
//! compression, panics, the time limit, the limit on bodies, and tags of answers.

pub(crate) mod body;
pub(crate) mod encoding;
pub(crate) mod panics;
pub(crate) mod security;
pub(crate) mod tag;
pub(crate) mod track;
