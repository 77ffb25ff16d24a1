//! Settings of the tile server: flags and environment variables in, plain values with limits out.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::PathBuf;

use axum::http::HeaderName;

const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);
const TILE_MEMORY_BYTES: u64 = 256 << 20;
/// Some 200,000 tiles.
const STORED_BYTES_PER_DAY: u64 = 4 << 30;
const MOST_DRAWS_AT_ONCE: u32 = 1024;
const DRAW_QUEUE: u32 = 256;
const ANALYSES_AT_ONCE: u32 = 2;
const ANALYSIS_QUEUE: u32 = 1024;
const REQUEST_LIMIT_S: u64 = 60;
const DRAIN_LIMIT_S: u64 = 10;
const CATALOGUE_AGE_MS: u64 = 1000;
const CONNECTIONS: u32 = 4096;
const HEAD_LIMIT_S: u64 = 10;
const IDLE_LIMIT_S: u64 = 75;
const STREAMS: u32 = 512;

/// What the tile server can be told.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub struct Settings {
    /// Address and port to listen on; only this machine can reach the default
    #[arg(long, env = "FLUXGLOBE_LISTEN", default_value_t = LISTEN, value_parser = service::socket_address)]
    pub listen: SocketAddr,
    /// Folder with the built viewer; without it only tiles and data are served
    #[arg(long, env = "FLUXGLOBE_VIEWER")]
    pub viewer: Option<PathBuf>,
    /// Memory for drawn pictures, bytes, 0 to 64 GiB
    #[arg(long, env = "FLUXGLOBE_TILE_MEMORY_BYTES", default_value_t = TILE_MEMORY_BYTES, value_parser = clap::value_parser!(u64).range(0..=64 << 30))]
    pub tile_memory_bytes: u64,
    /// Tiles that whoever asks for them has stored, bytes a day, 0 to 1 TiB; more are drawn and given out, and stay in memory
    /// alone. Views of the globe are never stored, and tiles that are drawn ahead always
    #[arg(long, env = "FLUXGLOBE_STORED_BYTES_PER_DAY", default_value_t = STORED_BYTES_PER_DAY, value_parser = clap::value_parser!(u64).range(0..=1 << 40))]
    pub stored_bytes_per_day: u64,
    /// Pictures drawn at the same time, 1 to 1024; if absent 8 on a graphics card, 2 on a software adapter, as many as
    /// there are cores with --cpu, and 32 where render workers draw. Pictures that are encoded do not count
    #[arg(long, env = "FLUXGLOBE_DRAWS_AT_ONCE", value_parser = draws_at_once)]
    pub draws_at_once: Option<NonZeroU32>,
    /// Pictures that may wait to be drawn, or are drawn and not yet encoded, before clients are sent away, 0 to 65536
    #[arg(long, env = "FLUXGLOBE_DRAW_QUEUE", default_value_t = DRAW_QUEUE, value_parser = clap::value_parser!(u32).range(0..=65_536))]
    pub draw_queue: u32,
    /// Series and budgets computed at the same time, and as many questions about observations, 1 to 1024
    #[arg(long, env = "FLUXGLOBE_ANALYSES_AT_ONCE", default_value_t = ANALYSES_AT_ONCE, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub analyses_at_once: u32,
    /// Series and budgets, and as many questions about observations, that may wait before clients are sent away, 0 to 65536; one client's
    /// series and budgets at most half of them. Clients take turns, each with the question that it asked first
    #[arg(long, env = "FLUXGLOBE_ANALYSIS_QUEUE", default_value_t = ANALYSIS_QUEUE, value_parser = clap::value_parser!(u32).range(0..=65_536))]
    pub analysis_queue: u32,
    /// Header in which a proxy in front says who asks, such as x-forwarded-for: its last address counts, and clients must not reach the
    /// server past the proxy. Absent, the address of the connection stands for a client
    #[arg(long, env = "FLUXGLOBE_CLIENT_HEADER", value_name = "NAME")]
    pub client_header: Option<HeaderName>,
    /// Longest time until an answer begins, seconds, 1 to 3600
    #[arg(long, env = "FLUXGLOBE_REQUEST_LIMIT_S", default_value_t = REQUEST_LIMIT_S, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub request_limit_s: u64,
    /// Longest time that requests under way may take when the server is asked to stop, seconds, 0 to 3600
    #[arg(long, env = "FLUXGLOBE_DRAIN_LIMIT_S", default_value_t = DRAIN_LIMIT_S, value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub drain_limit_s: u64,
    /// Age at which the list of products is read again, milliseconds, 0 to 3600000
    #[arg(long, env = "FLUXGLOBE_CATALOGUE_AGE_MS", default_value_t = CATALOGUE_AGE_MS, value_parser = clap::value_parser!(u64).range(0..=3_600_000))]
    pub catalogue_age_ms: u64,
    /// Connections open at the same time, 1 to 65536; each takes a file handle, and those beyond are told to come again
    #[arg(long, env = "FLUXGLOBE_CONNECTIONS", default_value_t = CONNECTIONS, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub connections: u32,
    /// Longest time that a client may take to send a request's head, seconds, 1 to 300
    #[arg(long, env = "FLUXGLOBE_HEAD_LIMIT_S", default_value_t = HEAD_LIMIT_S, value_parser = clap::value_parser!(u64).range(1..=300))]
    pub head_limit_s: u64,
    /// Time after which a connection that nothing moves on is ended, seconds, 1 to 3600; never before --request-limit-s
    #[arg(long, env = "FLUXGLOBE_IDLE_LIMIT_S", default_value_t = IDLE_LIMIT_S, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub idle_limit_s: u64,
    /// Cameras followed at the same time over /stream, 0 to 65536; each may have three pictures drawn at once
    #[arg(long, env = "FLUXGLOBE_STREAMS", default_value_t = STREAMS, value_parser = clap::value_parser!(u32).range(0..=65_536))]
    pub streams: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            listen: LISTEN,
            viewer: None,
            tile_memory_bytes: TILE_MEMORY_BYTES,
            stored_bytes_per_day: STORED_BYTES_PER_DAY,
            draws_at_once: None,
            draw_queue: DRAW_QUEUE,
            analyses_at_once: ANALYSES_AT_ONCE,
            analysis_queue: ANALYSIS_QUEUE,
            client_header: None,
            request_limit_s: REQUEST_LIMIT_S,
            drain_limit_s: DRAIN_LIMIT_S,
            catalogue_age_ms: CATALOGUE_AGE_MS,
            connections: CONNECTIONS,
            head_limit_s: HEAD_LIMIT_S,
            idle_limit_s: IDLE_LIMIT_S,
            streams: STREAMS,
        }
    }
}

/// A number of pictures: as many as a server may be told to draw at once.
fn draws_at_once(text: &str) -> Result<NonZeroU32, String> {
    let count: Option<NonZeroU32> = text.parse().ok();
    let count = count.filter(|count| count.get() <= MOST_DRAWS_AT_ONCE);
    count.ok_or_else(|| format!("a whole number, 1 to {MOST_DRAWS_AT_ONCE}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Program {
        #[command(flatten)]
        settings: Settings,
    }

    #[test]
    fn no_flags_are_the_defaults() {
        assert_eq!(
            Program::parse_from(["program"]).settings,
            Settings::default()
        );
    }

    #[test]
    fn values_beyond_their_limits_are_refused() {
        for flag in [
            ["--draws-at-once", "0"],
            ["--draws-at-once", "1025"],
            ["--request-limit-s", "0"],
            ["--listen", "8080"],
            ["--draw-queue", "-1"],
            ["--connections", "0"],
            ["--head-limit-s", "301"],
        ] {
            assert!(
                Program::try_parse_from(["program", flag[0], flag[1]]).is_err(),
                "{flag:?}"
            );
        }
    }
}
