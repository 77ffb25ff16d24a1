//! `render-bench`: the renderer measured on the machine it runs on, a small program to carry to where the GPU is.

use clap::Parser;
use render_proof::bench::command::{self, RenderBench};

/// Measure the renderer on this machine.
#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    bench: RenderBench,
}

fn main() -> anyhow::Result<()> {
    command::run(&Cli::parse().bench)
}
