//! `fluxglobe`: the one program; reads the command line, runs the command, says what failed.

mod cli;
mod command;
mod demo;
mod embedded;
mod ports;
mod progress;

use std::process::ExitCode;

use clap::Parser as _;
use tracing_subscriber::EnvFilter;

use crate::cli::{Cli, Command};

fn main() -> ExitCode {
    let Cli { settings, command } = Cli::parse();
    // The decoder of hostile files runs before anything else is started: no threads, no log, no open files.
    if let Command::DecodeFile { args } = &command {
        return ingest::decoder::run_child(args.clone());
    }
    let filter = match EnvFilter::try_new(&settings.log) {
        Ok(filter) => filter,
        Err(error) => return failed(&anyhow::anyhow!("--log {:?}: {error}", settings.log)),
    };
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => return failed(&anyhow::anyhow!("cannot start threads: {error}")),
    };
    let outcome = runtime.block_on(command::run(&settings, command));
    // Ballista's executor keeps threads of its own; nobody waits for them.
    runtime.shutdown_background();
    match outcome {
        Ok(code) => code,
        Err(error) => failed(&error),
    }
}

#[expect(clippy::print_stderr, reason = "the last word of a failed command")]
fn failed(error: &anyhow::Error) -> ExitCode {
    eprintln!("fluxglobe: {error:#}");
    ExitCode::FAILURE
}
