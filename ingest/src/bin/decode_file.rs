//! The sandboxed file reader as its own program: a path and limits in, description and values out.

use std::process::ExitCode;

fn main() -> ExitCode {
    ingest::reader::run_child(std::env::args_os().skip(1))
}
