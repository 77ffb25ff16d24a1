//! What operators see of ingest: its operations, how fresh landed files are, what was refused, how much waits.

use contract::event::RejectReason;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::TimeMs;
use prometheus::{Gauge, Histogram, HistogramOpts, IntCounter, IntCounterVec, Opts, Registry};
use service::{Outcome, Red, Running};

use crate::error::Stop;

/// From a file that is there already to one whose source was away for long, seconds.
const BUCKETS_S: [f64; 13] = [
    0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 1800.0, 21600.0,
];

/// Metrics of ingest; clones share them.
#[derive(Debug, Clone)]
pub struct Metrics {
    red: Red,
    notice_to_landed: Histogram,
    rejected: IntCounterVec,
    superseded: IntCounter,
    bytes: IntCounter,
    masked: IntCounterVec,
    /// NaN until it is known: no lag is not the same as none looked up.
    lag: Gauge,
}

impl Metrics {
    /// Registers `fluxglobe_ingestd_...`.
    pub fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        Self::named(registry, Red::register(registry, "ingestd")?)
    }

    /// Metrics that nobody looks at, for command-line use of the same code.
    ///
    /// # Panics
    /// Never: the registry is new and the names are constant.
    pub fn unseen() -> Self {
        Self::named(&Registry::new(), Red::unseen()).expect("a new registry has no name twice")
    }

    fn named(registry: &Registry, red: Red) -> Result<Self, prometheus::Error> {
        let seconds = HistogramOpts::new(
            "fluxglobe_ingestd_notice_to_landed_seconds",
            "Time from a notice to its event of a landed file, seconds.",
        );
        let new = Self {
            red,
            notice_to_landed: Histogram::with_opts(seconds.buckets(BUCKETS_S.to_vec()))?,
            rejected: IntCounterVec::new(
                Opts::new(
                    "fluxglobe_ingestd_rejected_total",
                    "Notices that were refused, by class of the reason.",
                ),
                &["reason"],
            )?,
            superseded: IntCounter::new(
                "fluxglobe_ingestd_superseded_total",
                "Files that were left as they are: files of later notices have their time.",
            )?,
            bytes: IntCounter::new(
                "fluxglobe_ingestd_fetched_bytes_total",
                "Bytes of files that were fetched.",
            )?,
            masked: IntCounterVec::new(
                Opts::new(
                    "fluxglobe_ingestd_masked_cells_total",
                    "Cells that landed files gave a value for and that hold none, and values of files of observations that are none, by product or dataset and why.",
                ),
                &["product", "reason"],
            )?,
            lag: Gauge::new(
                "fluxglobe_ingestd_lag_messages",
                "Notices that no ingest service has finished.",
            )?,
        };
        new.lag.set(f64::NAN);
        registry.register(Box::new(new.notice_to_landed.clone()))?;
        registry.register(Box::new(new.rejected.clone()))?;
        registry.register(Box::new(new.superseded.clone()))?;
        registry.register(Box::new(new.bytes.clone()))?;
        registry.register(Box::new(new.masked.clone()))?;
        registry.register(Box::new(new.lag.clone()))?;
        Ok(new)
    }

    /// Begins an operation.
    pub(crate) fn start(&self, operation: &'static str) -> Running {
        self.red.start(operation)
    }

    /// An operation from its beginning to its end.
    pub(crate) async fn timed<T>(
        &self,
        operation: &'static str,
        work: impl Future<Output = Result<T, Stop>>,
    ) -> Result<T, Stop> {
        let running = self.red.start(operation);
        let done = work.await;
        running.done(ended(&done));
        done
    }

    pub(crate) fn fetched(&self, bytes: u64) {
        self.bytes.inc_by(bytes);
    }

    pub(crate) fn landed(&self, noticed: Option<TimeMs>, now: TimeMs) {
        if let Some(noticed) = noticed {
            let ms = (now.ms() - noticed.ms()).max(0);
            self.notice_to_landed.observe(ms as f64 / 1000.0);
        }
    }

    /// Counts what was masked of a file that landed; nothing, too, so that each product has its series from the first file on.
    pub(crate) fn masked(&self, product: &ProductId, masked: MaskedCells) {
        for (reason, count) in masked.by_reason() {
            let labels = [product.as_str(), reason];
            self.masked.with_label_values(&labels).inc_by(count);
        }
    }

    pub(crate) fn rejected(&self, reason: RejectReason) {
        self.rejected.with_label_values(&[class(reason)]).inc();
    }

    pub(crate) fn superseded(&self) {
        self.superseded.inc();
    }

    pub(crate) fn lag(&self, messages: u64) {
        self.lag.set(messages as f64);
    }
}

/// How an operation ended.
pub(crate) fn ended<T>(done: &Result<T, Stop>) -> Outcome {
    match done {
        Ok(_) => Outcome::Ok,
        Err(Stop::Rejected(_)) => Outcome::Refused,
        Err(Stop::Failed(error)) if error.is_retryable() => Outcome::Retryable,
        Err(Stop::Failed(_)) => Outcome::Failed,
    }
}

/// The name of a reason as events have it.
pub(crate) fn class(reason: RejectReason) -> &'static str {
    match reason {
        RejectReason::Unreadable => "unreadable",
        RejectReason::Corrupt => "corrupt",
        RejectReason::TooLarge => "too_large",
        RejectReason::NoVariable => "no_variable",
        RejectReason::Unit => "unit",
        RejectReason::Time => "time",
        RejectReason::Grid => "grid",
        RejectReason::Values => "values",
        RejectReason::Conflict => "conflict",
        RejectReason::Checksum => "checksum",
        RejectReason::Location => "location",
        RejectReason::Unavailable => "unavailable",
        RejectReason::Message => "message",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_has_the_name_that_events_have() {
        for reason in [
            RejectReason::TooLarge,
            RejectReason::NoVariable,
            RejectReason::Message,
        ] {
            let json = serde_json::to_string(&reason).unwrap();
            assert_eq!(json, format!("\"{}\"", class(reason)));
        }
    }
}
