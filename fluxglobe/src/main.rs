//! `fluxglobe`: the one program; reads the command line, runs the command, says what failed.

mod animation;
mod bench;
mod cli;
mod command;
mod demo;
mod deployment;
mod desktop;
mod figures;
mod file_handles;
mod heights;
mod instants;
mod picture;
mod plot;
mod ports;
mod progress;
mod protocol;
mod services;
mod sink;
mod sky;
mod viewer;

use std::any::Any;
use std::process::ExitCode;
use std::time::Duration;

use clap::{CommandFactory as _, FromArgMatches as _};
use storage::attached::Failure;

use crate::cli::{Cli, Command, Settings};

/// What ends within this time ends in order.
const SHUTDOWN_LIMIT: Duration = Duration::from_secs(3);

fn main() -> ExitCode {
    let mut program = Cli::command();
    let matches = program.clone().get_matches();
    let cli = match Cli::from_arg_matches(&matches) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    let Cli { settings, command } = cli;
    // The decoder of hostile files runs before anything else is started: no threads, no log, no open files.
    if let Command::DecodeFile { args } = &command {
        return ingest::reader::run_child(args.clone());
    }
    if command.prints_settings() {
        program.build();
        let shown = progress::result(&cli::shown_settings(&program, &matches));
        return shown.map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS);
    }
    if command.may_draw() && !settings.cpu {
        desktop::leave_alone();
    }
    run(&settings, command).unwrap_or_else(|error| failed(&error))
}

fn run(settings: &Settings, command: Command) -> anyhow::Result<ExitCode> {
    service::start_logging(&settings.log, settings.log_format)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    let outcome = runtime.block_on(command::run(settings, command));
    leave_ended_tasks_unsaid();
    // Tasks are dropped before `main` ends: drivers' exit handlers must find no device that is still held. What computes
    // or waits for a server beyond that is not waited for.
    runtime.shutdown_timeout(SHUTDOWN_LIMIT);
    outcome
}

/// Work that a failed command leaves behind ends where the runtime does, and timers that it asks for then panic. That is their end and
/// nobody's fault: it is not told before the error that matters. All else that panics is.
fn leave_ended_tasks_unsaid() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_of_the_end(panic.payload()) {
            tell(panic);
        }
    }));
}

/// Is it what tokio panics with in a runtime that ends?
fn is_of_the_end(panic: &(dyn Any + Send)) -> bool {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.is_some_and(|text| text.contains("it is being shutdown"))
}

fn failed(error: &anyhow::Error) -> ExitCode {
    progress::say(&format!("fluxglobe: {}", told(error)));
    ExitCode::FAILURE
}

/// An error and its causes, each said once: layers of stores say what the ones below them said. What failed in a store of others is
/// told as that alone, with store, array and chunk: all around it is how we came there.
fn told(error: &anyhow::Error) -> String {
    if let Some(failure) = Failure::behind(error.as_ref()) {
        return failure.to_string();
    }
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !text.contains(&cause) {
            let joint = if text.is_empty() { "" } else { ": " };
            text = format!("{text}{joint}{cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text is tokio's own: another one would be told.
    #[test]
    fn a_timer_in_a_runtime_that_ends_is_the_end_and_no_other_panic_is() {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .unwrap();
        let handle = runtime.handle().clone();
        runtime.shutdown_timeout(SHUTDOWN_LIMIT);
        let asked = move || {
            let _inside = handle.enter();
            let pause = tokio::time::sleep(Duration::from_secs(1));
            futures::FutureExt::now_or_never(pause)
        };
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(asked)).unwrap_err();
        assert!(is_of_the_end(panic.as_ref()));
        let other = std::panic::catch_unwind(|| panic!("an index")).unwrap_err();
        assert!(!is_of_the_end(other.as_ref()));
    }

    #[test]
    fn a_cause_that_was_said_is_not_said_again() {
        let error = anyhow::anyhow!("the disk is full");
        let error = error
            .context("writing a: the disk is full")
            .context("landing b");
        assert_eq!(told(&error), "landing b: writing a: the disk is full");
        let error = anyhow::anyhow!("c").context("reading d");
        assert_eq!(told(&error), "reading d: c");
    }

    #[test]
    fn what_failed_in_a_store_of_others_is_told_alone_and_once() {
        let failure = Failure {
            place: "/data/sst.zarr array sst chunk [0, 0, 0]".to_owned(),
            reason: "is damaged".to_owned(),
            cause: storage::attached::Cause::Content,
            folder: Some("/data/sst.zarr".to_owned()),
        };
        let text = failure.to_string();
        let error = storage::StorageError::Object {
            key: "frames/sst/x.parquet".to_owned(),
            source: object_store::Error::Generic {
                store: "attached store",
                source: failure.into(),
            },
        };
        assert_eq!(error.to_string(), text);
        let error = anyhow::Error::from(error).context("reading a field");
        assert_eq!(told(&error), text);
    }
}
