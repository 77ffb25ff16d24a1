//! How many messages a group has still before it.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use contract::topic::Topic;
use rdkafka::consumer::{BaseConsumer, Consumer as _};
use rdkafka::error::KafkaError;
use rdkafka::{Message as _, Offset, TopicPartitionList};

use crate::KafkaFailure;
use crate::cluster::Cluster;
use crate::context::Context;
use crate::probe::{ASK_LIMIT, bounds};

const STEP: &str = "looking how far a group is";
/// Up to so many places, messages are counted one by one: some places of a log hold no message but the end of a
/// transaction, and a group that read everything must be seen to have no message before it.
const COUNTED_PLACES: u64 = 256;
const POLL: Duration = Duration::from_millis(200);

/// Exact up to [`COUNTED_PLACES`] places, beyond that an upper bound.
pub(crate) fn lag(cluster: &Cluster, topic: Topic, group: &str) -> Result<u64, KafkaFailure> {
    let until = Instant::now() + ASK_LIMIT;
    let context = Context::default();
    let failed = |error: KafkaError| context.failure(STEP, error);
    let mut config = cluster.reading(&cluster.group(topic, group));
    config.set("enable.partition.eof", "true");
    let consumer: BaseConsumer<Context> = config
        .create_with_context(context.clone())
        .map_err(failed)?;
    let name = cluster.topic(topic);
    let mut list = TopicPartitionList::new();
    list.add_partition_range(&name, 0, cluster.partitions() as i32 - 1);
    let committed = consumer
        .committed_offsets(list, ASK_LIMIT)
        .map_err(failed)?;
    // Where to count from and to, by partition.
    let mut ahead = BTreeMap::new();
    for element in committed.elements() {
        element.error().map_err(failed)?;
        let partition = element.partition();
        let (first, end) = bounds(consumer.client(), &context, &name, partition as u32, until)?;
        let next = match element.offset() {
            Offset::Offset(next) => (next as u64).max(first),
            _none => first,
        };
        if next < end {
            ahead.insert(partition, (next, end));
        }
    }
    let places: u64 = ahead.values().map(|(next, end)| end - next).sum();
    if places == 0 || places > COUNTED_PLACES {
        return Ok(places);
    }
    count(&consumer, &context, &name, ahead, until)
}

fn count(
    consumer: &BaseConsumer<Context>,
    context: &Context,
    topic: &str,
    mut ahead: BTreeMap<i32, (u64, u64)>,
    until: Instant,
) -> Result<u64, KafkaFailure> {
    let failed = |error: KafkaError| context.failure(STEP, error);
    let mut list = TopicPartitionList::new();
    for (&partition, &(next, _)) in &ahead {
        list.add_partition_offset(topic, partition, Offset::Offset(next as i64))
            .map_err(failed)?;
    }
    consumer.assign(&list).map_err(failed)?;
    let mut messages = 0;
    while !ahead.is_empty() {
        if Instant::now() >= until {
            return Err(context.slow(STEP, ASK_LIMIT));
        }
        match consumer.poll(POLL) {
            None => {}
            Some(Ok(message)) => {
                if let Some(&(_, end)) = ahead.get(&message.partition()) {
                    let offset = message.offset() as u64;
                    messages += u64::from(offset < end);
                    if offset + 1 >= end {
                        ahead.remove(&message.partition());
                    }
                }
            }
            Some(Err(KafkaError::PartitionEOF(partition))) => {
                ahead.remove(&partition);
            }
            Some(Err(error)) => tracing::debug!(%error, topic, "fetching is disturbed"),
        }
    }
    Ok(messages)
}
