//! Files of observations: real ones against the numbers of another reader, and ones made here to be hard.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod casts;
mod kept_apart;
mod made;
mod named;
mod real;
