//! Both homes of observations under one suite, the service between log and store, and what the network does to it.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::float_cmp, reason = "these numbers are exact")]
#![expect(clippy::print_stdout, reason = "a test that measures says what")]

mod cleaned;
mod conformance;
mod frozen;
mod homes;
mod interruptions;
mod same_answers;
mod sample;
mod service;
