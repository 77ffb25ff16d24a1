//! Tests of exports as others' programs read them.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]

mod read_back;
