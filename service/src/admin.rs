//! `/healthz`, `/readyz` and `/metrics` of services whose own port speaks something else than HTTP.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;
use axum::{Json, Router};
use prometheus::{Encoder as _, Registry, TextEncoder};
use tokio::net::TcpListener;

use crate::{Readiness, Report, ServiceError, Stop};

#[derive(Clone)]
struct Shown {
    registry: Registry,
    readiness: Arc<dyn Readiness>,
}

/// A server that holds its address but does not answer yet.
pub struct Admin {
    listener: TcpListener,
    address: SocketAddr,
    router: Router,
}

impl Admin {
    /// Takes the address.
    pub async fn bind(
        address: SocketAddr,
        registry: Registry,
        readiness: Arc<dyn Readiness>,
    ) -> Result<Self, ServiceError> {
        let listen = |source| ServiceError::Listen { address, source };
        let listener = TcpListener::bind(address).await.map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        Ok(Self {
            listener,
            address,
            router: router(registry, readiness),
        })
    }

    /// Where it listens; the port is the real one where port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until the end: it is the last to stop, so that the end can be watched.
    pub async fn run(self, stop: Stop) -> Result<(), ServiceError> {
        axum::serve(self.listener, self.router)
            .with_graceful_shutdown(stop.said())
            .await
            .map_err(ServiceError::Stopped)
    }
}

/// The three addresses.
pub fn router(registry: Registry, readiness: Arc<dyn Readiness>) -> Router {
    Router::new()
        .route("/healthz", get(live))
        .route("/readyz", get(ready))
        .route("/metrics", get(metrics))
        .with_state(Shown {
            registry,
            readiness,
        })
}

/// The process answers. It asks nobody, so that a failing neighbour does not get this process restarted.
async fn live() -> Response {
    ([(header::CACHE_CONTROL, "no-store")], "ok\n").into_response()
}

async fn ready(State(shown): State<Shown>) -> Response {
    let report = Report::of(shown.readiness.parts().await);
    let status = if report.ready {
        StatusCode::OK
    } else {
        StatusCode::SERVICE_UNAVAILABLE
    };
    (status, [(header::CACHE_CONTROL, "no-store")], Json(report)).into_response()
}

async fn metrics(State(shown): State<Shown>) -> Response {
    let mut text = vec![];
    match TextEncoder::new().encode(&shown.registry.gather(), &mut text) {
        Ok(()) => {
            let kind = [(
                header::CONTENT_TYPE,
                TextEncoder::new().format_type().to_owned(),
            )];
            (kind, text).into_response()
        }
        Err(error) => {
            tracing::error!(%error, "metrics cannot be written");
            StatusCode::INTERNAL_SERVER_ERROR.into_response()
        }
    }
}

/// The registry of a service, with the process's own memory, processor time and open files.
pub fn registry(service: &'static str, version: &'static str) -> Result<Registry, ServiceError> {
    let registry = Registry::new();
    let process = prometheus::process_collector::ProcessCollector::for_self();
    registry.register(Box::new(process))?;
    let labels = prometheus::Opts::new("fluxglobe_build_info", "Which program this is.")
        .const_label("service", service)
        .const_label("version", version);
    let info = prometheus::IntGauge::with_opts(labels)?;
    info.set(1);
    registry.register(Box::new(info))?;
    Ok(registry)
}
