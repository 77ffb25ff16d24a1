//! What streams are counted by.

use prometheus::{
    Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge, Opts, Registry,
};

/// Bounds of the time from a state to its picture, seconds: 30 ms is the aim for one that moves.
const BOUNDS_S: [f64; 11] = [0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 10.0];

/// The metrics of all streams.
#[derive(Debug, Clone)]
pub(crate) struct StreamMetrics {
    pub(super) open: IntGauge,
    pub(super) stale: IntCounter,
    pub(super) pictures: IntCounterVec,
    pub(super) bytes: IntCounterVec,
    pub(super) latency_s: HistogramVec,
    pub(super) send_s: Histogram,
    pub(super) ended: IntCounterVec,
}

impl StreamMetrics {
    /// Makes the metrics and registers them.
    pub(crate) fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        let name = |what: &str| format!("fluxglobe_tile_server_stream_{what}");
        let latency = HistogramOpts::new(
            name("latency_seconds"),
            "Time from the arrival of a state to its picture.",
        );
        let send = HistogramOpts::new(
            name("send_seconds"),
            "Time until the connection of a stream took a picture.",
        );
        let counters = |what: &str, help: &str, label: &str| {
            IntCounterVec::new(Opts::new(name(what), help), &[label])
        };
        let metrics = Self {
            open: IntGauge::new(name("open"), "Streams open.")?,
            stale: IntCounter::new(
                name("stale_total"),
                "States that were overtaken by newer ones before they were drawn.",
            )?,
            pictures: counters("pictures_total", "Pictures sent, by kind.", "kind")?,
            bytes: counters("bytes_total", "Bytes of pictures sent, by kind.", "kind")?,
            latency_s: HistogramVec::new(latency.buckets(BOUNDS_S.to_vec()), &["kind"])?,
            send_s: Histogram::with_opts(send.buckets(BOUNDS_S.to_vec()))?,
            ended: counters("ended_total", "Streams ended, by reason.", "reason")?,
        };
        registry.register(Box::new(metrics.open.clone()))?;
        registry.register(Box::new(metrics.stale.clone()))?;
        registry.register(Box::new(metrics.pictures.clone()))?;
        registry.register(Box::new(metrics.bytes.clone()))?;
        registry.register(Box::new(metrics.latency_s.clone()))?;
        registry.register(Box::new(metrics.send_s.clone()))?;
        registry.register(Box::new(metrics.ended.clone()))?;
        Ok(metrics)
    }
}
