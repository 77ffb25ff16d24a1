//! Ballista's scheduler as a service: clients send it queries, executors fetch tasks from it.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use ::service::{Part, Readiness, Stop};
use async_trait::async_trait;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::error::BallistaError;
use ballista_core::ids::new_instance_id;
use ballista_core::serde::BallistaCodec;
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::{SchedulerConfig, TaskDistributionPolicy};
use ballista_scheduler::scheduler_process::start_grpc_service_with_listener;
use ballista_scheduler::scheduler_server::SchedulerServer;
use futures::future::BoxFuture;
use prometheus::{IntGauge, Registry};
use storage::Store;
use tokio::net::{TcpListener, TcpSocket};
use tokio::time::Instant;

use super::background::Background;
use super::dealing::Dealing;
use super::room::Room;
use super::scheduler_metrics::QueryMetrics;
use super::scheduler_watch::Seen;
use crate::{ComputeError, Objects, state};

/// How often executors are looked at for signs of life.
const LOOK_SECONDS: u64 = 1;
/// How long queries without any executor are kept waiting for one.
const NO_EXECUTOR_SECONDS: u64 = 600;
/// Connections that wait to be taken.
const WAITING_CONNECTIONS: u32 = 1024;
/// How often a drain looks whether queries still run.
const DRAIN_LOOK: Duration = Duration::from_millis(100);
/// An object that is never there: asking for it shows whether the store answers.
const STORE_PROBE: &str = "manifests/none";

/// What a scheduler is told.
#[derive(Debug, Clone, clap::Args)]
pub struct SchedulerSettings {
    /// Address that clients and executors connect to.
    #[arg(
        long,
        env = "FLUXGLOBE_SCHEDULER_LISTEN",
        default_value = "127.0.0.1:50050"
    )]
    pub scheduler_listen: SocketAddr,
    /// Seconds without a sign of life after which an executor is lost and its tasks are given to others, 2 to 60. One
    /// second more may pass until that is noticed.
    #[arg(long, env = "FLUXGLOBE_EXECUTOR_LOST_AFTER_S", default_value_t = 3,
          value_parser = clap::value_parser!(u64).range(2..=60))]
    pub executor_lost_after_s: u64,
    /// Seconds that executors keep a query's result for its client, 10 to 86,400.
    #[arg(long, env = "FLUXGLOBE_JOB_RESULT_S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(10..=86_400))]
    pub job_result_s: u64,
    /// Seconds that running queries are waited for when the scheduler is asked to stop, 0 to 3,600.
    #[arg(long, env = "FLUXGLOBE_SCHEDULER_DRAIN_S", default_value_t = 20,
          value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub scheduler_drain_s: u64,
}

/// A scheduler that holds its address but does not answer yet.
pub struct Scheduler {
    address: SocketAddr,
    drain: Duration,
    serving: BoxFuture<'static, Result<(), BallistaError>>,
    /// Queries queued or running.
    query_count: Box<dyn Fn() -> usize + Send + Sync>,
    executors: IntGauge,
    store: Store,
    watch: Background<()>,
    count: Background<()>,
}

impl Scheduler {
    /// Takes the address and starts watching executors.
    pub fn start<'a>(
        settings: &'a SchedulerSettings,
        store: Store,
        registry: &'a Registry,
    ) -> BoxFuture<'a, Result<Self, ComputeError>> {
        Box::pin(async move {
            let listen = settings.scheduler_listen;
            let listener = bound(listen).map_err(ComputeError::machine(
            format!("cannot listen on {listen}; is another scheduler there? Give another --scheduler-listen"),
        ))?;
            let address = listener
                .local_addr()
                .map_err(ComputeError::machine("address of the scheduler"))?;
            let objects = Objects::of(&store);
            let seen = Seen::register(registry)?;
            let config = Arc::new(config(settings, address, &objects, seen.room.clone())?);
            let failed = || ComputeError::cluster("starting the scheduler");
            config.validate().map_err(failed())?;
            let cluster = BallistaCluster::new_from_config(&config)
                .await
                .map_err(failed())?;
            let metrics = Arc::new(QueryMetrics::register(registry)?);
            let mut server = SchedulerServer::new(
                address.to_string(),
                cluster,
                BallistaCodec::default(),
                config,
                metrics,
            );
            server.init().await.map_err(failed())?;
            let changes = server.cluster_state_events().await.map_err(failed())?;
            let watch = seen
                .clone()
                .watch(changes, server.state.executor_manager.clone());
            let state = Arc::clone(&server.state);
            let count = seen
                .clone()
                .count(move || state.task_manager.get_running_job_cache());
            let counted = server.clone();
            tracing::info!(%address, "scheduler");
            Ok(Self {
                address,
                drain: Duration::from_secs(settings.scheduler_drain_s),
                serving: Box::pin(start_grpc_service_with_listener(listener, server)),
                query_count: Box::new(move || {
                    counted.pending_job_number() + counted.running_job_number()
                }),
                executors: seen.executors,
                store,
                watch: Background(tokio::spawn(watch)),
                count: Background(tokio::spawn(count)),
            })
        })
    }

    /// Where it listens; the port is the real one where port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether it can do its work.
    pub fn readiness(&self) -> Arc<dyn Readiness> {
        Arc::new(SchedulerReadiness {
            address: self.address,
            executors: self.executors.clone(),
            store: self.store.clone(),
        })
    }

    /// Serves until asked to stop; then waits for running queries, within the limit of the settings.
    pub fn run(mut self, stop: Stop) -> BoxFuture<'static, Result<(), ComputeError>> {
        Box::pin(async move {
            let (drain, query_count) = (self.drain, self.query_count);
            let drained = async move {
                stop.said().await;
                let begun = Instant::now();
                while query_count() > 0 && begun.elapsed() < drain {
                    tokio::time::sleep(DRAIN_LOOK).await;
                }
                let left = query_count();
                if left > 0 {
                    tracing::warn!(left, "stopping while queries run; their clients ask again");
                }
            };
            tokio::select! {
                () = drained => Ok(()),
                served = self.serving => served.map_err(ComputeError::cluster("serving as scheduler")),
                // These end by a panic alone; without them nobody would notice lost executors, or scale by what waits.
                ended = &mut self.watch.0 => watched(ended),
                ended = &mut self.count.0 => watched(ended),
            }
        })
    }
}

/// Listens; connections send each answer at once, which they have from this socket: an executor asks a hundred times a second.
fn bound(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() {
        TcpSocket::new_v4()?
    } else {
        TcpSocket::new_v6()?
    };
    // As tokio's and the standard library's listeners do: a port that was in use a moment ago is free.
    socket.set_reuseaddr(true)?;
    socket.set_nodelay(true)?;
    socket.bind(address)?;
    socket.listen(WAITING_CONNECTIONS)
}

fn watched(ended: Result<(), tokio::task::JoinError>) -> Result<(), ComputeError> {
    ended
        .map_err(BallistaError::TokioError)
        .map_err(ComputeError::cluster("watching executors and queries"))
}

fn config(
    settings: &SchedulerSettings,
    address: SocketAddr,
    objects: &Objects,
    room: Room,
) -> Result<SchedulerConfig, ComputeError> {
    let runtime = state::runtime(objects, state::MEMORY_BYTES)
        .map_err(ComputeError::engine("starting the scheduler"))?;
    let objects = objects.clone();
    let sessions = move |config| {
        let mut own = state::session_state(room.fill(config), Arc::clone(&runtime), &objects)?;
        own.add_analyzer_rule(Arc::new(Dealing));
        Ok(own)
    };
    Ok(SchedulerConfig {
        scheduler_id: new_instance_id(),
        bind_host: address.ip().to_string(),
        bind_port: address.port(),
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        task_distribution: TaskDistributionPolicy::Bias,
        executor_timeout_seconds: settings.executor_lost_after_s,
        expire_dead_executor_interval_seconds: LOOK_SECONDS,
        no_executors_grace_period_seconds: NO_EXECUTOR_SECONDS,
        finished_job_data_clean_up_interval_seconds: settings.job_result_s,
        finished_job_state_clean_up_interval_seconds: settings.job_result_s,
        grpc_server_max_decoding_message_size: state::MESSAGE_BYTES as u32,
        grpc_server_max_encoding_message_size: state::MESSAGE_BYTES as u32,
        override_config_producer: Some(Arc::new(|| state::ballista_config(NonZeroUsize::MIN))),
        override_session_builder: Some(Arc::new(sessions)),
        ..SchedulerConfig::default()
    })
}

struct SchedulerReadiness {
    address: SocketAddr,
    executors: IntGauge,
    store: Store,
}

#[async_trait]
impl Readiness for SchedulerReadiness {
    async fn parts(&self) -> Vec<Part> {
        let serving = async {
            let there = tokio::net::TcpStream::connect(self.address).await;
            there.map(|_connection| "it takes queries".to_owned())
        };
        let executors = Part {
            name: "executors",
            ok: self.executors.get() > 0,
            // Executors find the scheduler through its readiness: it must not wait for them.
            required: false,
            detail: format!("{} of them", self.executors.get()),
        };
        vec![
            Part::required("scheduler", serving).await,
            store_part(&self.store).await,
            executors,
        ]
    }
}

/// Can objects be read?
pub(super) async fn store_part(store: &Store) -> Part {
    let asked = async {
        let probe = STORE_PROBE.parse()?;
        store.exists(&probe).await?;
        Ok::<_, ComputeError>("it answers".to_owned())
    };
    Part::required("store", asked).await
}
