//! Files of observations: real ones against the numbers of another reader, and ones made here to be hard.
#![expect(clippy::print_stderr, reason = "a test that skips says so")]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod made;
mod named;
mod real;
