//! `fluxglobe bench`: figures measured, never asserted.

pub(crate) mod stream;
