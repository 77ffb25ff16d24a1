//! `fluxglobe bench`: figures measured, never asserted.

pub(crate) mod fill;
pub(crate) mod stream;
