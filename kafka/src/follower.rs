//! Somebody who only looks at a topic: all its partitions, no offsets kept.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use async_trait::async_trait;
use contract::topic::{Origin, Topic};
use rdkafka::consumer::{Consumer as _, StreamConsumer};
use rdkafka::error::{KafkaError, KafkaResult};
use rdkafka::{Offset, TopicPartitionList};
use storage::StorageError;
use storage::log::{Follower, Message, Start};
use tokio::time::Instant;

use crate::KafkaFailure;
use crate::blocking::blocking;
use crate::cluster::Cluster;
use crate::context::Context;
use crate::off_thread::OffThread;
use crate::poll::of_topic;
use crate::probe::{Probe, are_brokers_there, ends};
use crate::watch::Watch;

/// The name that clients go by which are no members of any group; nothing is kept under it.
pub(crate) const LOOKERS: &str = "lookers";
/// How long messages may take that are known to be there.
const CATCH_UP_LIMIT: Duration = Duration::from_secs(15);

/// How long transactions may stay open: their own limit, and how seldom Kafka looks for those beyond it.
const SETTLE_LIMIT: Duration = Duration::from_secs(25);
const SETTLE_PAUSE: Duration = Duration::from_millis(20);

/// Reads on where it was after a failure that passes.
pub(crate) struct KafkaFollower {
    cluster: Cluster,
    topic: Topic,
    consumer: OffThread<StreamConsumer<Context>>,
    context: Context,
    watch: Watch,
    /// The offset that is read next in each partition.
    next: BTreeMap<i32, i64>,
    /// Partitions whose end, as of the beginning, is not reached: until then "nothing came" means "not yet".
    behind: BTreeSet<i32>,
}

impl KafkaFollower {
    pub(crate) async fn follow(
        cluster: &Cluster,
        probe: &Probe,
        topic: Topic,
        start: Start,
    ) -> Result<Self, KafkaFailure> {
        // Asked for now and not when fetching begins: what is appended after this call is seen. So is what is in an open
        // transaction; one that was committed a moment ago may still count as open.
        let bounds = match start {
            Start::Now => probe.bounds(topic).await?,
            Start::Oldest => settled_bounds(cluster, probe, topic).await?,
        };
        let mut next = BTreeMap::new();
        let mut behind = BTreeSet::new();
        for (partition, (first, end)) in (0..).zip(bounds) {
            let from = match start {
                Start::Oldest => first,
                Start::Now => end,
            };
            if from < end {
                behind.insert(partition);
            }
            next.insert(partition, from as i64);
        }
        let (consumer, context) = open(cluster, topic, &next)?;
        Ok(Self {
            cluster: cluster.clone(),
            topic,
            watch: Watch::start(&consumer, cluster.topic(topic)),
            consumer,
            context,
            next,
            behind,
        })
    }

    /// Reads on with another client.
    fn replace(&mut self) -> Result<(), KafkaFailure> {
        (self.consumer, self.context) = open(&self.cluster, self.topic, &self.next)?;
        self.watch = Watch::start(&self.consumer, self.cluster.topic(self.topic));
        Ok(())
    }

    async fn collect(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, KafkaFailure> {
        if self.watch.is_lost() {
            self.replace()?;
        }
        let now = Instant::now();
        let mut found = vec![];
        while found.len() < max {
            let until = if !found.is_empty() {
                now
            } else if self.behind.is_empty() {
                now + wait
            } else {
                now + wait.max(CATCH_UP_LIMIT)
            };
            match tokio::time::timeout_at(until, self.receive()).await {
                Ok(received) => found.extend(self.sort(received)?),
                Err(_elapsed) => break,
            }
        }
        if found.is_empty() && max > 0 {
            self.check_brokers().await?;
            if !self.behind.is_empty() {
                return Err(self.context.slow("reading a topic", CATCH_UP_LIMIT));
            }
        }
        Ok(found)
    }

    async fn receive(&self) -> KafkaResult<Message> {
        let received = self.consumer.recv().await;
        received.map(|message| of_topic(self.topic, &message))
    }

    fn sort(&mut self, received: KafkaResult<Message>) -> Result<Option<Message>, KafkaFailure> {
        match received {
            Ok(message) => {
                let Origin {
                    partition, offset, ..
                } = message.origin;
                self.next.insert(partition as i32, offset as i64 + 1);
                Ok(Some(message))
            }
            Err(KafkaError::PartitionEOF(partition)) => {
                self.behind.remove(&partition);
                Ok(None)
            }
            Err(error @ KafkaError::MessageConsumptionFatal(_)) => {
                Err(self.context.failure("reading a topic", error))
            }
            // The client mends these by itself, or cannot; brokers are asked when nothing comes.
            Err(error) => {
                tracing::debug!(%error, topic = %self.topic, "fetching is disturbed");
                Ok(None)
            }
        }
    }

    async fn check_brokers(&self) -> Result<(), KafkaFailure> {
        if !self.context.is_troubled() {
            return Ok(());
        }
        let (consumer, context) = (self.consumer.clone(), self.context.clone());
        let topic = self.cluster.topic(self.topic);
        blocking("looking for brokers", move || {
            are_brokers_there(consumer.client(), &context, &topic)
        })
        .await
    }
}

/// A client that reads on from some offsets.
fn open(
    cluster: &Cluster,
    topic: Topic,
    next: &BTreeMap<i32, i64>,
) -> Result<(OffThread<StreamConsumer<Context>>, Context), KafkaFailure> {
    const STEP: &str = "following a topic";
    let name = cluster.topic(topic);
    let context = Context::default();
    let failed = |error: KafkaError| context.failure(STEP, error);
    let mut list = TopicPartitionList::with_capacity(next.len());
    for (&partition, &offset) in next {
        list.add_partition_offset(&name, partition, Offset::Offset(offset))
            .map_err(failed)?;
    }
    let mut config = cluster.reading(LOOKERS);
    config.set("enable.partition.eof", "true");
    let consumer: StreamConsumer<Context> = config
        .create_with_context(context.clone())
        .map_err(failed)?;
    consumer.assign(&list).map_err(failed)?;
    Ok((OffThread::new(consumer), context))
}

/// Where partitions begin and end, once every transaction that is open now has ended: whoever wants all that is there must
/// not miss what was committed a moment ago, or lies behind what a killed process left open.
async fn settled_bounds(
    cluster: &Cluster,
    probe: &Probe,
    topic: Topic,
) -> Result<Vec<(u64, u64)>, KafkaFailure> {
    let ends = ends(cluster, topic).await?;
    let until = Instant::now() + SETTLE_LIMIT;
    loop {
        let bounds = probe.bounds(topic).await?;
        if bounds.iter().zip(&ends).all(|((_, seen), end)| seen >= end) {
            return Ok(bounds);
        }
        if Instant::now() >= until {
            return Err(Context::default().slow("waiting for open transactions", SETTLE_LIMIT));
        }
        tokio::time::sleep(SETTLE_PAUSE).await;
    }
}

#[async_trait]
impl Follower for KafkaFollower {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        self.collect(max, wait)
            .await
            .map_err(|failure| failure.of_log(self.cluster.servers()))
    }
}
