//! A member of a group: messages out, and what follows from them in one transaction with the offsets.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use contract::event::Event;
use contract::topic::{Origin, Topic};
use rdkafka::consumer::{Consumer as _, StreamConsumer};
use rdkafka::{Offset, TopicPartitionList};
use storage::StorageError;
use storage::log::{Finished, Message, Reader};
use tokio::time::Instant;

use crate::KafkaFailure;
use crate::append::record;
use crate::blocking::blocking;
use crate::cluster::Cluster;
use crate::consumer_queue::{ConsumerQueue, Member, Step};
use crate::context::Context;
use crate::off_thread::OffThread;
use crate::poll::Polling;
use crate::probe::are_brokers_there;
use crate::slots::{Slot, Slots};
use crate::transaction::{Offsets, Record, Transactions};
use crate::watch::Watch;

/// How long a member that the group left behind waits to be part of it again, so that it can move its offsets.
const AGAIN_LIMIT: Duration = Duration::from_secs(20);
const AGAIN_PAUSE: Duration = Duration::from_millis(100);
/// How long leaving may take: a busy broker shares out the partitions of all who are left before it answers. The group
/// does without a member by itself after its session; waiting longer than that gains nothing.
const LEAVE_LIMIT: Duration = Duration::from_secs(30);

/// Reads one topic with others of its group.
pub(crate) struct KafkaReader {
    cluster: Cluster,
    topic: Topic,
    consumer: OffThread<StreamConsumer<Member>>,
    context: Context,
    queue: Arc<ConsumerQueue>,
    polling: Polling,
    watch: Watch,
    transactions: Transactions,
    /// Keeps the name of the transactions from the next reader of this process.
    _slot: Slot,
    /// A call failed, or was given up half way: what this reader holds may not be what the group knows.
    is_spent: bool,
}

impl KafkaReader {
    pub(crate) async fn join(
        cluster: &Cluster,
        slots: &Slots,
        topic: Topic,
        group: &str,
    ) -> Result<Self, KafkaFailure> {
        const STEP: &str = "joining a group";
        let group = cluster.group(topic, group);
        let slot = slots.take(&group);
        // First the transactions: what a predecessor left open is ended before its offsets are asked for.
        let part = format!("{group}.{}", slot.number());
        let transactions = Transactions::open(cluster, &part).await?;
        let context = Context::default();
        let queue = Arc::new(ConsumerQueue::new(topic));
        let member = Member {
            context: context.clone(),
            queue: Arc::clone(&queue),
        };
        let consumer: StreamConsumer<Member> = cluster
            .member(&group)
            .create_with_context(member)
            .map_err(|e| context.failure(STEP, e))?;
        let consumer = OffThread::new(consumer);
        consumer
            .subscribe(&[&cluster.topic(topic)])
            .map_err(|e| context.failure(STEP, e))?;
        let polling = Polling::start(consumer.clone(), Arc::clone(&queue));
        let watch = Watch::start(&consumer, cluster.topic(topic));
        Ok(Self {
            cluster: cluster.clone(),
            topic,
            consumer,
            context,
            queue,
            polling,
            watch,
            transactions,
            _slot: slot,
            is_spent: false,
        })
    }

    fn failed(&mut self, failure: KafkaFailure) -> StorageError {
        self.is_spent = true;
        failure.of_log(self.cluster.servers())
    }

    /// Nothing came: is that because nobody is there?
    async fn check_brokers(&self) -> Result<(), KafkaFailure> {
        if self.watch.is_lost() {
            return Err(KafkaFailure::Lost);
        }
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

    /// Makes steps durable; drops those whose partition is no longer ours.
    async fn move_on(&self, mut steps: Vec<Step>) -> Result<(), KafkaFailure> {
        let until = Instant::now() + AGAIN_LIMIT;
        loop {
            // The order matters. Kafka refuses offsets of an earlier sharing-out; a partition that is still ours after
            // the metadata was taken was ours in the sharing-out that the metadata belongs to. Metadata of a member
            // that was thrown out says nothing, and Kafka would believe it.
            let consumer = self.consumer.clone();
            let (member, is_lost) = blocking("moving offsets", move || {
                Ok((consumer.group_metadata(), consumer.assignment_lost()))
            })
            .await?;
            steps.retain(|step| self.queue.is_still_owned(step));
            if steps.is_empty() {
                return Ok(());
            }
            let Some(member) = member.filter(|_member| !is_lost) else {
                if Instant::now() >= until {
                    return Err(self.context.slow("moving offsets", AGAIN_LIMIT));
                }
                tokio::time::sleep(AGAIN_PAUSE).await;
                continue;
            };
            let offsets = Offsets {
                list: self
                    .offsets(&steps)
                    .map_err(|e| self.context.failure("moving offsets", e))?,
                member,
            };
            let records = self.records(&steps);
            match self.transactions.run(records, Some(offsets)).await {
                Ok(()) => return Ok(()),
                Err(broken)
                    if broken.is_undone
                        && broken.failure.is_left_behind()
                        && Instant::now() < until =>
                {
                    tracing::debug!(topic = %self.topic, "partitions were shared out anew; finishing again");
                    tokio::time::sleep(AGAIN_PAUSE).await;
                }
                Err(broken) => return Err(*broken.failure),
            }
        }
    }

    fn offsets(&self, steps: &[Step]) -> Result<TopicPartitionList, rdkafka::error::KafkaError> {
        let topic = self.cluster.topic(self.topic);
        let mut list = TopicPartitionList::with_capacity(steps.len());
        for (&partition, &next) in steps.iter().flat_map(|step| &step.ready.next) {
            list.add_partition_offset(&topic, partition as i32, Offset::Offset(next as i64))?;
        }
        Ok(list)
    }

    fn records(&self, steps: &[Step]) -> Vec<Record> {
        let events = steps.iter().flat_map(|step| &step.ready.events);
        let record = |event: &Event| {
            record(&self.cluster, event).expect("the length was checked before it was noted")
        };
        events.map(record).collect()
    }
}

#[async_trait]
impl Reader for KafkaReader {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        if self.is_spent {
            return Err(self.failed(KafkaFailure::Spent));
        }
        let until = Instant::now() + wait;
        loop {
            let queue = Arc::clone(&self.queue);
            let news = queue.news.notified();
            tokio::pin!(news);
            // Registered before looking, so that nothing that comes in between is slept through.
            news.as_mut().enable();
            match self.queue.hand_out(max) {
                Ok(messages) if messages.is_empty() => {}
                Ok(messages) => return Ok(messages),
                Err(error) => {
                    let failure = self.context.failure("fetching", error);
                    return Err(self.failed(failure));
                }
            }
            if tokio::time::timeout_at(until, news).await.is_err() {
                return match self.check_brokers().await {
                    Ok(()) => Ok(vec![]),
                    Err(failure) => Err(self.failed(failure)),
                };
            }
        }
    }

    async fn finish(&mut self, done: Vec<Finished>) -> Result<(), StorageError> {
        if self.is_spent {
            return Err(self.failed(KafkaFailure::Spent));
        }
        for event in done.iter().flat_map(|finished| &finished.follows) {
            record(&self.cluster, event)?;
        }
        let steps = self.queue.finish(done);
        if steps.is_empty() {
            return Ok(());
        }
        // Until it is through: a caller that gives this call up does not learn how it ended.
        self.is_spent = true;
        match self.move_on(steps).await {
            Ok(()) => {
                self.is_spent = false;
                Ok(())
            }
            Err(failure) => Err(self.failed(failure)),
        }
    }

    fn lost(&mut self) -> Vec<Origin> {
        self.queue.lost()
    }

    async fn leave(self: Box<Self>) -> Result<(), StorageError> {
        const STEP: &str = "leaving a group";
        let this = *self;
        let ended = tokio::time::timeout(LEAVE_LIMIT, async move {
            tokio::join!(this.polling.end(), this.watch.end());
            // Its end says good-bye to the group.
            blocking(STEP, move || {
                drop(this.consumer.into_last());
                Ok(())
            })
            .await
        });
        match ended.await {
            Ok(left) => left.map_err(|failure| failure.of_log(this.cluster.servers())),
            Err(_elapsed) => Err(this
                .context
                .slow(STEP, LEAVE_LIMIT)
                .of_log(this.cluster.servers())),
        }
    }
}
