//! Settings of whoever asks render workers for pictures.

use std::time::Duration;

use clap::value_parser;

use super::WorkerAddress;

/// Larger pictures are drawn in several passes wherever they are drawn: 2048 x 2048.
pub const LARGE_PIXELS: u32 = 2048 * 2048;

/// Which render workers there are and how long they may take. A flag and a variable have the same name.
#[derive(Debug, Clone, clap::Args)]
pub struct FleetSettings {
    /// Render workers, separated by commas: `HOST:PORT`, or `dns:NAME:PORT` for a worker at every address of a name,
    /// which is looked up again every few seconds.
    #[arg(
        long,
        env = "FLUXGLOBE_RENDER_WORKERS",
        value_delimiter = ',',
        default_value = "127.0.0.1:50061",
        value_name = "ADDRESSES"
    )]
    pub render_workers: Vec<WorkerAddress>,
    /// Longest time for one picture, all tries together, milliseconds, 100 to 600000.
    #[arg(long, env = "FLUXGLOBE_RENDER_DEADLINE_MS", default_value_t = 30_000,
          value_parser = value_parser!(u32).range(100..=600_000), value_name = "MS")]
    pub render_deadline_ms: u32,
    /// A worker that takes longer than this has the next one asked too, milliseconds, 10 to 600000.
    #[arg(long, env = "FLUXGLOBE_RENDER_HEDGE_MS", default_value_t = 5000,
          value_parser = value_parser!(u32).range(10..=600_000), value_name = "MS")]
    pub render_hedge_ms: u32,
    /// Pictures asked of one worker at the same time, 1 to 256.
    #[arg(long, env = "FLUXGLOBE_RENDER_IN_FLIGHT", default_value_t = 64,
          value_parser = value_parser!(u16).range(1..=256), value_name = "COUNT")]
    pub render_in_flight: u16,
    /// Pictures of more pixels than this are drawn in parts, one by every render worker that has a turn free.
    #[arg(long, env = "FLUXGLOBE_RENDER_PARTS_ABOVE", default_value_t = LARGE_PIXELS,
          value_parser = value_parser!(u32).range(1..), value_name = "PIXELS")]
    pub render_parts_above: u32,
}

impl FleetSettings {
    /// Longest time for one picture.
    pub fn deadline(&self) -> Duration {
        Duration::from_millis(u64::from(self.render_deadline_ms))
    }

    pub(super) fn hedge(&self) -> Duration {
        Duration::from_millis(u64::from(self.render_hedge_ms))
    }
}
