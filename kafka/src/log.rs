//! The event log on Kafka.

use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use contract::event::Event;
use contract::topic::{Origin, Topic};
use storage::StorageError;
use storage::log::{EventLog, Follower, Message, Reader, Start};

use crate::append::{Appender, message, record};
use crate::blocking::blocking;
use crate::cluster::Cluster;
use crate::follower::KafkaFollower;
use crate::lag::lag;
use crate::look_up::look_up;
use crate::probe::{Found, Probe, READY_LIMIT};
use crate::reader::KafkaReader;
use crate::slots::Slots;
use crate::{KafkaFailure, KafkaSettings, topics};

/// A connection to the topics of one installation; clones share it.
///
/// Every call ends in bounded time. While no broker answers, calls end in errors that may pass (`is_retryable`), and
/// nothing is kept for later. A reader's error is the end of that reader; a follower reads on where it was.
#[derive(Clone)]
pub struct KafkaLog {
    shared: Arc<Shared>,
}

struct Shared {
    cluster: Cluster,
    probe: Probe,
    appender: Appender,
    slots: Slots,
}

impl KafkaLog {
    /// Checks settings, secrets, brokers and topics.
    ///
    /// # Errors
    /// `LogSetup` for what somebody must put right: a missing secret file, a refused login, a topic that is missing or
    /// has another partition count. An error that may pass when no broker answers within 10 s.
    pub async fn connect(settings: &KafkaSettings) -> Result<Self, StorageError> {
        let servers = settings.kafka.clone().unwrap_or_default();
        Self::open(settings)
            .await
            .map_err(|failure| failure.of_log(&servers))
    }

    async fn open(settings: &KafkaSettings) -> Result<Self, KafkaFailure> {
        let cluster = Cluster::open(settings)?;
        let probe = Probe::open(&cluster)?;
        topics::check(&cluster, &probe).await?;
        let appender = Appender::open(&cluster)?;
        Ok(Self {
            shared: Arc::new(Shared {
                cluster,
                probe,
                appender,
                slots: Slots::default(),
            }),
        })
    }

    /// Name of a group in Kafka, for those who watch its lag from outside.
    pub fn group_name(&self, topic: Topic, group: &str) -> String {
        self.shared.cluster.group(topic, group)
    }

    fn told(&self, failure: KafkaFailure) -> StorageError {
        failure.of_log(self.shared.cluster.servers())
    }
}

#[async_trait]
impl EventLog for KafkaLog {
    async fn append(&self, events: &[Event]) -> Result<(), StorageError> {
        let records = events
            .iter()
            .map(|event| record(&self.shared.cluster, event))
            .collect::<Result<Vec<_>, _>>()?;
        let appended = self.shared.appender.append(records).await;
        appended.map_err(|failure| self.told(failure))
    }

    async fn append_message(
        &self,
        topic: Topic,
        key: &str,
        content: Bytes,
    ) -> Result<(), StorageError> {
        let record = message(&self.shared.cluster, topic, key, content)?;
        let appended = self.shared.appender.append(vec![record]).await;
        appended.map_err(|failure| self.told(failure))
    }

    async fn join(&self, topic: Topic, group: &str) -> Result<Box<dyn Reader>, StorageError> {
        let shared = &self.shared;
        let reader = KafkaReader::join(&shared.cluster, &shared.slots, topic, group).await;
        Ok(Box::new(reader.map_err(|failure| self.told(failure))?))
    }

    async fn follow(&self, topic: Topic, start: Start) -> Result<Box<dyn Follower>, StorageError> {
        let shared = &self.shared;
        let follower = KafkaFollower::follow(&shared.cluster, &shared.probe, topic, start).await;
        Ok(Box::new(follower.map_err(|failure| self.told(failure))?))
    }

    async fn message(&self, origin: Origin) -> Result<Option<Message>, StorageError> {
        let cluster = self.shared.cluster.clone();
        let found = blocking("reading a message", move || look_up(&cluster, origin)).await;
        found.map_err(|failure| self.told(failure))
    }

    async fn lag(&self, topic: Topic, group: &str) -> Result<u64, StorageError> {
        let (cluster, group) = (self.shared.cluster.clone(), group.to_owned());
        let counted = blocking("looking how far a group is", move || {
            lag(&cluster, topic, &group)
        });
        counted.await.map_err(|failure| self.told(failure))
    }

    async fn ready(&self) -> Result<(), StorageError> {
        let found = self.shared.probe.topics(&Topic::ALL, READY_LIMIT).await;
        for (topic, found) in found.map_err(|failure| self.told(failure))? {
            let reason = match found {
                Found::Partitions(_) => continue,
                Found::Missing => "is missing",
                Found::Leaderless => "has a partition without a leader",
            };
            let name = self.shared.cluster.topic(topic);
            return Err(StorageError::log(
                self.shared.cluster.servers(),
                format!("topic {name} {reason}"),
            ));
        }
        Ok(())
    }
}
