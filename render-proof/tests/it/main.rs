//! Tests of what proves the engine, against the engine, one binary.
#![expect(
    clippy::unwrap_used,
    reason = "all of this binary is tests; clippy allows it in test functions only"
)]

mod bench;
mod fill;
mod optics;
mod reference;
