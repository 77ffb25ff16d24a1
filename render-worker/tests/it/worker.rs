//! A render worker in this process, reached over loopback as any other.

use std::sync::Arc;
use std::time::Duration;

use ::service::Stop;
use prometheus::Registry;
use render::Backend;
use render_worker::desk::{Desk, Order, Storing};
use render_worker::fleet::{Fleet, FleetSettings};
use render_worker::server::{Server, ServerError, Settings};
use render_worker::wire::Version;
use render_worker::wire::proto::renderer_client::RendererClient;
use storage::Store;
use tokio::task::JoinHandle;
use tonic::transport::Channel;

use crate::here::Here;

/// Anything that takes longer than this has failed.
pub(crate) const LIMIT: Duration = Duration::from_mins(2);

/// What a caller who has not looked in the store asks for.
pub(crate) const USUAL: Storing = Storing::LookUpAndKeep;

/// A running worker.
pub(crate) struct Worker {
    pub(crate) desk: Desk,
    pub(crate) name: String,
    pub(crate) stop: Stop,
    pub(crate) running: JoinHandle<Result<(), ServerError>>,
    pub(crate) registry: Registry,
}

/// Settings of a worker at a free port.
pub(crate) fn settings(draws_at_once: u8, draw_queue: u16) -> Settings {
    Settings {
        render_listen: "127.0.0.1:0".parse().unwrap(),
        draws_at_once: Some(draws_at_once),
        draw_queue,
        field_memory_mib: 64,
        device_field_memory_mib: None,
        fields_ahead: 1,
        render_drain_s: 60,
    }
}

impl Worker {
    /// A worker that draws with the twins.
    pub(crate) fn start(store: &Store, draws_at_once: u8, draw_queue: u16) -> Self {
        Self::start_with(
            store,
            &settings(draws_at_once, draw_queue),
            Backend::Cpu,
            Version::own(),
        )
    }

    pub(crate) fn start_with(
        store: &Store,
        settings: &Settings,
        backend: Backend,
        version: Version,
    ) -> Self {
        let registry = Registry::new();
        let limits = settings.limits();
        let desk = Desk::open(store.clone(), backend, &limits, &registry).unwrap();
        let server = Server::bind(desk.clone(), settings).unwrap();
        let name = server.address().to_string();
        let stop = Stop::new();
        let running = tokio::spawn(server.as_version(version).run(stop.clone()));
        Self {
            desk,
            name,
            stop,
            running,
            registry,
        }
    }

    /// A bare connection.
    pub(crate) async fn client(&self) -> RendererClient<Channel> {
        let address = format!("http://{}", self.name);
        let client = RendererClient::connect(address).await.unwrap();
        client.max_decoding_message_size(render_worker::wire::MOST_REPLY_BYTES)
    }

    /// The sum of a metric over the series that have all these labels.
    pub(crate) fn metric(&self, name: &str, labels: &[(&str, &str)]) -> u64 {
        metric(&self.registry, name, labels)
    }

    /// Waits until the desk is as it should be.
    pub(crate) async fn until(&self, what: &str, is_so: impl Fn(&Self) -> bool) {
        until(what, || is_so(self)).await;
    }
}

/// Waits for a condition.
pub(crate) async fn until(what: &str, is_so: impl Fn() -> bool) {
    let watching = async {
        while !is_so() {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    let seen = tokio::time::timeout(LIMIT, watching).await;
    assert!(seen.is_ok(), "never seen: {what}");
}

/// The sum of a metric over the series that have all these labels; 0 if there is none.
pub(crate) fn metric(registry: &Registry, name: &str, labels: &[(&str, &str)]) -> u64 {
    let families = registry.gather();
    let family = families.iter().find(|family| family.name() == name);
    let series = family
        .map(prometheus::proto::MetricFamily::get_metric)
        .unwrap_or_default();
    let fits = |m: &&prometheus::proto::Metric| {
        let has = |(name, value): &(&str, &str)| {
            let labels = m.get_label();
            labels
                .iter()
                .any(|label| label.name() == *name && label.value() == *value)
        };
        labels.iter().all(has)
    };
    let value =
        |m: &prometheus::proto::Metric| m.get_counter().get_value() + m.get_gauge().get_value();
    series.iter().filter(fits).map(value).sum::<f64>() as u64
}

/// Settings of a fleet of these workers; every worker has all the time there is.
pub(crate) fn fleet_settings(workers: &[&str]) -> FleetSettings {
    FleetSettings {
        render_workers: workers.iter().map(|name| name.parse().unwrap()).collect(),
        render_deadline_ms: 120_000,
        render_hedge_ms: 600_000,
        render_in_flight: 256,
        render_parts_above: render_worker::fleet::LARGE_PIXELS,
    }
}

/// A fleet of these workers, each of which has been asked how it is.
pub(crate) async fn fleet(workers: &[&str]) -> Fleet {
    fleet_with(&fleet_settings(workers), &Registry::new()).await
}

pub(crate) async fn fleet_with(settings: &FleetSettings, registry: &Registry) -> Fleet {
    fleet_over(&Store::memory(), settings, registry).await
}

/// The same where large pictures that are put together are kept in a store.
pub(crate) async fn fleet_over(
    store: &Store,
    settings: &FleetSettings,
    registry: &Registry,
) -> Fleet {
    let fleet = Fleet::start(settings, store.clone(), registry).unwrap();
    let unknown = render_worker::fleet::Health::Unknown;
    until("every worker was asked", || {
        let health = fleet.health();
        !health.is_empty() && health.values().all(|health| *health != unknown)
    })
    .await;
    fleet
}

/// What a job looks like, drawn in this process without a server.
pub(crate) async fn drawn_here(store: &Store, job: &contract::job::RenderJob) -> bytes::Bytes {
    let service = Here::new(store.clone(), Backend::Cpu);
    service.draw(job).await.unwrap()
}

/// A task that asks a fleet for a picture.
pub(crate) fn ask(
    fleet: &Arc<Fleet>,
    job: &contract::job::RenderJob,
) -> JoinHandle<Result<render_worker::fleet::Picture, render_worker::fleet::FleetError>> {
    let (fleet, job) = (Arc::clone(fleet), job.clone());
    tokio::spawn(async move { fleet.draw(&job, Order::on_demand(USUAL), "test").await })
}
