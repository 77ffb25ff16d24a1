//! What every service has: request metrics, health and metrics over HTTP, log lines, an orderly end.
//!
//! Left out on purpose: what a service does. Nothing here knows of grids, pictures or topics.

pub mod admin;
mod board;
mod error;
mod listen;
mod logging;
mod parts;
mod readiness;
mod red;
mod stop;
mod wait;

pub use board::Board;
pub use error::ServiceError;
pub use listen::socket_address;
pub use logging::{LogFormat, USUAL_FILTER, start_logging};
pub use parts::{PartEnded, Parts};
pub use readiness::{Part, Readiness, Report};
pub use red::{Outcome, Red, Running};
pub use stop::{Stop, when_asked_to_stop};
pub use wait::until_there;

/// Registry that a service's metrics go to.
pub use prometheus::Registry;
