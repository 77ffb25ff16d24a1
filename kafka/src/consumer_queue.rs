//! What a member of a group has fetched and not yet handed out, and how far each of its partitions is finished.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use contract::topic::{Origin, Topic};
use rdkafka::ClientContext;
use rdkafka::config::RDKafkaLogLevel;
use rdkafka::consumer::{BaseConsumer, ConsumerContext, Rebalance};
use rdkafka::error::KafkaError;
use storage::log::{Finished, LowWater, Message, Ready};
use tokio::sync::Notify;

use crate::context::Context;

/// Most messages that wait to be handed out; fetching pauses there.
const MAX_WAITING: usize = 1024;
/// Most bytes that wait to be handed out; the message that reaches it still fits.
const MAX_WAITING_BYTES: usize = 16 << 20;
/// Most messages handed out and not finished: a reader that finishes later ones only does not grow for ever.
const MAX_UNFINISHED: usize = 10_000;

/// Shared by a reader, the task that fetches for it, and the client's notes of partitions given and taken.
#[derive(Debug)]
pub(crate) struct ConsumerQueue {
    topic: Topic,
    state: Mutex<State>,
    /// Rung when a message is there or fetching failed.
    pub(crate) news: Notify,
    /// Rung when there is room again.
    pub(crate) room: Notify,
}

#[derive(Debug, Default)]
struct State {
    waiting: VecDeque<Message>,
    waiting_bytes: usize,
    owned: BTreeMap<u32, Owned>,
    /// Handed out and not finished when their partition was taken away.
    lost: Vec<Origin>,
    /// Counts partitions given.
    given: u64,
    failure: Option<KafkaError>,
}

impl State {
    fn is_full(&self) -> bool {
        self.waiting.len() >= MAX_WAITING || self.waiting_bytes >= MAX_WAITING_BYTES
    }
}

/// A partition of this member.
#[derive(Debug)]
struct Owned {
    /// Which giving of a partition it was: one that was taken and given again is another.
    giving: u64,
    water: LowWater,
}

/// What may be made durable together in one partition.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) partition: u32,
    giving: u64,
    pub(crate) ready: Ready,
}

impl ConsumerQueue {
    pub(crate) fn new(topic: Topic) -> Self {
        Self {
            topic,
            state: Mutex::default(),
            news: Notify::new(),
            room: Notify::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // What a panic could leave half done is dropped with the reader that panicked.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn topic(&self) -> Topic {
        self.topic
    }

    /// Takes in a partition that is this member's from now on.
    pub(crate) fn give(&self, partition: u32) {
        let mut state = self.state();
        state.given += 1;
        let owned = Owned {
            giving: state.given,
            water: LowWater::default(),
        };
        state.owned.insert(partition, owned);
    }

    /// Forgets a partition: its messages are somebody else's now.
    fn take_away(&self, partition: u32) {
        let mut state = self.state();
        if let Some(owned) = state.owned.remove(&partition) {
            let lost = owned.water.unfinished(self.topic, partition);
            state.lost.extend(lost);
        }
        state
            .waiting
            .retain(|message| message.origin.partition != partition);
        state.waiting_bytes = state.waiting.iter().map(|m| m.content.len()).sum();
        drop(state);
        self.room.notify_one();
    }

    /// Takes out the places of messages that were lost with their partitions.
    pub(crate) fn lost(&self) -> Vec<Origin> {
        std::mem::take(&mut self.state().lost)
    }

    /// Puts a message in; says whether fetching must pause.
    pub(crate) fn put(&self, message: Message) -> bool {
        let mut state = self.state();
        if !state.owned.contains_key(&message.origin.partition) {
            return false;
        }
        state.waiting_bytes += message.content.len();
        state.waiting.push_back(message);
        let is_full = state.is_full();
        drop(state);
        self.news.notify_one();
        is_full
    }

    /// Is there no room for another message?
    pub(crate) fn is_full(&self) -> bool {
        self.state().is_full()
    }

    /// May fetching go on? Half empty, so that it does not stop and go with every message.
    pub(crate) fn has_room(&self) -> bool {
        let state = self.state();
        state.waiting.len() <= MAX_WAITING / 2 && state.waiting_bytes <= MAX_WAITING_BYTES / 2
    }

    /// Fetching failed for good.
    pub(crate) fn fail(&self, error: KafkaError) {
        self.state().failure = Some(error);
        self.news.notify_one();
    }

    /// Hands out at most `max` messages.
    pub(crate) fn hand_out(&self, max: usize) -> Result<Vec<Message>, KafkaError> {
        let mut state = self.state();
        if let Some(failure) = &state.failure {
            return Err(failure.clone());
        }
        let unfinished: usize = state
            .owned
            .values()
            .map(|owned| owned.water.pending())
            .sum();
        let count = max
            .min(state.waiting.len())
            .min(MAX_UNFINISHED.saturating_sub(unfinished));
        let messages: Vec<Message> = state.waiting.drain(..count).collect();
        for message in &messages {
            state.waiting_bytes -= message.content.len();
            if let Some(owned) = state.owned.get_mut(&message.origin.partition) {
                owned.water.delivered(message.origin);
            }
        }
        drop(state);
        if !messages.is_empty() {
            self.room.notify_one();
        }
        Ok(messages)
    }

    /// Notes finished messages and takes out what may be made durable by them, a step a partition.
    pub(crate) fn finish(&self, done: Vec<Finished>) -> Vec<Step> {
        let mut state = self.state();
        for finished in done {
            if let Some(owned) = state.owned.get_mut(&finished.origin.partition) {
                owned.water.finish(finished);
            }
        }
        let steps = state.owned.iter_mut().map(|(&partition, owned)| Step {
            partition,
            giving: owned.giving,
            ready: owned.water.take_ready(),
        });
        steps.filter(|step| !step.ready.next.is_empty()).collect()
    }

    /// Is the partition of a step still this member's, without a break since?
    pub(crate) fn is_still_owned(&self, step: &Step) -> bool {
        let state = self.state();
        let owned = state.owned.get(&step.partition);
        owned.is_some_and(|owned| owned.giving == step.giving)
    }

    #[cfg(test)]
    pub(crate) fn waiting_bytes(&self) -> usize {
        self.state().waiting_bytes
    }
}

/// What the client of a member tells: its troubles, and which partitions it is given.
#[derive(Debug, Clone)]
pub(crate) struct Member {
    pub(crate) context: Context,
    pub(crate) queue: std::sync::Arc<ConsumerQueue>,
}

impl ClientContext for Member {
    fn log(&self, level: RDKafkaLogLevel, facility: &str, text: &str) {
        self.context.log(level, facility, text);
    }

    fn error(&self, error: KafkaError, reason: &str) {
        self.context.error(error, reason);
    }
}

impl ConsumerContext for Member {
    fn pre_rebalance(&self, _consumer: &BaseConsumer<Self>, change: &Rebalance<'_>) {
        match change {
            Rebalance::Assign(list) => {
                for partition in numbers(list) {
                    self.queue.give(partition);
                }
            }
            Rebalance::Revoke(list) => {
                for partition in numbers(list) {
                    self.queue.take_away(partition);
                }
            }
            Rebalance::Error(error) => tracing::warn!(%error, "partitions could not be shared out"),
        }
        let topic = self.queue.topic();
        tracing::debug!(%topic, ?change, "partitions change hands");
    }
}

fn numbers(list: &rdkafka::TopicPartitionList) -> Vec<u32> {
    let numbers = list.elements();
    let numbers = numbers
        .iter()
        .map(rdkafka::topic_partition_list::TopicPartitionListElem::partition);
    numbers
        .filter_map(|number| u32::try_from(number).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use contract::topic::Origin;

    fn message(partition: u32, offset: u64, bytes: usize) -> Message {
        Message {
            origin: Origin {
                topic: Topic::GranuleNotice,
                partition,
                offset,
            },
            content: Bytes::from(vec![b'x'; bytes]),
            time: None,
        }
    }

    fn finished(message: &Message) -> Finished {
        Finished {
            origin: message.origin,
            follows: vec![],
        }
    }

    #[test]
    fn fetching_pauses_when_messages_or_bytes_are_many_and_goes_on_when_half_are_out() {
        let queue = ConsumerQueue::new(Topic::GranuleNotice);
        queue.give(0);
        let full = (0..9999).find(|&n| queue.put(message(0, n, 1))).unwrap();
        assert_eq!(full as usize + 1, MAX_WAITING);
        assert!(!queue.has_room());
        let out = queue.hand_out(MAX_WAITING / 2).unwrap();
        assert!(queue.has_room());
        assert_eq!(out.len(), MAX_WAITING / 2);
        let big = MAX_WAITING_BYTES / 4;
        let count = (0..9999)
            .find(|&n| queue.put(message(0, 5000 + n, big)))
            .unwrap();
        assert_eq!(count, 3);
    }

    #[test]
    fn a_partition_that_is_taken_away_takes_its_messages_with_it() {
        let queue = ConsumerQueue::new(Topic::GranuleNotice);
        queue.give(0);
        queue.give(1);
        for partition in [0, 1] {
            queue.put(message(partition, 0, 10));
            queue.put(message(partition, 1, 10));
        }
        let out = queue.hand_out(3).unwrap();
        assert_eq!(queue.lost(), []);
        queue.take_away(0);
        let lost = [out[0].origin, out[1].origin];
        assert_eq!(queue.lost(), lost, "handed out and not finished");
        assert_eq!(queue.lost(), [], "told once");
        let steps = queue.finish(out.iter().map(finished).collect());
        assert_eq!(steps.len(), 1);
        assert_eq!(steps[0].partition, 1);
        assert_eq!(queue.waiting_bytes(), 10);
        queue.put(message(0, 2, 10));
        assert_eq!(
            queue.waiting_bytes(),
            10,
            "a late message of a lost partition"
        );
    }

    #[test]
    fn a_step_of_a_partition_that_was_away_in_between_is_no_longer_ours() {
        let queue = ConsumerQueue::new(Topic::GranuleNotice);
        queue.give(0);
        queue.put(message(0, 0, 1));
        let out = queue.hand_out(1).unwrap();
        let steps = queue.finish(vec![finished(&out[0])]);
        assert!(queue.is_still_owned(&steps[0]));
        queue.take_away(0);
        queue.give(0);
        assert!(!queue.is_still_owned(&steps[0]));
    }

    #[test]
    fn a_reader_that_never_finishes_its_oldest_message_is_stopped() {
        let queue = ConsumerQueue::new(Topic::GranuleNotice);
        queue.give(0);
        let mut count = 0;
        loop {
            queue.put(message(0, count as u64, 0));
            let out = queue.hand_out(10).unwrap();
            if out.is_empty() {
                break;
            }
            count += out.len();
            let later = out.iter().filter(|message| message.origin.offset > 0);
            assert!(queue.finish(later.map(finished).collect()).is_empty());
        }
        assert_eq!(count, MAX_UNFINISHED);
    }
}
