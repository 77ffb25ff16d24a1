//! How far a reader has come when its messages are finished out of order.

use std::collections::{BTreeMap, VecDeque};

use contract::event::Event;
use contract::topic::{Origin, Topic};

use super::Finished;

/// Messages delivered and not yet passed by their group's offset. Offsets may have holes: only delivered messages count.
#[derive(Debug, Default)]
pub struct LowWater {
    partitions: BTreeMap<u32, VecDeque<Pending>>,
}

#[derive(Debug)]
struct Pending {
    offset: u64,
    /// What follows from it, once it is finished.
    follows: Option<Vec<Event>>,
}

/// What may be made durable together.
#[derive(Debug, Default, PartialEq)]
pub struct Ready {
    /// Events to append, in the order of the messages they follow from.
    pub events: Vec<Event>,
    /// Offset to go on from, by partition.
    pub next: BTreeMap<u32, u64>,
}

impl LowWater {
    /// Notes a delivered message. Those of a partition come in their order.
    pub fn delivered(&mut self, origin: Origin) {
        let pending = Pending {
            offset: origin.offset,
            follows: None,
        };
        self.partitions
            .entry(origin.partition)
            .or_default()
            .push_back(pending);
    }

    /// Notes a finished message; one that is not pending (its partition was taken away) is somebody else's now.
    pub fn finish(&mut self, done: Finished) {
        let Some(queue) = self.partitions.get_mut(&done.origin.partition) else {
            return;
        };
        if let Ok(at) = queue.binary_search_by_key(&done.origin.offset, |pending| pending.offset) {
            queue[at].follows = Some(done.follows);
        }
    }

    /// Takes out everything up to the first message that is not finished, in each partition.
    pub fn take_ready(&mut self) -> Ready {
        let mut ready = Ready::default();
        for (&partition, queue) in &mut self.partitions {
            while let Some(pending) = queue.pop_front_if(|pending| pending.follows.is_some()) {
                ready.events.extend(pending.follows.into_iter().flatten());
                ready.next.insert(partition, pending.offset + 1);
            }
        }
        ready
    }

    /// Forgets a partition that is no longer this reader's.
    pub fn forget(&mut self, partition: u32) {
        self.partitions.remove(&partition);
    }

    /// Messages of a partition that were delivered and are not finished.
    pub fn unfinished(&self, topic: Topic, partition: u32) -> Vec<Origin> {
        let queue = self.partitions.get(&partition).into_iter().flatten();
        let unfinished = queue.filter(|pending| pending.follows.is_none());
        unfinished
            .map(|pending| Origin {
                topic,
                partition,
                offset: pending.offset,
            })
            .collect()
    }

    /// Messages delivered and not yet passed.
    pub fn pending(&self) -> usize {
        self.partitions.values().map(VecDeque::len).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::event::Body;

    fn origin(partition: u32, offset: u64) -> Origin {
        Origin {
            topic: Topic::GranuleNotice,
            partition,
            offset,
        }
    }

    fn event(name: &str) -> Event {
        let body = Body::GranuleNotice {
            path: name.to_owned(),
            profile: None,
            product: None,
            variable: None,
            indexes: vec![],
            sha256: None,
            size_bytes: None,
            attempt: 1,
        };
        Event::new("t", body)
    }

    fn done(partition: u32, offset: u64, name: &str) -> Finished {
        Finished {
            origin: origin(partition, offset),
            follows: vec![event(name)],
        }
    }

    #[test]
    fn the_offset_waits_for_the_oldest_and_events_keep_the_messages_order() {
        let mut water = LowWater::default();
        for offset in [3, 5, 6] {
            water.delivered(origin(0, offset));
        }
        water.delivered(origin(1, 0));
        water.finish(done(0, 6, "third"));
        water.finish(done(0, 5, "second"));
        assert_eq!(water.take_ready(), Ready::default());
        water.finish(done(0, 3, "first"));
        let ready = water.take_ready();
        assert_eq!(ready.events, ["first", "second", "third"].map(event));
        assert_eq!(ready.next, BTreeMap::from([(0, 7)]));
        assert_eq!(water.pending(), 1);
    }

    #[test]
    fn a_message_of_a_partition_that_was_taken_away_moves_nothing() {
        let mut water = LowWater::default();
        water.delivered(origin(0, 1));
        water.forget(0);
        water.finish(done(0, 1, "late"));
        assert_eq!(water.take_ready(), Ready::default());
    }
}
