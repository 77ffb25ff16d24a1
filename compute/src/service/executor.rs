//! Ballista's executor as a service: it fetches tasks from the scheduler, works on them, and serves their results.
//!
//! It is started before or after its scheduler and outlives it. Each of its lives has an identity of its own under the
//! executor's name: one that came back under the identity of a killed one would be taken for it, and the tasks that were
//! lost would be waited for for ever.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use ::service::{Part, Readiness, Red, Stop};
use arrow_flight::flight_service_server::FlightServiceServer;
use async_trait::async_trait;
use ballista_core::error::BallistaError;
use ballista_core::ids::new_instance_id;
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::serde::BallistaCodec;
use ballista_core::serde::protobuf::ExecutorRegistration;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::serde::scheduler::{
    ExecutorOperatingSystemSpecification, ExecutorSpecification,
};
use ballista_core::utils::{GrpcServerConfig, create_grpc_server};
use ballista_core::{BALLISTA_PROTOCOL_VERSION, ConfigProducer, RuntimeProducer};
use ballista_executor::execution_engine::DefaultExecutionEngine;
use ballista_executor::execution_loop::poll_loop;
use ballista_executor::executor::Executor as TaskRunner;
use ballista_executor::flight_service::BallistaFlightService;
use ballista_executor::health::ExecutorHealth;
use ballista_executor::metrics::LoggingMetricsCollector;
use datafusion::execution::memory_pool::FairSpillPool;
use datafusion::execution::runtime_env::RuntimeEnvBuilder;
use futures::future::BoxFuture;
use prometheus::{IntGauge, Registry};
use retry::Backoff;
use storage::Store;
use tokio::net::TcpListener;
use tokio::sync::{Notify, Semaphore};
use tokio::time::Instant;
use tonic::transport::Channel;
use tonic::transport::server::TcpIncoming;

use super::background::Background;
use super::executor_metrics::CountedEngine;
use super::executor_settings::ExecutorSettings;
use super::heartbeat;
use super::janitor::Janitor;
use super::retry_channel::RetryChannel;
use super::scheduler::store_part;
use super::work::WorkFolder;
use crate::{ComputeError, Objects, state};

/// How often an executor without a task asks for one.
const IDLE_ASK: Duration = Duration::from_millis(25);
/// And one that works on some: it reports those that ended with its questions.
const BUSY_ASK: Duration = Duration::from_millis(10);
/// For so long after its last task: the next stage of a query follows, or its next pass.
const STILL_BUSY: Duration = Duration::from_millis(500);
/// A scheduler that was not seen for so long is away.
const AWAY: Duration = Duration::from_secs(5);
/// How long the report on the last task may take: an executor without a free hand makes a request every five seconds.
const LAST_REPORT: Duration = Duration::from_secs(7);
/// The same of an executor that has nothing to do.
const IDLE_REPORT: Duration = Duration::from_millis(500);

/// An executor that holds its address and its work folder but does not work yet.
pub struct Executor {
    settings: ExecutorSettings,
    listener: TcpListener,
    address: SocketAddr,
    registration: ExecutorRegistration,
    work: Arc<WorkFolder>,
    /// Executors whose folders were found without their process.
    gone: Vec<String>,
    objects: Objects,
    store: Store,
    channel: Channel,
    retry_channel: RetryChannel,
    red: Red,
    work_bytes: IntGauge,
}

impl Executor {
    /// Takes the address and makes the work folder. The scheduler need not be there.
    pub fn start<'a>(
        settings: &'a ExecutorSettings,
        store: Store,
        registry: &'a Registry,
    ) -> BoxFuture<'a, Result<Self, ComputeError>> {
        Box::pin(async move {
            let objects = Objects::of(&store);
            Self::start_over(settings, store, objects, registry).await
        })
    }

    /// The same, reading objects from somewhere else.
    pub fn start_over<'a>(
        settings: &'a ExecutorSettings,
        store: Store,
        objects: Objects,
        registry: &'a Registry,
    ) -> BoxFuture<'a, Result<Self, ComputeError>> {
        Box::pin(async move {
            let listen = settings.executor_listen;
            let listener = TcpListener::bind(listen).await.map_err(ComputeError::machine(
            format!("cannot listen on {listen}; is another executor there? Give another --executor-listen"),
        ))?;
            let address = listener
                .local_addr()
                .map_err(ComputeError::machine("address of the executor"))?;
            let id = format!("{}-{}", settings.executor_name, new_instance_id());
            let (work, gone) = WorkFolder::make(&settings.executor_work, &id)?;
            let work_bytes = IntGauge::new(
                "fluxglobe_executor_work_bytes",
                "Intermediate results in the work folder.",
            )?;
            registry.register(Box::new(work_bytes.clone()))?;
            let channel = settings.scheduler.endpoint()?.connect_lazy();
            tracing::info!(%address, executor = id, tasks = settings.tasks(), "executor");
            Ok(Self {
                registration: registration(settings, &id, address),
                retry_channel: RetryChannel::new(channel.clone(), &id),
                red: Red::register(registry, "executor")?,
                settings: settings.clone(),
                listener,
                address,
                work: Arc::new(work),
                gone,
                objects: objects.storing(&store).spooling(&settings.executor_work),
                store,
                channel,
                work_bytes,
            })
        })
    }

    /// Where intermediate results are fetched from; the port is the real one where port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its identity in this life.
    pub fn id(&self) -> &str {
        &self.registration.id
    }

    /// Whether it can do its work.
    pub fn readiness(&self) -> Arc<dyn Readiness> {
        Arc::new(ExecutorReadiness {
            retry_channel: self.retry_channel.clone(),
            store: self.store.clone(),
        })
    }

    /// Works until asked to stop; then takes no more tasks, ends those it has, within the limit of the settings, and
    /// takes its leave of the scheduler, which gives what is left to others.
    pub fn run(self, stop: Stop) -> BoxFuture<'static, Result<(), ComputeError>> {
        Box::pin(async move {
            let hands = Arc::new(Semaphore::new(self.settings.tasks()));
            let nudge = Arc::new(Notify::new());
            let nudging = keep_asking(
                Arc::clone(&hands),
                self.settings.tasks(),
                Arc::clone(&nudge),
            );
            let mut nudging = Background(tokio::spawn(nudging));
            let mut working = Background(tokio::spawn(poll_loop(
                SchedulerGrpcClient::new(self.retry_channel.clone())
                    .max_decoding_message_size(state::MESSAGE_BYTES)
                    .max_encoding_message_size(state::MESSAGE_BYTES),
                Arc::new(self.runner()?),
                codec(),
                Some(Arc::clone(&nudge)),
                Some(Arc::clone(&hands)),
                ExecutorHealth::new(),
            )));
            let mut serving =
                Background(tokio::spawn(serve(self.listener, Arc::clone(&self.work))));
            let heart = heartbeat::run(
                self.channel,
                self.registration.clone(),
                self.retry_channel.clone(),
            );
            let mut heart = Background(tokio::spawn(heart));
            let janitor = Janitor {
                work: Arc::clone(&self.work),
                work_bytes: self.work_bytes,
                limit_bytes: self.settings.executor_work_bytes,
                hands: Arc::clone(&hands),
            };
            let mut janitor = Background(tokio::spawn(janitor.run()));
            let _obituaries = Background(tokio::spawn(tell_gone(
                self.retry_channel.clone(),
                self.gone,
            )));
            tokio::select! {
                () = stop.said() => {}
                ended = &mut serving.0 => return ended_early(ended),
                ended = &mut working.0 => return ended_early(ended),
                // These never end but by a panic; without them the executor would look well and be given nothing, or too much.
                ended = &mut nudging.0 => return ended_early(ended.map(Ok)),
                ended = &mut heart.0 => return ended_early(ended.map(Ok)),
                ended = &mut janitor.0 => return ended_early(ended.map(Ok)),
            }
            let limit = Duration::from_secs(self.settings.executor_drain_s);
            let tasks = self.settings.tasks();
            if !drain(janitor, &hands, tasks, &self.retry_channel, limit).await {
                tracing::warn!("stopping while tasks run; the scheduler gives them to others");
            }
            let id = &self.registration.id;
            if let Err(error) = self
                .retry_channel
                .tell_gone(id, "it was asked to stop")
                .await
            {
                tracing::warn!(%error, "left without a word; the scheduler notices by itself");
            }
            Ok(())
        })
    }

    fn runner(&self) -> Result<TaskRunner, ComputeError> {
        let failed = || ComputeError::engine("starting the executor");
        let config = state::ballista_config(NonZeroUsize::MIN);
        let base = state::runtime(&self.objects, state::MEMORY_BYTES).map_err(failed())?;
        let state = state::session_state(config, base, &self.objects).map_err(failed())?;
        let tasks = self.settings.tasks();
        let task_bytes = (self.settings.executor_memory_bytes / tasks as u64) as usize;
        let (objects, spills) = (self.objects.clone(), self.work.path().to_owned());
        let runtime: RuntimeProducer = Arc::new(move |_config| {
            let runtime = RuntimeEnvBuilder::new()
                .with_memory_pool(Arc::new(FairSpillPool::new(task_bytes)))
                .with_temp_file_path(spills.clone())
                .build_arc()?;
            objects.register(&runtime);
            Ok(runtime)
        });
        let config: ConfigProducer = Arc::new(|| state::ballista_config(NonZeroUsize::MIN));
        let folder = self.work.path().display().to_string();
        let engine = DefaultExecutionEngine::new();
        Ok(TaskRunner::new(
            self.registration.clone(),
            &folder,
            runtime,
            config,
            Arc::new(BallistaFunctionRegistry::from(&state)),
            Arc::new(LoggingMetricsCollector::default()),
            tasks,
            Arc::new(CountedEngine::new(engine, self.red.clone())),
        ))
    }
}

fn codec() -> BallistaCodec {
    BallistaCodec::default()
}

/// Connections that send each answer at once: a stage over tasks of several executors waits 40 ms for each small one else.
fn at_once(listener: TcpListener) -> TcpIncoming {
    TcpIncoming::from(listener).with_nodelay(Some(true))
}

/// Serves intermediate results to other executors and to clients.
async fn serve(listener: TcpListener, work: Arc<WorkFolder>) -> Result<(), BallistaError> {
    let folder = work.path().display().to_string();
    let flight = FlightServiceServer::new(BallistaFlightService::new(folder))
        .max_decoding_message_size(state::MESSAGE_BYTES)
        .max_encoding_message_size(state::MESSAGE_BYTES);
    create_grpc_server(&GrpcServerConfig::default())
        .add_service(flight)
        .serve_with_incoming(at_once(listener))
        .await
        .map_err(BallistaError::from)
}

fn ended_early(
    ended: Result<Result<(), BallistaError>, tokio::task::JoinError>,
) -> Result<(), ComputeError> {
    ended
        .unwrap_or_else(|e| Err(BallistaError::TokioError(e)))
        .map_err(ComputeError::cluster("working as executor"))
}

/// Has the scheduler asked for work again and again: more often while tasks run, since a task's end is reported with the
/// next question, and the next stage of a query begins no earlier.
async fn keep_asking(hands: Arc<Semaphore>, tasks: usize, nudge: Arc<Notify>) {
    let mut busy_until = Instant::now();
    loop {
        if hands.available_permits() < tasks {
            busy_until = Instant::now() + STILL_BUSY;
        }
        let is_idle = Instant::now() >= busy_until;
        tokio::time::sleep(if is_idle { IDLE_ASK } else { BUSY_ASK }).await;
        nudge.notify_one();
    }
}

/// Takes no more tasks and waits for those under way, and then for the report on the last of them. Have they ended within the
/// limit? Hands that the janitor held back work on none.
async fn drain(
    janitor: Background<()>,
    hands: &Semaphore,
    tasks: usize,
    retry_channel: &RetryChannel,
    limit: Duration,
) -> bool {
    let is_idle = || hands.available_permits() == tasks;
    let was_idle = is_idle();
    if was_idle {
        // A task that ended just now is reported with the next request, which an idle executor makes at once.
        reported(retry_channel, IDLE_REPORT).await;
    }
    let is_still_idle = was_idle && is_idle();
    let mut all = pin!(hands.acquire_many(tasks as u32));
    let held = tokio::select! {
        // In line before the janitor lets go: else the loop that asks for tasks would see free hands.
        biased;
        held = &mut all => Ok(held),
        () = janitor.end() => tokio::time::timeout(limit, all).await,
    };
    let Ok(Ok(_held)) = held else {
        return false;
    };
    if !is_still_idle {
        reported(retry_channel, LAST_REPORT.min(limit)).await;
    }
    true
}

/// Waits for two requests to be answered: the one under way may have been made before the last task ended.
async fn reported(retry_channel: &RetryChannel, limit: Duration) {
    let (enough, begun) = (retry_channel.answer_count() + 2, Instant::now());
    while retry_channel.answer_count() < enough && begun.elapsed() < limit {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Tells the scheduler of executors that died here and left their folders, so that it need not wait for them.
async fn tell_gone(retry_channel: RetryChannel, gone: Vec<String>) {
    for id in gone {
        let mut pauses = Backoff::default().pauses();
        while let Err(error) = retry_channel.tell_gone(&id, "its process is gone").await {
            tracing::debug!(executor = id, %error, "the scheduler cannot be told yet");
            tokio::time::sleep(pauses.next().unwrap_or(AWAY)).await;
        }
        tracing::info!(executor = id, "told the scheduler that an executor is gone");
    }
}

/// What the executor tells the scheduler about itself.
fn registration(
    settings: &ExecutorSettings,
    id: &str,
    address: SocketAddr,
) -> ExecutorRegistration {
    let specification = ExecutorSpecification::default().with_vcores(settings.tasks() as u32);
    ExecutorRegistration {
        id: id.to_owned(),
        host: settings.executor_host.clone(),
        port: u32::from(address.port()),
        // Tasks are pulled: nobody calls the executor on this port.
        grpc_port: 0,
        specification: Some(specification.into()),
        os_info: Some(ExecutorOperatingSystemSpecification::default().into()),
        ballista_protocol_version: BALLISTA_PROTOCOL_VERSION,
    }
}

struct ExecutorReadiness {
    retry_channel: RetryChannel,
    store: Store,
}

#[async_trait]
impl Readiness for ExecutorReadiness {
    async fn parts(&self) -> Vec<Part> {
        let seen = async {
            match self.retry_channel.silence() {
                Some(silence) if silence < AWAY => Ok("it answers".to_owned()),
                Some(silence) => Err(format!("not seen for {} s", silence.as_secs())),
                None => Err("never seen yet".to_owned()),
            }
        };
        vec![
            Part::required("scheduler", seen).await,
            store_part(&self.store).await,
        ]
    }
}

#[cfg(test)]
mod tests {
    use tonic::transport::Endpoint;

    use super::super::janitor::tests::over_its_limit;
    use super::*;

    #[tokio::test]
    async fn hands_that_are_held_back_are_no_tasks_that_are_waited_for() {
        let root = tempfile::tempdir().unwrap();
        let channel = Endpoint::from_static("http://127.0.0.1:1").connect_lazy();
        let retry_channel = RetryChannel::new(channel, "a");
        let hands = Arc::new(Semaphore::new(2));
        let limit = Duration::from_secs(1);
        let busy = Arc::clone(&hands).try_acquire_owned().unwrap();
        let folder = root.path().join("busy");
        let janitor = over_its_limit(&hands, &folder).await;
        let have_ended = drain(janitor, &hands, 2, &retry_channel, limit).await;
        assert!(!have_ended, "a task is not waited for");
        drop(busy);
        for limit in [Duration::ZERO, limit] {
            let folder = root.path().join(format!("{limit:?}"));
            let janitor = over_its_limit(&hands, &folder).await;
            let have_ended = drain(janitor, &hands, 2, &retry_channel, limit).await;
            assert!(have_ended, "it waits for nothing for {limit:?}");
        }
    }
}
