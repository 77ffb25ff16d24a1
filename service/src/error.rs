//! What can go wrong before a service runs.

use std::net::SocketAddr;

/// A service that could not be started or told about.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// Two metrics of one name.
    #[error("a metric cannot be registered")]
    Metrics(#[from] prometheus::Error),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}; is another process there? Give another address")]
    Listen {
        address: SocketAddr,
        source: std::io::Error,
    },
    /// The admin server ended by itself.
    #[error("the health and metrics server stopped")]
    Stopped(#[source] std::io::Error),
    /// The filter of log lines does not parse.
    #[error("log filter {filter:?} is not valid: {reason}")]
    LogFilter { filter: String, reason: String },
    /// Signals cannot be waited for.
    #[error("cannot listen for signals")]
    Signals(#[source] std::io::Error),
}
