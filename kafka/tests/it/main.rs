//! The event log as its users see it: one suite for the embedded log and for Kafka, then what only Kafka can do wrong.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]
#![expect(
    clippy::print_stdout,
    reason = "figures and seeds are part of the result"
)]

mod broker;
mod embedded;
mod events;
mod faults;
mod forgotten;
mod kafka;
mod kills;
mod own_topics;
mod rejected;
mod security;
mod setup;
mod speed;
mod suite;
