//! The event log: events in, numbered events out, and how far each group of readers has come.

mod embedded;

use async_trait::async_trait;
use contract::event::Event;

use crate::StorageError;

pub use embedded::EmbeddedLog;

/// An append-only log of events by topic. An event is durable when `append` returns.
#[async_trait]
pub trait EventLog: Send + Sync {
    /// Appends an event to its topic; its offset, counted from 0.
    async fn append(&self, event: &Event) -> Result<u64, StorageError>;

    /// At most `max` events from an offset on, with their offsets.
    async fn read(
        &self,
        topic: &str,
        from: u64,
        max: usize,
    ) -> Result<Vec<(u64, Event)>, StorageError>;

    /// The offset a group of readers goes on from.
    async fn committed(&self, topic: &str, group: &str) -> Result<u64, StorageError>;

    /// Stores the offset a group goes on from; it never goes back.
    async fn commit(&self, topic: &str, group: &str, next: u64) -> Result<(), StorageError>;
}
