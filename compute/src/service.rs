//! The cluster's compute half as services: Ballista's scheduler, its executors, and the deriver that keeps derived
//! products up with what lands.
//!
//! All of them hold their state in memory: whatever one of them loses when it is killed is asked or computed again, and
//! what is stored is named by its content, so that doing it twice changes nothing.

mod background;
mod dealing;
pub mod deriver;
pub mod executor;
mod executor_metrics;
mod executor_settings;
mod heartbeat;
mod janitor;
mod named_sums;
mod retry_channel;
mod room;
pub mod scheduler;
mod scheduler_metrics;
mod scheduler_watch;
mod work;

pub use deriver::Deriver;
pub use executor::Executor;
pub use executor_settings::ExecutorSettings;
pub use scheduler::{Scheduler, SchedulerSettings};
