//! What pictures are drawn on, for whoever watches.

use prometheus::core::{Collector, Desc};
use prometheus::proto::MetricFamily;
use prometheus::{IntGaugeVec, Opts};

use crate::pipeline::Pipeline;

/// `fluxglobe_render_adapter_info`: what a desk draws on.
pub(crate) struct AdapterInfo {
    pipeline: Pipeline,
    info: IntGaugeVec,
}

impl AdapterInfo {
    pub(crate) fn of(pipeline: &Pipeline) -> Result<Self, prometheus::Error> {
        let help = "Adapters that pictures are drawn on, by name, how they are reached and what kind they are.";
        let name = "fluxglobe_render_adapter_info";
        Ok(Self {
            pipeline: pipeline.clone(),
            info: IntGaugeVec::new(Opts::new(name, help), &["name", "backend", "type"])?,
        })
    }
}

impl Collector for AdapterInfo {
    fn desc(&self) -> Vec<&Desc> {
        self.info.desc()
    }

    fn collect(&self) -> Vec<MetricFamily> {
        // After a fault it may be another one.
        self.info.reset();
        for adapter in self.pipeline.renderer().adapters() {
            let labels = [adapter.name(), adapter.backend(), adapter.kind()];
            self.info.with_label_values(&labels).inc();
        }
        self.info.collect()
    }
}
