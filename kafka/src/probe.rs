//! Asking brokers what is there: topics, their partitions, and where partitions begin and end.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use contract::topic::Topic;
use futures::StreamExt as _;
use rdkafka::ClientContext;
use rdkafka::client::Client;
use rdkafka::consumer::{BaseConsumer, Consumer as _, StreamConsumer};
use rdkafka::error::RDKafkaErrorCode;
use rdkafka::metadata::MetadataTopic;
use tokio::task::JoinHandle;

use crate::KafkaFailure;
use crate::blocking::blocking;
use crate::cluster::Cluster;
use crate::context::Context;
use crate::off_thread::OffThread;

/// How long brokers may take to answer whether they are there.
pub(crate) const READY_LIMIT: Duration = Duration::from_secs(2);
/// How long they may take for everything else that is asked.
pub(crate) const ASK_LIMIT: Duration = Duration::from_secs(10);

/// Longest that a question is waited for before troubles are looked at.
const TURN: Duration = Duration::from_secs(1);
/// Pause before something is asked for again.
const AGAIN_PAUSE: Duration = Duration::from_millis(50);

/// How a topic is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Found {
    Missing,
    /// With so many partitions, each with a leader.
    Partitions(u32),
    /// Some partition has no leader now.
    Leaderless,
}

/// Asks by one client for as long as it gets answers. Consumers never make topics by asking for them, as producers may.
pub(crate) struct Probe {
    cluster: Cluster,
    asking: Mutex<Arc<Asking>>,
}

/// A client that only asks.
struct Asking {
    client: OffThread<StreamConsumer<Context>>,
    context: Context,
    /// Takes the client's own messages off its queue, which would grow for ever.
    drain: JoinHandle<()>,
}

impl Asking {
    fn open(cluster: &Cluster) -> Result<Arc<Self>, KafkaFailure> {
        let context = Context::default();
        let client: StreamConsumer<Context> = cluster
            .asking()
            .create_with_context(context.clone())
            .map_err(|e| context.failure("opening a client", e))?;
        let client = OffThread::new(client);
        let drained = client.clone();
        let drain = tokio::spawn(async move {
            // Nothing is assigned to it: what comes are troubles, which the context has noted.
            drained
                .stream()
                .for_each(|_trouble| std::future::ready(()))
                .await;
        });
        Ok(Arc::new(Self {
            client,
            context,
            drain,
        }))
    }
}

impl Probe {
    pub(crate) fn open(cluster: &Cluster) -> Result<Self, KafkaFailure> {
        Ok(Self {
            asking: Mutex::new(Asking::open(cluster)?),
            cluster: cluster.clone(),
        })
    }

    /// Asks; a client without an answer may have nobody left to ask, and is asked no more.
    async fn ask<T: Send + 'static>(
        &self,
        step: &'static str,
        question: impl FnOnce(&Asking) -> Result<T, KafkaFailure> + Send + 'static,
    ) -> Result<T, KafkaFailure> {
        let asking = Arc::clone(&self.asking());
        let of_call = Arc::clone(&asking);
        let answer = blocking(step, move || question(&of_call)).await;
        if answer.as_ref().is_err_and(KafkaFailure::is_out_of_time) {
            let mut current = self.asking();
            if Arc::ptr_eq(&current, &asking) {
                *current = Asking::open(&self.cluster)?;
            }
        }
        answer
    }

    fn asking(&self) -> MutexGuard<'_, Arc<Asking>> {
        // Replaced whole: a panic elsewhere cannot leave it half done.
        self.asking.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How topics are there.
    pub(crate) async fn topics(
        &self,
        topics: &'static [Topic],
        limit: Duration,
    ) -> Result<Vec<(Topic, Found)>, KafkaFailure> {
        let cluster = self.cluster.clone();
        self.ask(
            "looking for topics",
            move |Asking {
                      client, context, ..
                  }| {
                let until = Instant::now() + limit;
                let found = |&topic: &Topic| {
                    let left = until.saturating_duration_since(Instant::now());
                    find(client.client(), context, &cluster.topic(topic), left)
                        .map(|found| (topic, found))
                };
                topics.iter().map(found).collect()
            },
        )
        .await
    }

    /// Where the messages of each partition begin and end; the end of what can be read, open transactions left out.
    pub(crate) async fn bounds(&self, topic: Topic) -> Result<Vec<(u64, u64)>, KafkaFailure> {
        const STEP: &str = "looking for the ends of a topic";
        let name = self.cluster.topic(topic);
        let partitions = self.cluster.partitions();
        self.ask(
            STEP,
            move |Asking {
                      client, context, ..
                  }| {
                let until = Instant::now() + ASK_LIMIT;
                let bounds = |partition| bounds(client.client(), context, &name, partition, until);
                (0..partitions).map(bounds).collect()
            },
        )
        .await
    }
}

/// Where each partition ends, open transactions and all.
pub(crate) async fn ends(cluster: &Cluster, topic: Topic) -> Result<Vec<u64>, KafkaFailure> {
    const STEP: &str = "looking for the ends of a topic";
    let mut config = cluster.asking();
    config.set("isolation.level", "read_uncommitted");
    let (name, partitions) = (cluster.topic(topic), cluster.partitions());
    blocking(STEP, move || {
        let context = Context::default();
        let client: BaseConsumer<Context> = config
            .create_with_context(context.clone())
            .map_err(|e| context.failure(STEP, e))?;
        let until = Instant::now() + ASK_LIMIT;
        let end = |partition| bounds(client.client(), &context, &name, partition, until);
        (0..partitions)
            .map(|partition| Ok(end(partition)?.1))
            .collect()
    })
    .await
}

impl Drop for Asking {
    fn drop(&mut self) {
        self.drain.abort();
    }
}

/// Where one partition begins and ends.
pub(crate) fn bounds<C: ClientContext>(
    client: &Client<C>,
    context: &Context,
    topic: &str,
    partition: u32,
    until: Instant,
) -> Result<(u64, u64), KafkaFailure> {
    loop {
        let left = until.saturating_duration_since(Instant::now());
        match client.fetch_watermarks(topic, partition as i32, left) {
            Ok((low, high)) => return Ok((low.max(0) as u64, high.max(0) as u64)),
            Err(error) => {
                let failure = context.failure("looking for the ends of a topic", error);
                // A broker that was just made leader of a partition may not know it yet.
                if left <= AGAIN_PAUSE || !failure.is_retryable() {
                    return Err(failure);
                }
                std::thread::sleep(AGAIN_PAUSE);
            }
        }
    }
}

fn find<C: ClientContext>(
    client: &Client<C>,
    context: &Context,
    topic: &str,
    limit: Duration,
) -> Result<Found, KafkaFailure> {
    const STEP: &str = "looking for topics";
    let until = Instant::now() + limit;
    let answer = loop {
        // Asked in short turns: a refused login shows while the client still hopes for a connection.
        let left = until.saturating_duration_since(Instant::now());
        match client.fetch_metadata(Some(topic), left.min(TURN)) {
            Ok(answer) => break answer,
            Err(error) => {
                let failure = context.failure(STEP, error);
                if left <= TURN || !failure.is_retryable() {
                    return Err(failure);
                }
                std::thread::sleep(AGAIN_PAUSE);
            }
        }
    };
    context.well();
    let Some(about) = answer.topics().iter().find(|about| about.name() == topic) else {
        return Ok(Found::Missing);
    };
    about_topic(about)
        .map_err(|code| context.failure(STEP, rdkafka::error::KafkaError::MetadataFetch(code)))
}

fn about_topic(about: &MetadataTopic) -> Result<Found, RDKafkaErrorCode> {
    match about.error().map(RDKafkaErrorCode::from) {
        None => {}
        Some(RDKafkaErrorCode::UnknownTopicOrPartition) => return Ok(Found::Missing),
        Some(RDKafkaErrorCode::LeaderNotAvailable) => return Ok(Found::Leaderless),
        Some(code) => return Err(code),
    }
    let partitions = about.partitions();
    let is_led = partitions.iter().all(|partition| partition.leader() >= 0);
    Ok(if is_led {
        Found::Partitions(partitions.len() as u32)
    } else {
        Found::Leaderless
    })
}

/// Do brokers answer? Then the client is taken to be well again.
pub(crate) fn are_brokers_there<C: ClientContext>(
    client: &Client<C>,
    context: &Context,
    topic: &str,
) -> Result<(), KafkaFailure> {
    client
        .fetch_metadata(Some(topic), READY_LIMIT)
        .map_err(|e| context.failure("looking for brokers", e))?;
    context.well();
    Ok(())
}
