//! The task that fetches for a reader: it goes on whatever the reader does, so that the group knows the member is alive.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use contract::event::MAX_EVENT_BYTES;
use contract::time::TimeMs;
use contract::topic::{Origin, Topic};
use futures::StreamExt as _;
use rdkafka::Message as _;
use rdkafka::consumer::{Consumer as _, StreamConsumer};
use rdkafka::error::{KafkaError, KafkaResult};
use rdkafka::message::BorrowedMessage;
use storage::log::Message;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::consumer_queue::{ConsumerQueue, Member};
use crate::off_thread::OffThread;

/// A reader that takes nothing out for so long pauses the fetching. Shares and troubles wait for it.
const PAUSE_AFTER: Duration = Duration::from_millis(500);

/// A running task; it ends when this is dropped.
pub(crate) struct Polling {
    stop: Option<oneshot::Sender<()>>,
    task: JoinHandle<()>,
}

impl Polling {
    pub(crate) fn start(
        consumer: OffThread<StreamConsumer<Member>>,
        queue: Arc<ConsumerQueue>,
    ) -> Self {
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(async move {
            if let Err(error) = poll(&consumer, &queue, stopped).await {
                queue.fail(error);
            }
        });
        Self {
            stop: Some(stop),
            task,
        }
    }

    /// Ends it and waits until it holds nothing any more.
    pub(crate) async fn end(mut self) {
        self.stop.take();
        if let Err(error) = self.task.await {
            tracing::warn!(%error, "the task that fetches ended badly");
        }
    }
}

async fn poll(
    consumer: &StreamConsumer<Member>,
    queue: &ConsumerQueue,
    mut stopped: oneshot::Receiver<()>,
) -> KafkaResult<()> {
    let mut received = consumer.stream();
    let mut is_paused = false;
    loop {
        tokio::select! {
            biased;
            _ended = &mut stopped => return Ok(()),
            () = queue.room.notified(), if is_paused => {}
            next = received.next() => match next.expect("a stream of messages has no end") {
                Ok(message) => {
                    // Partitions given while paused are not paused yet: their first message pauses them.
                    let is_full = queue.put(of_topic(queue.topic(), &message));
                    if is_full {
                        let has_room = tokio::select! {
                            _ended = &mut stopped => return Ok(()),
                            has_room = gets_room_soon(queue) => has_room,
                        };
                        if !has_room {
                            consumer.pause(&consumer.assignment()?)?;
                            is_paused = true;
                        }
                    }
                }
                Err(error @ KafkaError::MessageConsumptionFatal(_)) => return Err(error),
                // The client mends these by itself, or cannot; the reader asks when it gets nothing.
                Err(error) => tracing::debug!(%error, topic = %queue.topic(), "fetching is disturbed"),
            },
        }
        if may_resume(is_paused, queue) {
            consumer.resume(&consumer.assignment()?)?;
            is_paused = false;
        }
        // Messages that are there already must not keep others from running.
        tokio::task::consume_budget().await;
    }
}

/// Does the reader take something out before it pays to pause? After a pause the client needs up to a second to fetch again,
/// so that a quick reader would wait for it time and again.
async fn gets_room_soon(queue: &ConsumerQueue) -> bool {
    let room = async {
        while queue.is_full() {
            queue.room.notified().await;
        }
    };
    tokio::time::timeout(PAUSE_AFTER, room).await.is_ok()
}

/// Does fetching that is paused go on? Looked at after whatever came, not only when `room` rings: whoever waited for room for a message
/// heard it, and it does not ring again for a reader that finds nothing.
fn may_resume(is_paused: bool, queue: &ConsumerQueue) -> bool {
    is_paused && queue.has_room()
}

/// A message with its place. One that is too long for an event is cut: it is refused as such, and not held whole.
pub(crate) fn of_topic(topic: Topic, message: &BorrowedMessage<'_>) -> Message {
    let content = message.payload().unwrap_or_default();
    let kept = &content[..content.len().min(MAX_EVENT_BYTES + 1)];
    Message {
        origin: Origin {
            topic,
            partition: u32::try_from(message.partition())
                .expect("fetched partitions are numbered from 0"),
            offset: u64::try_from(message.offset()).expect("fetched messages are numbered from 0"),
        },
        content: Bytes::copy_from_slice(kept),
        time: message
            .timestamp()
            .to_millis()
            .and_then(|ms| TimeMs::new(ms).ok()),
    }
}

#[cfg(test)]
mod tests {
    use futures::{FutureExt as _, future};

    use super::*;

    fn message(partition: u32, offset: u64) -> Message {
        Message {
            origin: Origin {
                topic: Topic::GranuleNotice,
                partition,
                offset,
            },
            content: Bytes::from(vec![b'x'; 1 << 20]),
            time: None,
        }
    }

    #[tokio::test]
    async fn fetching_goes_on_though_the_one_ring_of_room_was_heard_for_another_partition() {
        let queue = ConsumerQueue::new(Topic::GranuleNotice);
        queue.give(0);
        let full = (0..1000).find(|&offset| queue.put(message(0, offset)));
        assert!(
            full.is_some(),
            "it pauses for bytes, below what is handed out"
        );
        // Fetching is paused. Another partition is given, whose first message finds no room, until all is taken out at once.
        queue.give(1);
        assert!(queue.put(message(1, 0)));
        assert!(!may_resume(true, &queue), "there is no room");
        let read = async { queue.hand_out(64).unwrap().len() };
        let (has_room, count) = future::join(gets_room_soon(&queue), read).await;
        assert!(has_room);
        assert_eq!(count as u64, full.unwrap() + 2, "all of them");
        assert!(queue.hand_out(64).unwrap().is_empty());
        let rings = queue.room.notified().now_or_never();
        assert!(rings.is_none(), "nobody would have to look");
        assert!(may_resume(true, &queue));
        assert!(!may_resume(false, &queue), "it is not paused");
    }
}
