//! One message by its place.

use std::time::{Duration, Instant};

use contract::topic::Origin;
use rdkafka::consumer::{BaseConsumer, Consumer as _};
use rdkafka::error::{KafkaError, RDKafkaErrorCode};
use rdkafka::{Offset, TopicPartitionList};
use storage::log::Message;

use crate::KafkaFailure;
use crate::cluster::Cluster;
use crate::context::Context;
use crate::follower::LOOKERS;
use crate::poll::of_topic;
use crate::probe::ASK_LIMIT;

const STEP: &str = "reading a message";
const POLL: Duration = Duration::from_millis(200);

/// Reads it; none if it is not there any more, or was never committed.
pub(crate) fn look_up(cluster: &Cluster, origin: Origin) -> Result<Option<Message>, KafkaFailure> {
    let (Ok(partition), Ok(offset)) = (
        i32::try_from(origin.partition),
        i64::try_from(origin.offset),
    ) else {
        return Ok(None);
    };
    if origin.partition >= cluster.partitions() {
        return Ok(None);
    }
    let context = Context::default();
    let mut config = cluster.reading(LOOKERS);
    config
        .set("enable.partition.eof", "true")
        .set("auto.offset.reset", "error")
        .set("queued.min.messages", "1");
    let failed = |error: KafkaError| context.failure(STEP, error);
    let consumer: BaseConsumer<Context> = config
        .create_with_context(context.clone())
        .map_err(failed)?;
    let mut list = TopicPartitionList::new();
    list.add_partition_offset(
        &cluster.topic(origin.topic),
        partition,
        Offset::Offset(offset),
    )
    .map_err(failed)?;
    consumer.assign(&list).map_err(failed)?;
    let until = Instant::now() + ASK_LIMIT;
    while Instant::now() < until {
        match consumer.poll(POLL) {
            None => {}
            Some(Ok(message)) => {
                let message = of_topic(origin.topic, &message);
                return Ok(Some(message).filter(|message| message.origin == origin));
            }
            Some(Err(error)) if is_not_there(&error) => return Ok(None),
            Some(Err(error)) => tracing::debug!(%error, %origin, "fetching is disturbed"),
        }
    }
    Err(context.slow(STEP, ASK_LIMIT))
}

fn is_not_there(error: &KafkaError) -> bool {
    matches!(error, KafkaError::PartitionEOF(_))
        || matches!(
            error.rdkafka_error_code(),
            Some(RDKafkaErrorCode::AutoOffsetReset | RDKafkaErrorCode::OffsetOutOfRange)
        )
}
