//! One file a command; this one only sends each command to its file.

mod adapters;
mod analysis;
mod attach;
mod behind;
mod budget;
pub(crate) mod derive;
mod export;
mod fill_error;
mod flight_sql;
mod follow;
mod gc;
pub(crate) mod generate;
mod geometry;
mod ingest;
mod keep;
mod legend;
mod migrate;
pub(crate) mod notice;
mod observations;
mod products;
mod recompute;
mod rejected;
pub(crate) mod render;
pub(crate) mod serve;
mod sql;
mod statistics;
mod stats;
mod survey;
mod topics;
mod verify;

use std::process::ExitCode;

use anyhow::Result;

use crate::cli::{Bench, Command, ProductsOf, Settings};
use crate::{bench, demo, deployment, services};

/// Runs a command; the exit code says whether every part of it succeeded.
pub(crate) async fn run(settings: &Settings, command: Command) -> Result<ExitCode> {
    match command {
        Command::Demo(options) => return Box::pin(demo::run(settings, options)).await,
        Command::Ingest(options) => return ingest::run(settings, options).await,
        Command::Attach(options) => attach::run(settings, &options).await?,
        Command::Products(options) => match &options.of {
            Some(ProductsOf::FillError(options)) => fill_error::run(settings, options).await?,
            None => products::run(settings, &options).await?,
        },
        Command::Export(options) => export::run(settings, &options).await?,
        Command::Stats(which) => Box::pin(stats::run(settings, which)).await?,
        Command::FlightSql(options) => flight_sql::run(settings, &options).await?,
        Command::Sql(options) => sql::run(settings, &options).await?,
        Command::Budget(options) => budget::run(settings, &options).await?,
        Command::Derive(options) => {
            derive::run(settings, *options).await?;
            cube::compacted().await;
        }
        Command::Render(options) => Box::pin(render::run(settings, options)).await?,
        Command::Serve(options) => serve::run(settings, options).await?,
        Command::Ingestd(options) => services::ingestd::run(settings, options).await?,
        Command::Scheduler(options) => services::scheduler::run(settings, options).await?,
        Command::Executor(options) => services::executor::run(settings, options).await?,
        Command::RenderWorker(options) => services::render_worker::run(settings, options).await?,
        Command::TileServer(options) => services::tile_server::run(settings, options).await?,
        Command::Notice(options) if options.print => notice::print(&options)?,
        Command::Notice(options) => {
            let log = deployment::needed_log(settings, &options.kafka).await?;
            notice::send(log.as_ref(), &options).await?;
        }
        Command::Topics(command) => topics::run(command).await?,
        Command::Rejected(command) => rejected::run(settings, command).await?,
        Command::Observations(command) => observations::run(settings, command).await?,
        Command::Recompute(options) => {
            Box::pin(recompute::run(settings, options)).await?;
            cube::compacted().await;
        }
        Command::Survey(options) => survey::run(&options).await?,
        Command::Verify(options) => return verify::run(settings, &options).await,
        Command::Migrate(options) => return Box::pin(migrate::run(settings, &options)).await,
        Command::Gc(options) => gc::run(settings, &options).await?,
        Command::Keep(options) => keep::run(settings, &options).await?,
        Command::Bench(bench) => measure(settings, bench).await?,
        Command::Adapters(options) => adapters::run(settings, &options)?,
        Command::Generate(options) => generate::run(options)?,
        Command::DecodeFile { .. } => unreachable!("main runs the decoder before anything else"),
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs a bench.
async fn measure(settings: &Settings, bench: Bench) -> Result<()> {
    match bench {
        Bench::Stream(options) => {
            let log = deployment::needed_log(settings, &options.kafka).await?;
            bench::stream::run(log.as_ref(), &options).await?;
        }
        Bench::Render(options) => bench::render::run(settings, options).await?,
        Bench::Budget(options) => bench::budget::run(&options)?,
        Bench::Serve(options) => bench::serve::run(&options).await?,
        Bench::Fly(options) => bench::fly::run(&options).await?,
        Bench::Quality(options) => bench::quality::run(settings, options).await?,
        Bench::Compare(options) => bench::compare::run(&options)?,
        Bench::Landing(options) => bench::landing::run(&options).await?,
        Bench::Fill(options) => bench::fill::run(settings, &options)?,
    }
    Ok(())
}
