//! The event log: messages by topic, groups of readers that share them, and how far each group has come.
//!
//! A reader finishes a message together with what follows from it: the events that follow are appended and the offset
//! moves in one step, or neither happens. So a notice has its events once, however often its reader is killed.

mod embedded;
mod journal;
mod low_water;

use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use contract::ContractError;
use contract::event::Event;
use contract::time::TimeMs;
use contract::topic::{Origin, Topic};

use crate::StorageError;

pub use embedded::EmbeddedLog;
pub use low_water::{LowWater, Ready};

/// A message as it lies in the log: anybody may have written it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Where.
    pub origin: Origin,
    /// What, as it came.
    pub content: Bytes,
    /// When it came into the log, however often it is read; none in logs that did not keep it.
    pub time: Option<TimeMs>,
}

impl Message {
    /// The event in it.
    ///
    /// # Errors
    /// Not UTF-8, or no event of this version.
    pub fn event(&self) -> Result<Event, ContractError> {
        let text = std::str::from_utf8(&self.content).map_err(|e| {
            ContractError::invalid("message", &self.origin.to_string(), e.to_string())
        })?;
        Event::from_json(text)
    }
}

/// A message that is dealt with.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// The message.
    pub origin: Origin,
    /// What follows from it.
    pub follows: Vec<Event>,
}

/// Where to begin without a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// The oldest message that is kept.
    Oldest,
    /// What is appended from now on.
    Now,
}

/// A log of messages by topic.
#[async_trait]
pub trait EventLog: Send + Sync {
    /// Appends events, all or none; they are durable when this returns.
    async fn append(&self, events: &[Event]) -> Result<(), StorageError>;

    /// Appends a message as it is, for notices of other systems and for sending a refused message again.
    async fn append_message(
        &self,
        topic: Topic,
        key: &str,
        content: Bytes,
    ) -> Result<(), StorageError>;

    /// Joins a group that shares the messages of a topic; a new group begins with the oldest.
    async fn join(&self, topic: Topic, group: &str) -> Result<Box<dyn Reader>, StorageError>;

    /// Follows all messages of a topic alone, without leaving a trace of it.
    async fn follow(&self, topic: Topic, start: Start) -> Result<Box<dyn Follower>, StorageError>;

    /// How long a follower of all messages waits for more before it has had those that were there: not at all where what is appended
    /// can be read at once.
    fn end_wait(&self) -> Duration {
        END_WAIT
    }

    /// One message, none if it is not there (any more).
    async fn message(&self, origin: Origin) -> Result<Option<Message>, StorageError>;

    /// How many messages of a topic a group has still before it.
    async fn lag(&self, topic: Topic, group: &str) -> Result<u64, StorageError>;

    /// Can messages be appended and read now?
    async fn ready(&self) -> Result<(), StorageError>;
}

/// One member of a group. After an error, whatever was not finished is delivered again, perhaps to another member.
#[async_trait]
pub trait Reader: Send {
    /// At most `max` messages, in order within a partition; none after `wait` without any.
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError>;

    /// Finishes messages, in any order. The offset of a partition moves past a message once all before it are finished
    /// too; what follows from a message is appended in the same step.
    async fn finish(&mut self, done: Vec<Finished>) -> Result<(), StorageError>;

    /// Messages that were handed out, are not finished and belong to another member now, since this was asked last:
    /// whatever is done about them is done by that one too.
    fn lost(&mut self) -> Vec<Origin> {
        vec![]
    }

    /// Hands back what was not finished at once, so that nobody waits for this member.
    async fn leave(self: Box<Self>) -> Result<(), StorageError>;
}

/// Somebody who only looks.
#[async_trait]
pub trait Follower: Send {
    /// At most `max` messages; none after `wait` without any.
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError>;
}

/// Most messages that [`contents`] reads at once.
const MESSAGES_AT_ONCE: usize = 256;
/// A follower from the oldest message that brings nothing for so long is at the end, in a log that others hold.
const END_WAIT: Duration = Duration::from_millis(500);

/// All messages of a topic that are there now.
pub async fn contents(log: &dyn EventLog, topic: Topic) -> Result<Vec<Message>, StorageError> {
    let mut follower = log.follow(topic, Start::Oldest).await?;
    let mut all = vec![];
    loop {
        let some = follower.next(MESSAGES_AT_ONCE, log.end_wait()).await?;
        if some.is_empty() {
            return Ok(all);
        }
        all.extend(some);
    }
}

/// Appends an event unless the log holds one with the same body: for those who are no readers, and who may have been
/// killed between what they did and telling of it.
pub async fn tell_once(log: &dyn EventLog, event: &Event) -> Result<(), StorageError> {
    tell_each_once(log, std::slice::from_ref(event)).await
}

/// The same for several events of one topic, which is read once.
pub async fn tell_each_once(log: &dyn EventLog, events: &[Event]) -> Result<(), StorageError> {
    let Some(first) = events.first() else {
        return Ok(());
    };
    let messages = contents(log, first.body.topic()).await?;
    let told: Vec<Event> = messages.iter().filter_map(|m| m.event().ok()).collect();
    let is_untold = |event: &&Event| !told.iter().any(|told| told.body == event.body);
    let untold: Vec<Event> = events.iter().filter(is_untold).cloned().collect();
    if untold.is_empty() {
        return Ok(());
    }
    log.append(&untold).await
}
