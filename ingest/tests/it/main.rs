//! Integration tests of ingest, one binary: whole files in, manifests and frames out.
#![expect(clippy::print_stderr, reason = "a test that skips says so")]

mod bad_input;
mod cf_files;
mod faults;
mod fixture;
mod hostile;
mod real_files;
mod service;
mod synthetic;
