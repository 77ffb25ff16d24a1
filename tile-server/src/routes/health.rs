//! `/healthz` and `/readyz`: does the process live, and can it do its work now?

use std::time::Duration;

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use tokio::time::timeout;
use utoipa::ToSchema;

use crate::catalogue::Probe;
use crate::readiness::Said;
use crate::routes::viewer;
use crate::state::AppState;

/// A part that needs longer than this to say that it is there is as good as away.
const PART_LIMIT: Duration = Duration::from_secs(2);
/// The parts are asked no more often than this, however many want to know.
const READY_AGE: Duration = Duration::from_secs(1);

/// Can the server do its work, and which part of it cannot?
#[derive(Debug, Serialize, ToSchema)]
struct Readiness {
    /// Every part that is required is there.
    ready: bool,
    /// All parts.
    checks: Vec<Part>,
}

/// A part of the server.
#[derive(Debug, Serialize, ToSchema)]
struct Part {
    /// Its name.
    name: &'static str,
    /// It is there.
    ok: bool,
    /// Can the server not do without it?
    required: bool,
    /// One line for operators.
    detail: String,
}

/// The process answers. It asks nobody, so that a failing neighbour does not get this process restarted.
#[utoipa::path(
    get,
    path = "/healthz",
    operation_id = "health",
    tag = "operation",
    responses((status = 200, description = "`ok`", body = String)),
)]
pub(crate) async fn live() -> Response {
    ([(header::CACHE_CONTROL, "no-store")], "ok\n").into_response()
}

/// Every part, asked within the last second.
#[utoipa::path(
    get,
    path = "/readyz",
    operation_id = "readiness",
    tag = "operation",
    responses(
        (status = 200, description = "It can serve", body = Readiness),
        (status = 503, description = "A part that is required is away", body = Readiness),
    ),
)]
pub(crate) async fn ready(State(state): State<AppState>) -> Response {
    let age = if state.news.is_closed() {
        Duration::ZERO
    } else {
        Duration::from_millis(state.settings.catalogue_age_ms).min(READY_AGE)
    };
    let (status, body) = state.readiness.within(age, ask(&state)).await;
    let headers = [
        (header::CACHE_CONTROL, "no-store"),
        (header::CONTENT_TYPE, "application/json"),
    ];
    (status, headers, body).into_response()
}

async fn ask(state: &AppState) -> Said {
    let (store, renderer, log, observations) = tokio::join!(
        store(state),
        renderer(state),
        log(state),
        observations(state)
    );
    let mut checks = vec![store, renderer, viewer_files(state).await];
    checks.extend(log);
    checks.extend(ending(state));
    checks.extend(observations);
    let ready = checks.iter().all(|part| part.ok || !part.required);
    let status = if ready {
        StatusCode::OK
    } else {
        StatusCode::SERVICE_UNAVAILABLE
    };
    let said = serde_json::to_vec(&Readiness { ready, checks });
    (status, said.expect("it has string keys only").into())
}

/// A server that was asked to end, or lost a part, is no place to send anybody.
fn ending(state: &AppState) -> Option<Part> {
    state.news.is_closed().then(|| Part {
        name: "server",
        ok: false,
        required: true,
        detail: "it ends; the log says why".to_owned(),
    })
}

async fn store(state: &AppState) -> Part {
    let (ok, detail) = match timeout(PART_LIMIT, state.catalogue.probe()).await {
        Ok(Ok(Probe { products, lost: 0 })) => (true, format!("products: {products}")),
        Ok(Ok(Probe { products, lost })) => (
            false,
            format!("products: {products}, and {lost} that were there are gone"),
        ),
        Ok(Err(error)) => {
            // The error names folders and servers: the log may know them, whoever asks here need not.
            tracing::warn!(%error, "the store is not ready");
            (false, "it cannot be read; the log says why".to_owned())
        }
        Err(_elapsed) => (
            false,
            format!("no answer within {} s", PART_LIMIT.as_secs()),
        ),
    };
    Part {
        name: "store",
        ok,
        required: true,
        detail,
    }
}

/// Without it what is stored is still served, and so are budgets and the viewer; a picture that is not says 503 and when
/// to come back. It is not required, or the loss of the last render worker would take every server away.
async fn renderer(state: &AppState) -> Part {
    let (ok, detail) = match timeout(PART_LIMIT, state.drawer.ready()).await {
        Ok(Ok(())) => (true, "it draws".to_owned()),
        Ok(Err(error)) => (false, error.text),
        Err(_elapsed) => (
            false,
            format!("no answer within {} s", PART_LIMIT.as_secs()),
        ),
    };
    Part {
        name: "renderer",
        ok,
        required: false,
        detail,
    }
}

/// Without the event log tiles are still served, only later than they could be: it is not required.
async fn log(state: &AppState) -> Option<Part> {
    let log = state.log.get()?;
    let (ok, detail) = match timeout(PART_LIMIT, log.ready()).await {
        Ok(Ok(())) => (true, "it answers".to_owned()),
        Ok(Err(error)) => {
            tracing::warn!(%error, "the event log is not ready");
            (false, "it does not answer; the log says why".to_owned())
        }
        Err(_elapsed) => (
            false,
            format!("no answer within {} s", PART_LIMIT.as_secs()),
        ),
    };
    Some(Part {
        name: "event log",
        ok,
        required: false,
        detail,
    })
}

async fn observations(state: &AppState) -> Option<Part> {
    let observer = state.observer.get()?;
    let (ok, detail) = match timeout(PART_LIMIT, observer.ready()).await {
        Ok(Ok(())) => (true, "they are found".to_owned()),
        Ok(Err(error)) => (false, error.text),
        Err(_elapsed) => (
            false,
            format!("no answer within {} s", PART_LIMIT.as_secs()),
        ),
    };
    Some(Part {
        name: "observations",
        ok,
        required: false,
        detail,
    })
}

async fn viewer_files(state: &AppState) -> Part {
    let ok = viewer::is_built(&state.settings).await;
    let detail = if ok {
        "it is served at /"
    } else {
        "it has not been built; tiles and data are served"
    };
    Part {
        name: "viewer",
        ok,
        required: false,
        detail: detail.to_owned(),
    }
}
