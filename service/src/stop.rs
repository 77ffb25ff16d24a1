//! An orderly end: one word that every part of a process hears.

use std::future::Future;

use tokio_util::sync::CancellationToken;

use crate::ServiceError;

/// Heard by all who hold a clone.
#[derive(Debug, Clone, Default)]
pub struct Stop(CancellationToken);

impl Stop {
    /// A word not yet said.
    pub fn new() -> Self {
        Self::default()
    }

    /// Says it.
    pub fn now(&self) {
        self.0.cancel();
    }

    /// Has it been said?
    pub fn is_said(&self) -> bool {
        self.0.is_cancelled()
    }

    /// Waits for it.
    pub fn said(&self) -> impl Future<Output = ()> + Send + 'static {
        self.0.clone().cancelled_owned()
    }
}

/// Says stop at the first termination signal or Ctrl-C.
pub fn when_asked_to_stop() -> Result<Stop, ServiceError> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate()).map_err(ServiceError::Signals)?;
    let mut interrupt = signal(SignalKind::interrupt()).map_err(ServiceError::Signals)?;
    let stop = Stop::new();
    let said = stop.clone();
    tokio::spawn(async move {
        tokio::select! {
            _terminated = terminate.recv() => {}
            _interrupted = interrupt.recv() => {}
        }
        tracing::info!("asked to stop");
        said.now();
    });
    Ok(stop)
}
