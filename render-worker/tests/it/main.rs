//! Tests of the renderer as a whole and of its stages, one binary.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "all of this binary is tests; clippy allows these in test functions only"
)]

mod compare;
mod device;
mod gallery;
mod golden;
mod layout;
mod limits;
mod reference;
mod scenes;
mod seams;
mod service;
mod tidy;
mod truths;
mod twins;
