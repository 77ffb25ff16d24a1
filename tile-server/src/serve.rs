//! Listening: an address in, answers until told to stop, and an end that lets requests under way finish.

use std::convert::Infallible;
use std::future::{Future, IntoFuture as _, ready};
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::Duration;

use axum::extract::Request;
use axum::serve::IncomingStream;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tower::{ServiceBuilder, service_fn};

use crate::client::Client;
use crate::config::Settings;
use crate::connections::Door;
use crate::error::ServeError;
use crate::router::router;
use crate::state::AppState;

/// A server that holds its address but does not answer yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    state: AppState,
}

/// Listens and answers until `shutdown` is there: [`Server::bind`] and [`Server::run`] in one.
pub async fn serve(
    settings: &Settings,
    state: AppState,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    Server::bind(settings, state).await?.run(shutdown).await
}

impl Server {
    /// Takes the address, so that its caller can say where to look before anything else is ready.
    pub async fn bind(settings: &Settings, state: AppState) -> Result<Self, ServeError> {
        let address = settings.listen;
        let listener = TcpListener::bind(address)
            .await
            .map_err(|source| match source.kind() {
                ErrorKind::AddrInUse => ServeError::PortTaken { address },
                _ => ServeError::Listen { address, source },
            })?;
        let address = listener
            .local_addr()
            .map_err(|source| ServeError::Listen { address, source })?;
        Ok(Self {
            listener,
            address,
            state,
        })
    }

    /// Where it listens; the port is the real one where port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until `shutdown` is there, then takes no new connections and waits for requests under way, no longer
    /// than the drain limit.
    pub async fn run(
        self,
        shutdown: impl Future<Output = ()> + Send + 'static,
    ) -> Result<(), ServeError> {
        let limit = Duration::from_secs(self.state.settings.drain_limit_s);
        let (stop, mut stopping) = watch::channel(false);
        let door = Door::new(self.listener, &self.state.settings, &self.state.metrics);
        let ending = self.state.clone();
        let until_told = async move {
            shutdown.await;
            ending.news.close();
            ending.streams.close();
            stop.send_replace(true);
        };
        let routes = router(self.state);
        // The service of one connection, which is told while an answer is worked at.
        let service = service_fn(move |connection: IncomingStream<'_, Door>| {
            let answers = connection.io().answers();
            let client = Client::at(*connection.remote_addr());
            let with_client = move |mut request: Request| {
                request.extensions_mut().insert(client);
                request
            };
            let counted = ServiceBuilder::new()
                .map_request(with_client)
                .map_future(move |one| answers.counting(one));
            ready(Ok::<_, Infallible>(counted.service(routes.clone())))
        });
        let serving = axum::serve(door, service).with_graceful_shutdown(until_told);
        let drained = async move {
            // An error means that serving ended by itself: then this branch has nothing to limit.
            if stopping.wait_for(|stop| *stop).await.is_err() {
                std::future::pending::<()>().await;
            }
            tokio::time::sleep(limit).await;
        };
        tokio::select! {
            ended = serving.into_future() => ended.map_err(ServeError::Stopped),
            () = drained => {
                tracing::warn!(limit_s = limit.as_secs(), "requests under way were cut off");
                Ok(())
            }
        }
    }
}
