//! The services: each crate's parts put together over the store and the event log that settings name.
//!
//! Every service starts whatever else runs: it answers /healthz at once, says in /readyz what it still waits for, and
//! goes on when that is there.

mod context;
pub(crate) mod executor;
pub(crate) mod ingestd;
pub(crate) mod render_worker;
pub(crate) mod scheduler;
pub(crate) mod tile_server;

pub(crate) use context::ServiceContext;

use service::Readiness;

/// The first part of a service that does not work, or what the last one says.
async fn worst(readiness: &dyn Readiness) -> Result<String, String> {
    let parts = readiness.parts().await;
    match parts.iter().find(|part| part.required && !part.ok) {
        Some(part) => Err(format!("{}: {}", part.name, part.detail)),
        None => Ok(parts
            .last()
            .map_or_else(String::new, |part| part.detail.clone())),
    }
}
