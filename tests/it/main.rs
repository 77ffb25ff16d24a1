//! All end-to-end tests as one binary: the built program, run as people run it.

mod bad_input;
mod browser;
mod dependencies;
mod end_to_end;
mod harness_self;
