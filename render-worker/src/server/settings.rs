//! Settings of a render worker.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::time::Duration;

use clap::value_parser;

use crate::pipeline::Limits;

/// How a render worker listens and how much it takes on. A flag and a variable have the same name.
#[derive(Debug, Clone, clap::Args)]
pub struct Settings {
    /// Address at which pictures are drawn for others (gRPC, no encryption: keep it inside the cluster).
    #[arg(
        long,
        env = "FLUXGLOBE_RENDER_LISTEN",
        default_value = "127.0.0.1:50061",
        value_name = "ADDRESS"
    )]
    pub render_listen: SocketAddr,
    /// Pictures drawn at the same time, 1 to 64; 8 on a graphics card and 2 on a software adapter if absent, and with
    /// --cpu as many as there are cores. Pictures that are encoded do not count.
    #[arg(long, env = "FLUXGLOBE_DRAWS_AT_ONCE",
          value_parser = value_parser!(u8).range(1..=64), value_name = "COUNT")]
    pub draws_at_once: Option<u8>,
    /// Jobs that may wait to be drawn on demand, 0 to 4096; more are sent away with a hint when to ask again.
    #[arg(long, env = "FLUXGLOBE_DRAW_QUEUE", default_value_t = 64,
          value_parser = value_parser!(u16).range(0..=4096), value_name = "COUNT")]
    pub draw_queue: u16,
    /// Memory for fields of products drawn lately, MiB, 16 to 1048576. A field of more than half of it counts as half:
    /// two such ones are kept, between which a picture lies; one of more than all of it is read anew for every picture.
    #[arg(long = "frame-memory-mib", env = "FLUXGLOBE_FRAME_MEMORY_MIB", default_value_t = 512,
          value_parser = value_parser!(u32).range(16..=1_048_576), value_name = "MIB")]
    pub field_memory_mib: u32,
    /// Memory of the graphics device for fields that stay on it between pictures, MiB, 16 to 1048576; an eighth of what
    /// the device has if absent, 512 where that is not known.
    #[arg(long = "device-frame-memory-mib", env = "FLUXGLOBE_DEVICE_FRAME_MEMORY_MIB",
          value_parser = value_parser!(u32).range(16..=1_048_576), value_name = "MIB")]
    pub device_field_memory_mib: Option<u32>,
    /// Fields of every product read ahead of the one drawn, in the direction in which time runs, 0 to 8; with 0 none.
    #[arg(long = "frames-ahead", env = "FLUXGLOBE_FRAMES_AHEAD", default_value_t = 1,
          value_parser = value_parser!(u8).range(0..=8), value_name = "COUNT")]
    pub fields_ahead: u8,
    /// How long jobs under way may take to end when the worker is asked to stop, seconds, 0 to 600.
    #[arg(long, env = "FLUXGLOBE_RENDER_DRAIN_S", default_value_t = 25,
          value_parser = value_parser!(u16).range(0..=600), value_name = "SECONDS")]
    pub render_drain_s: u16,
}

impl Settings {
    /// What the worker takes on.
    pub fn limits(&self) -> Limits {
        Limits {
            draws_at_once: self
                .draws_at_once
                .and_then(|count| NonZeroUsize::new(usize::from(count))),
            draw_queue: usize::from(self.draw_queue),
            field_bytes: u64::from(self.field_memory_mib) << 20,
            device_field_bytes: self.device_field_memory_mib.map(|mib| u64::from(mib) << 20),
            fields_ahead: usize::from(self.fields_ahead),
            ..Limits::default()
        }
    }

    /// How long the end may take.
    pub fn drain(&self) -> Duration {
        Duration::from_secs(u64::from(self.render_drain_s))
    }
}
