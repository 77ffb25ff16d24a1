//! One file a command; this one only sends each command to its file.

mod budget;
pub(crate) mod derive;
pub(crate) mod generate;
mod ingest;
mod products;
mod render;
pub(crate) mod serve;
mod stats;

use std::process::ExitCode;

use anyhow::Result;

use crate::cli::{Command, Settings, Stats};
use crate::demo;

/// Runs a command; the exit code says whether every part of it succeeded.
pub(crate) async fn run(settings: &Settings, command: Command) -> Result<ExitCode> {
    match command {
        Command::Demo(options) => return demo::run(settings, options).await,
        Command::Ingest(options) => return ingest::run(settings, options).await,
        Command::Products(options) => products::run(settings, &options).await?,
        Command::Stats(Stats::Point(options)) => stats::point(settings, &options).await?,
        Command::Budget(options) => budget::run(settings, &options).await?,
        Command::Derive(options) => derive::run(settings, options).await?,
        Command::Render(options) => render::run(settings, options).await?,
        Command::Serve(options) => serve::run(settings, options).await?,
        Command::Generate(options) => generate::run(options)?,
        Command::DecodeFile { .. } => unreachable!("main runs the decoder before anything else"),
    }
    Ok(ExitCode::SUCCESS)
}
