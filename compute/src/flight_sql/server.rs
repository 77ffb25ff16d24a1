//! A Flight SQL server: an address to listen at, turns for questions, an orderly end.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use arrow_flight::flight_service_server::FlightServiceServer;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;

use super::access::Access;
use super::limits::FlightSqlLimits;
use super::service::Questions;
use crate::ComputeError;
use crate::sql::Sql;

/// Calls of one connection at a time: more wait.
const CALLS_AT_ONCE: usize = 32;
/// A client that does not answer within this after as long in silence is gone, and its questions with it.
const SILENCE: Duration = Duration::from_secs(20);

/// A server that listens.
pub struct FlightSqlServer {
    listener: TcpListener,
    address: SocketAddr,
    questions: Questions,
    access: Access,
}

impl FlightSqlServer {
    /// Listens; calls are answered once it runs.
    ///
    /// # Errors
    /// The address cannot be taken.
    pub async fn bind(
        address: SocketAddr,
        access: Access,
        sql: Sql,
        limits: FlightSqlLimits,
    ) -> Result<Self, ComputeError> {
        let failed = || ComputeError::machine(format!("listening at {address}"));
        let listener = TcpListener::bind(address).await.map_err(failed())?;
        let turns = Arc::new(Semaphore::new(limits.questions_at_once.get()));
        Ok(Self {
            address: listener.local_addr().map_err(failed())?,
            listener,
            questions: Questions::new(sql, limits, turns, &access)?,
            access,
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until it is told to stop; then no new call is taken, and those under way end.
    ///
    /// # Errors
    /// The network fails.
    pub async fn run(self, stop: impl Future<Output = ()>) -> Result<(), ComputeError> {
        let flight = FlightServiceServer::new(self.questions);
        let served = Server::builder()
            .concurrency_limit_per_connection(CALLS_AT_ONCE)
            .http2_keepalive_interval(Some(SILENCE))
            .http2_keepalive_timeout(Some(SILENCE))
            .add_service(InterceptedService::new(flight, self.access))
            .serve_with_incoming_shutdown(
                TcpIncoming::from(self.listener).with_nodelay(Some(true)),
                stop,
            );
        let failed =
            |error| ComputeError::machine("serving Flight SQL")(std::io::Error::other(error));
        served.await.map_err(failed)
    }
}
