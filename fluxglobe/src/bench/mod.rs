//! `fluxglobe bench`: figures measured, never asserted.

pub(crate) mod compare;
pub(crate) mod fill;
pub(crate) mod quality;
pub(crate) mod stream;
