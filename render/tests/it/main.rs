//! Tests of the engine as a whole and of its stages, one binary.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "all of this binary is tests; clippy allows these in test functions only"
)]

mod adapters;
mod bands;
mod below;
mod coast;
mod codes;
mod compare;
mod context;
mod device;
mod fill;
mod flow;
mod golden;
mod ground;
mod hot;
mod isolines;
mod layout;
mod legible;
mod light_of_parts;
mod limits;
mod look;
mod mass;
mod parts;
mod projection;
mod scenes;
mod seams;
mod smooth;
mod tidy;
mod trails;
mod truths;
mod twins;
