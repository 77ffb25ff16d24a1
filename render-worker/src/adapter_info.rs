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
        let help = "1, with what pictures are drawn on: its name, how it is reached, what kind of adapter it is.";
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
        let adapter = self.pipeline.renderer().adapter();
        // After a fault it may be another one.
        self.info.reset();
        let labels = [adapter.name(), adapter.backend(), adapter.kind()];
        self.info.with_label_values(&labels).set(1);
        self.info.collect()
    }
}
