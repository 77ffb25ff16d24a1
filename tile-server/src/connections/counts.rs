//! Counters of connections.

use prometheus::{IntCounterVec, IntGauge, Opts, Registry};

/// How many connections there are and were ended.
#[derive(Debug, Clone)]
pub(crate) struct Counts {
    pub(super) open: IntGauge,
    /// By the limit that they broke.
    pub(super) ended: IntCounterVec,
}

impl Counts {
    pub(crate) fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        let open = IntGauge::new(
            "fluxglobe_tile_server_connections_count",
            "Connections that are open.",
        )?;
        let ended = IntCounterVec::new(
            Opts::new(
                "fluxglobe_tile_server_connections_ended_total",
                "Connections ended by this server, by the limit that they broke.",
            ),
            &["why"],
        )?;
        registry.register(Box::new(open.clone()))?;
        registry.register(Box::new(ended.clone()))?;
        Ok(Self { open, ended })
    }
}
