//! The event log on Kafka: appends, reader groups and followers of `storage::log`, and what was refused sent again.
//!
//! - [`KafkaSettings`]: flags and variables; [`KafkaLog::connect`] checks them and the topics before any work.
//! - [`create_topics`]: makes the topics, each with its retention.
//! - [`rejected`]: lists refused messages of any log and sends them again.
//!
//! A reader finishes in one transaction: what follows from its messages and its offsets become visible together or not
//! at all. Readers see committed messages only. Left out on purpose: Kafka Connect, schema registries, Kerberos and OAuth.

mod append;
mod blocking;
mod cluster;
mod consumer_queue;
mod context;
mod error;
mod follower;
mod lag;
mod log;
mod look_up;
mod off_thread;
mod poll;
mod probe;
mod reader;
pub mod rejected;
mod secret;
mod settings;
mod slots;
mod topics;
mod transaction;
mod watch;

pub use error::KafkaFailure;
pub use log::KafkaLog;
pub use settings::{KafkaSettings, SaslMechanism, Security};
pub use topics::{TopicMade, create_topics};
