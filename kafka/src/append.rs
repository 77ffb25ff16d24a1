//! Appending: one message by an idempotent producer, several in a transaction.

use std::sync::{MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use contract::event::{Event, MAX_EVENT_BYTES};
use contract::topic::Topic;
use rdkafka::producer::{FutureProducer, Producer as _};
use storage::StorageError;
use tokio::sync::Mutex;

use crate::KafkaFailure;
use crate::cluster::{Cluster, DELIVERY_LIMIT_MS};
use crate::context::Context;
use crate::off_thread::OffThread;
use crate::transaction::{Record, Transactions};

/// Longest key, characters. Longer ones are cut: messages that share a key still share it.
const MAX_KEY_CHARS: usize = 1024;
/// A message has its answer by then: the client's own limit and some more.
const LIMIT: Duration = Duration::from_millis(DELIVERY_LIMIT_MS + 2_000);

/// Appends for one process.
pub(crate) struct Appender {
    cluster: Cluster,
    /// Replaced when it can go on no more.
    single: std::sync::Mutex<Single>,
    /// Opened by the first append of several messages, and again after one that failed; one at a time.
    transactions: Mutex<Option<Transactions>>,
}

/// A producer of single messages.
#[derive(Clone)]
struct Single {
    producer: OffThread<FutureProducer<Context>>,
    context: Context,
}

impl Single {
    fn open(cluster: &Cluster) -> Result<Self, KafkaFailure> {
        let context = Context::default();
        let producer = cluster
            .appending()
            .create_with_context(context.clone())
            .map_err(|e| context.failure("opening a producer", e))?;
        Ok(Self {
            producer: OffThread::new(producer),
            context,
        })
    }

    async fn append(&self, record: &Record) -> Result<(), KafkaFailure> {
        const STEP: &str = "appending";
        let delivery = self
            .producer
            .send_result(record.for_producer())
            .map_err(|(error, _record)| self.context.failure(STEP, error))?;
        match tokio::time::timeout(LIMIT, delivery).await {
            Ok(Ok(Ok(_place))) => {
                self.context.well();
                Ok(())
            }
            Ok(Ok(Err((error, _record)))) => Err(self.context.failure(STEP, error)),
            Ok(Err(_cancelled)) => Err(KafkaFailure::Ending { step: STEP }),
            Err(_elapsed) => Err(self.context.slow(STEP, LIMIT)),
        }
    }
}

impl Appender {
    pub(crate) fn open(cluster: &Cluster) -> Result<Self, KafkaFailure> {
        Ok(Self {
            cluster: cluster.clone(),
            single: std::sync::Mutex::new(Single::open(cluster)?),
            transactions: Mutex::default(),
        })
    }

    fn single(&self) -> MutexGuard<'_, Single> {
        // Replaced whole: a panic elsewhere cannot leave it half done.
        self.single.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Appends all or none.
    pub(crate) async fn append(&self, records: Vec<Record>) -> Result<(), KafkaFailure> {
        match records.as_slice() {
            [] => Ok(()),
            [record] => self.append_one(record).await,
            _ => self.append_all(records).await,
        }
    }

    async fn append_one(&self, record: &Record) -> Result<(), KafkaFailure> {
        let single = self.single().clone();
        let appended = single.append(record).await;
        if let Err(failure) = &appended {
            // It lost count of what brokers have of it and refuses everything from here on; or it may have lost all brokers.
            let is_fatal = single.producer.client().fatal_error().is_some();
            if is_fatal || failure.is_out_of_time() {
                self.replace(&single)?;
            }
        }
        appended
    }

    /// Puts another producer in the place of one, unless somebody has.
    fn replace(&self, single: &Single) -> Result<(), KafkaFailure> {
        let mut current = self.single();
        if current.producer.is_same(&single.producer) {
            *current = Single::open(&self.cluster)?;
        }
        Ok(())
    }

    async fn append_all(&self, records: Vec<Record>) -> Result<(), KafkaFailure> {
        let mut open = tokio::time::timeout(LIMIT, self.transactions.lock())
            .await
            .map_err(|_elapsed| Context::default().slow("waiting to append", LIMIT))?;
        // Taken out for as long as it is used: a call that is given up half way leaves none behind.
        let transactions = match open.take() {
            Some(transactions) => transactions,
            None => Transactions::open(&self.cluster, "append").await?,
        };
        transactions
            .run(records, None)
            .await
            .map_err(|broken| *broken.failure)?;
        *open = Some(transactions);
        Ok(())
    }
}

/// An event as a record.
pub(crate) fn record(cluster: &Cluster, event: &Event) -> Result<Record, StorageError> {
    let topic = event.body.topic();
    message(
        cluster,
        topic,
        &event.body.order_key(),
        Bytes::from(event.to_json()),
    )
}

/// A message as a record.
pub(crate) fn message(
    cluster: &Cluster,
    topic: Topic,
    key: &str,
    content: Bytes,
) -> Result<Record, StorageError> {
    if content.len() > MAX_EVENT_BYTES {
        return Err(StorageError::Damaged {
            object: format!("message for {topic}"),
            reason: format!("it is longer than {MAX_EVENT_BYTES} bytes"),
        });
    }
    Ok(Record {
        topic: cluster.topic(topic),
        key: key.chars().take(MAX_KEY_CHARS).collect(),
        content,
    })
}
