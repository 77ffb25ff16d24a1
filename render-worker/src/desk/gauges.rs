//! What a desk holds, read when somebody asks for the metrics.

use prometheus::core::{Collector, Desc};
use prometheus::proto::MetricFamily;
use prometheus::{IntCounter, IntCounterVec, IntGauge, IntGaugeVec, Opts};

use super::{Desk, METRICS};

/// Gauges of one desk.
pub(crate) struct Gauges {
    desk: Desk,
    queue_length: IntGaugeVec,
    drawing: IntGauge,
    encoding: IntGauge,
    resident_bytes: IntGaugeVec,
    field_reads: IntCounterVec,
    prefetch: IntCounterVec,
    device_restarts: IntCounter,
}

impl Gauges {
    pub(crate) fn of(desk: &Desk) -> Result<Self, prometheus::Error> {
        let named = |what: &str, help: &str| Opts::new(format!("fluxglobe_{METRICS}_{what}"), help);
        Ok(Self {
            desk: desk.clone(),
            queue_length: IntGaugeVec::new(
                named(
                    "queue_length",
                    "Jobs that are not begun, by who wants them.",
                ),
                &["class"],
            )?,
            drawing: IntGauge::with_opts(named("drawing", "Jobs that hold a permit to draw."))?,
            encoding: IntGauge::with_opts(named(
                "encoding",
                "Pictures that are written as PNG, each on a core.",
            ))?,
            resident_bytes: IntGaugeVec::new(
                named(
                    "resident_bytes",
                    "Bytes of fields kept, in memory and on the device.",
                ),
                &["place"],
            )?,
            field_reads: IntCounterVec::new(
                named(
                    "frame_reads_total",
                    "Fields wanted, by whether they were there.",
                ),
                &["outcome"],
            )?,
            prefetch: IntCounterVec::new(
                named(
                    "prefetch_frames_total",
                    "Fields read ahead, those of them that were wanted then, and times that it was given up.",
                ),
                &["outcome"],
            )?,
            device_restarts: IntCounter::with_opts(named(
                "device_restarts_total",
                "Graphics devices that were given up and opened again.",
            ))?,
        })
    }
}

impl Collector for Gauges {
    fn desc(&self) -> Vec<&Desc> {
        [
            self.queue_length.desc(),
            self.drawing.desc(),
            self.encoding.desc(),
            self.resident_bytes.desc(),
            self.field_reads.desc(),
            self.prefetch.desc(),
            self.device_restarts.desc(),
        ]
        .concat()
    }

    fn collect(&self) -> Vec<MetricFamily> {
        let condition = self.desk.condition();
        let pipeline = self.desk.pipeline();
        let kept = pipeline.kept();
        let waiting = |class: &str, count: usize| {
            let gauge = self.queue_length.with_label_values(&[class]);
            gauge.set(count as i64);
        };
        waiting("on_demand", condition.waiting_on_demand);
        waiting("batch", condition.waiting_batch);
        self.drawing.set(condition.in_flight as i64);
        self.encoding.set(condition.encoding as i64);
        let bytes = |place: &str, bytes: u64| {
            let gauge = self.resident_bytes.with_label_values(&[place]);
            gauge.set(bytes as i64);
        };
        bytes("memory", kept.field_bytes);
        bytes("device", pipeline.renderer().resident_bytes());
        let reads = |outcome: &str, total: u64| {
            raise(&self.field_reads.with_label_values(&[outcome]), total);
        };
        reads("hit", kept.field_hits);
        reads("miss", kept.field_misses);
        let early = |outcome: &str, total: u64| {
            raise(&self.prefetch.with_label_values(&[outcome]), total);
        };
        early("read", kept.early_reads);
        early("used", kept.early_hits);
        early("cancelled", kept.early_cancelled);
        raise(&self.device_restarts, pipeline.renderer().device_restarts());
        [
            self.queue_length.collect(),
            self.drawing.collect(),
            self.encoding.collect(),
            self.resident_bytes.collect(),
            self.field_reads.collect(),
            self.prefetch.collect(),
            self.device_restarts.collect(),
        ]
        .concat()
    }
}

/// Brings a counter up to a total that is counted elsewhere.
fn raise(counter: &IntCounter, total: u64) {
    counter.inc_by(total.saturating_sub(counter.get()));
}
