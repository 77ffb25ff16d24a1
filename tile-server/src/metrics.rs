//! What this server counts and times, registered with the registry it is given, so that others can register there too.
//!
//! Names are `fluxglobe_<service>_<what>_<unit>`; labels have few values each: routes are patterns, never addresses.

use prometheus::{
    Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge, IntGaugeVec, Opts,
    core::Collector,
};

pub use prometheus::Registry;

use crate::connections::counts::Counts;
use crate::stream::StreamMetrics;

/// Bounds of request times, seconds: a cached tile is under a millisecond, a budget some seconds.
const REQUEST_BOUNDS_S: [f64; 12] = [
    0.0005, 0.001, 0.0025, 0.005, 0.015, 0.05, 0.15, 0.5, 1.5, 5.0, 15.0, 60.0,
];
/// Bounds of drawing times, seconds: 15 ms on a large GPU, 150 ms in software are the aims for a tile.
const DRAW_BOUNDS_S: [f64; 11] = [
    0.001, 0.005, 0.015, 0.05, 0.1, 0.15, 0.3, 0.6, 1.5, 5.0, 30.0,
];

/// Where a picture came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// This process's memory.
    Memory,
    /// The object store.
    Store,
    /// The client's own copy was still right.
    Client,
}

impl Source {
    fn label(self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::Store => "store",
            Self::Client => "client",
        }
    }
}

/// The metrics of one server.
#[derive(Debug, Clone)]
pub struct Metrics {
    /// Answers by route, method and status class.
    pub requests: IntCounterVec,
    /// Time until an answer begins, by route.
    pub request_duration_s: HistogramVec,
    /// Requests under way, by route.
    pub in_flight: IntGaugeVec,
    /// Bytes of bodies sent, after compression, by route.
    pub sent_bytes: IntCounterVec,
    /// Pictures that needed no drawing, by where they came from.
    pub cache_hits: IntCounterVec,
    /// Pictures that had to be drawn.
    pub cache_misses: IntCounter,
    /// Bytes of pictures in memory.
    pub cache_bytes: IntGauge,
    /// Pictures drawn, by mode and outcome.
    pub drawn: IntCounterVec,
    /// Time to draw, by mode.
    pub draw_duration_s: HistogramVec,
    /// Time a picture waited for its turn.
    pub draw_wait_s: Histogram,
    /// Time to look for a picture in the store.
    pub look_up_s: Histogram,
    /// Time from the beginning of an answer until its last byte was taken by the connection, by route.
    pub send_duration_s: HistogramVec,
    /// Requests sent away because too many waited.
    pub refused: IntCounter,
    /// Questions that wait for their turn to be worked at.
    pub analyses_waiting: IntGauge,
    /// Bytes of geometries whose questions are under way.
    pub(crate) body_bytes: IntGauge,
    /// Bytes of values of Zarr that are read or on their way.
    pub(crate) zarr_bytes: IntGauge,
    /// Pictures that were drawn and not stored, by why not.
    pub not_stored: IntCounterVec,
    /// Failed reads of the store.
    pub store_failures: IntCounter,
    /// Panics that were caught.
    pub panics: IntCounter,
    /// Products known.
    pub products: IntGauge,
    /// Connections.
    pub(crate) connections: Counts,
    /// Streams of pictures.
    pub(crate) streams: StreamMetrics,
}

/// What is timed: its name, what it is, its bounds.
const TIMES: [(&str, &str, &[f64]); 5] = [
    (
        "request_seconds",
        "Time until an answer begins.",
        &REQUEST_BOUNDS_S,
    ),
    ("draw_seconds", "Time to draw a picture.", &DRAW_BOUNDS_S),
    (
        "draw_wait_seconds",
        "Time a picture waited for its turn.",
        &DRAW_BOUNDS_S,
    ),
    (
        "look_up_seconds",
        "Time to look for a picture in the store.",
        &DRAW_BOUNDS_S,
    ),
    (
        "send_seconds",
        "Time from the beginning of an answer until its connection took the last byte.",
        &REQUEST_BOUNDS_S,
    ),
];

impl Metrics {
    /// Makes the metrics and registers them.
    pub fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        let name = |what: &str| format!("fluxglobe_tile_server_{what}");
        let counter =
            |what: &str, help: &str| registered(registry, IntCounter::new(name(what), help)?);
        let gauge = |what: &str, help: &str| registered(registry, IntGauge::new(name(what), help)?);
        let counters = |what: &str, help: &str, labels: &[&str]| {
            registered(
                registry,
                IntCounterVec::new(Opts::new(name(what), help), labels)?,
            )
        };
        let gauges = |what: &str, help: &str, labels: &[&str]| {
            registered(
                registry,
                IntGaugeVec::new(Opts::new(name(what), help), labels)?,
            )
        };
        let [requests_s, draws_s, waits_s, look_ups_s, sends_s] =
            TIMES.map(|(what, help, bounds)| {
                HistogramOpts::new(name(what), help).buckets(bounds.to_vec())
            });
        Ok(Self {
            requests: counters(
                "requests_total",
                "Answers by route.",
                &["operation", "method", "outcome"],
            )?,
            request_duration_s: registered(
                registry,
                HistogramVec::new(requests_s, &["operation"])?,
            )?,
            in_flight: gauges("in_flight", "Requests under way.", &["operation"])?,
            sent_bytes: counters("sent_bytes_total", "Bytes of bodies sent.", &["route"])?,
            cache_hits: counters(
                "cache_hits_total",
                "Pictures that needed no drawing.",
                &["source"],
            )?,
            cache_misses: counter("cache_misses_total", "Pictures that had to be drawn.")?,
            cache_bytes: gauge("cache_bytes", "Bytes of pictures in memory.")?,
            drawn: counters("drawn_total", "Pictures drawn.", &["mode", "outcome"])?,
            draw_duration_s: registered(registry, HistogramVec::new(draws_s, &["mode"])?)?,
            draw_wait_s: registered(registry, Histogram::with_opts(waits_s)?)?,
            look_up_s: registered(registry, Histogram::with_opts(look_ups_s)?)?,
            send_duration_s: registered(registry, HistogramVec::new(sends_s, &["operation"])?)?,
            refused: counter(
                "refused_total",
                "Requests sent away because too many waited.",
            )?,
            analyses_waiting: gauge("analyses_waiting", "Questions that wait for their turn.")?,
            body_bytes: gauge(
                "body_bytes",
                "Bytes of geometries that were sent along, and whose questions are under way.",
            )?,
            zarr_bytes: gauge(
                "zarr_bytes",
                "Bytes of values of Zarr that are read or on their way to clients.",
            )?,
            not_stored: counters(
                "not_stored_total",
                "Pictures drawn and not stored.",
                &["why"],
            )?,
            store_failures: counter("store_failures_total", "Failed reads of the store.")?,
            panics: counter("panics_total", "Panics that were caught.")?,
            products: gauge("products_count", "Products known.")?,
            connections: Counts::register(registry)?,
            streams: StreamMetrics::register(registry)?,
        })
    }

    /// Counts a picture that needed no drawing.
    pub fn hit(&self, source: Source) {
        self.cache_hits.with_label_values(&[source.label()]).inc();
    }
}

fn registered<C: Collector + Clone + 'static>(
    registry: &Registry,
    metric: C,
) -> Result<C, prometheus::Error> {
    registry.register(Box::new(metric.clone()))?;
    Ok(metric)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_servers_cannot_count_into_the_same_names() {
        let registry = Registry::new();
        assert!(Metrics::register(&registry).is_ok());
        assert!(Metrics::register(&registry).is_err());
    }
}
