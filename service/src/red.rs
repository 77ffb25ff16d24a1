//! Rate, errors and duration of a service's operations, under one naming scheme:
//! `fluxglobe_<service>_requests_total{operation,outcome}`, `..._request_seconds{operation}`, `..._in_flight{operation}`.

use std::time::Instant;

use prometheus::{HistogramOpts, HistogramVec, IntCounterVec, IntGaugeVec, Opts, Registry};

/// From a cached answer to a long derivation, seconds.
const BUCKETS_S: [f64; 14] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0, 600.0,
];

/// How an operation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// As wanted.
    Ok,
    /// Refused because of what was asked.
    Refused,
    /// Sent away because there was too much to do.
    Busy,
    /// Failed; it may succeed later.
    Retryable,
    /// Failed through a fault of ours.
    Failed,
    /// Nobody waited for it any more.
    Dropped,
}

impl Outcome {
    /// Its label.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Refused => "refused",
            Self::Busy => "busy",
            Self::Retryable => "retryable",
            Self::Failed => "failed",
            Self::Dropped => "dropped",
        }
    }
}

/// Metrics of one service's operations; clones share them.
#[derive(Debug, Clone)]
pub struct Red {
    requests: IntCounterVec,
    seconds: HistogramVec,
    in_flight: IntGaugeVec,
}

impl Red {
    /// Registers the three metrics of a service (`ingestd`, `tile_server`).
    pub fn register(registry: &Registry, service: &str) -> Result<Self, prometheus::Error> {
        let name = |what: &str| format!("fluxglobe_{service}_{what}");
        let requests = IntCounterVec::new(
            Opts::new(
                name("requests_total"),
                "Operations that ended, by how they ended.",
            ),
            &["operation", "outcome"],
        )?;
        let seconds = HistogramVec::new(
            HistogramOpts::new(
                name("request_seconds"),
                "Time that operations took, seconds.",
            )
            .buckets(BUCKETS_S.to_vec()),
            &["operation"],
        )?;
        let in_flight = IntGaugeVec::new(
            Opts::new(name("in_flight"), "Operations under way."),
            &["operation"],
        )?;
        registry.register(Box::new(requests.clone()))?;
        registry.register(Box::new(seconds.clone()))?;
        registry.register(Box::new(in_flight.clone()))?;
        Ok(Self {
            requests,
            seconds,
            in_flight,
        })
    }

    /// Metrics that nobody looks at, for command-line use of the same code.
    ///
    /// # Panics
    /// Never: the registry is new and the names are constant.
    pub fn unseen() -> Self {
        Self::register(&Registry::new(), "unseen").expect("a new registry has no name twice")
    }

    /// Begins an operation; a guard that is dropped without an outcome counts as dropped.
    pub fn start(&self, operation: &'static str) -> Running {
        self.in_flight.with_label_values(&[operation]).inc();
        Running {
            red: self.clone(),
            operation,
            begun: Instant::now(),
            outcome: Outcome::Dropped,
        }
    }
}

/// An operation under way.
#[derive(Debug)]
pub struct Running {
    red: Red,
    operation: &'static str,
    begun: Instant,
    outcome: Outcome,
}

impl Running {
    /// Ends it.
    pub fn done(mut self, outcome: Outcome) {
        self.outcome = outcome;
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let labels = [self.operation];
        self.red.in_flight.with_label_values(&labels).dec();
        self.red
            .seconds
            .with_label_values(&labels)
            .observe(self.begun.elapsed().as_secs_f64());
        self.red
            .requests
            .with_label_values(&[self.operation, self.outcome.as_str()])
            .inc();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_operation_is_counted_once_by_how_it_ended() {
        let registry = Registry::new();
        let red = Red::register(&registry, "test").unwrap();
        red.start("draw").done(Outcome::Ok);
        drop(red.start("draw"));
        let running = red.start("draw");
        assert_eq!(red.in_flight.with_label_values(&["draw"]).get(), 1);
        running.done(Outcome::Busy);
        for outcome in ["ok", "dropped", "busy"] {
            assert_eq!(
                red.requests.with_label_values(&["draw", outcome]).get(),
                1,
                "{outcome}"
            );
        }
        assert_eq!(red.in_flight.with_label_values(&["draw"]).get(), 0);
        assert!(
            Red::register(&registry, "test").is_err(),
            "one name, two metrics"
        );
    }
}
