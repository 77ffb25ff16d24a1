//! Ballista inside this process: a scheduler and one executor that speak over loopback.
//!
//! Ballista's own standalone mode keeps the intermediate files of a query for minutes, and for ever when the process
//! ends before; here they lie in a folder of ours and go when no query runs.

use std::path::Path;
use std::sync::Arc;

use arrow_flight::flight_service_server::FlightServiceServer;
use ballista::extension::{SessionConfigExt as _, SessionStateExt as _};
use ballista_core::error::{BallistaError, Result};
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::serde::BallistaCodec;
use ballista_core::serde::protobuf::ExecutorRegistration;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::serde::scheduler::{
    ExecutorOperatingSystemSpecification, ExecutorSpecification,
};
use ballista_core::utils::{GrpcServerConfig, create_grpc_server};
use ballista_core::{BALLISTA_PROTOCOL_VERSION, ConfigProducer, RuntimeProducer};
use ballista_executor::execution_loop;
use ballista_executor::executor::Executor;
use ballista_executor::flight_service::BallistaFlightService;
use ballista_executor::health::ExecutorHealth;
use ballista_executor::metrics::LoggingMetricsCollector;
use ballista_scheduler::standalone::new_standalone_scheduler_from_state;
use datafusion::execution::session_state::SessionState;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::{OwnedRwLockReadGuard, RwLock};
use tonic::transport::server::TcpIncoming;

/// Starts scheduler and executor; the session that hands its queries to them, and the folder they work in.
///
/// Both live for as long as the process; `partitions` is how many parts of a query the executor works on at once.
pub(crate) async fn start(
    state: SessionState,
    partitions: usize,
) -> Result<(SessionState, Arc<WorkFolder>)> {
    let scheduler = new_standalone_scheduler_from_state(&state).await?;
    let url = format!("http://localhost:{}", scheduler.port());
    let work = Arc::new(WorkFolder::new()?);
    start_executor(&state, partitions, &url, work.path()).await?;
    Ok((state.upgrade_for_ballista(url)?, work))
}

async fn start_executor(
    state: &SessionState,
    partitions: usize,
    scheduler_url: &str,
    work: &Path,
) -> Result<()> {
    let listener = TcpListener::bind("localhost:0").await?;
    let port = listener.local_addr()?.port();
    let config = state.config().clone();
    let runtime = Arc::clone(state.runtime_env());
    let message_bytes = config.ballista_grpc_client_max_message_size();
    let codec: BallistaCodec = BallistaCodec::new(
        config.ballista_logical_extension_codec(),
        config.ballista_physical_extension_codec(),
    );
    let runtime_producer: RuntimeProducer = Arc::new(move |_config| Ok(Arc::clone(&runtime)));
    let config_producer: ConfigProducer = Arc::new(move || config.clone());
    let work = work
        .to_str()
        .ok_or_else(|| BallistaError::Internal(format!("{} is not UTF-8", work.display())))?;
    let executor = Executor::with_default_execution_engine(
        registration(port, partitions),
        work,
        runtime_producer,
        config_producer,
        Arc::new(BallistaFunctionRegistry::from(state)),
        Arc::new(LoggingMetricsCollector::default()),
        partitions,
    );
    let flight = FlightServiceServer::new(BallistaFlightService::new(work.to_owned()))
        .max_decoding_message_size(message_bytes)
        .max_encoding_message_size(message_bytes);
    tokio::spawn(
        create_grpc_server(&GrpcServerConfig::default())
            .add_service(flight)
            .serve_with_incoming(TcpIncoming::from(listener).with_nodelay(Some(true))),
    );
    let scheduler = SchedulerGrpcClient::connect(scheduler_url.to_owned()).await?;
    let health = ExecutorHealth::new();
    tokio::spawn(execution_loop::poll_loop(
        scheduler,
        Arc::new(executor),
        codec,
        None,
        None,
        health,
    ));
    Ok(())
}

/// What the executor tells the scheduler about itself.
fn registration(port: u16, partitions: usize) -> ExecutorRegistration {
    let specification = ExecutorSpecification::default().with_vcores(partitions as u32);
    ExecutorRegistration {
        id: "in-process".to_owned(),
        host: Some("localhost".to_owned()),
        port: u32::from(port),
        // Tasks are pulled: nobody calls the executor on this port.
        grpc_port: 0,
        specification: Some(specification.into()),
        os_info: Some(ExecutorOperatingSystemSpecification::default().into()),
        ballista_protocol_version: BALLISTA_PROTOCOL_VERSION,
    }
}

/// Where the executor keeps intermediate files.
#[derive(Debug)]
pub(crate) struct WorkFolder {
    folder: TempDir,
    /// Held for reading by every running query.
    running: Arc<RwLock<()>>,
}

impl WorkFolder {
    fn new() -> std::io::Result<Self> {
        let folder = tempfile::Builder::new()
            .prefix("fluxglobe-ballista-")
            .tempdir()?;
        Ok(Self {
            folder,
            running: Arc::default(),
        })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Keeps intermediate files until the lease is dropped.
    pub(crate) async fn lease(self: &Arc<Self>) -> WorkLease {
        let running = Arc::clone(&self.running).read_owned().await;
        WorkLease {
            work: Arc::clone(self),
            running: Some(running),
        }
    }

    /// Removes what queries left. What cannot be removed now is left for the next time.
    fn clear(&self) {
        for entry in std::fs::read_dir(self.path())
            .into_iter()
            .flatten()
            .flatten()
        {
            if let Err(e) = std::fs::remove_dir_all(entry.path()) {
                tracing::debug!(path = %entry.path().display(), error = %e, "left for later");
            }
        }
    }
}

/// A running query's claim on the intermediate files.
#[derive(Debug)]
pub(crate) struct WorkLease {
    work: Arc<WorkFolder>,
    running: Option<OwnedRwLockReadGuard<()>>,
}

impl Drop for WorkLease {
    fn drop(&mut self) {
        drop(self.running.take());
        // The last query to end clears the folder; whoever comes meanwhile waits for it.
        if let Ok(alone) = Arc::clone(&self.work.running).try_write_owned() {
            let work = Arc::clone(&self.work);
            let clear = move || {
                work.clear();
                drop(alone);
            };
            match tokio::runtime::Handle::try_current() {
                Ok(runtime) => drop(runtime.spawn_blocking(clear)),
                Err(_) => clear(),
            }
        }
    }
}
