//! Transactions: records and offsets that become visible together or not at all.

use std::time::{Duration, Instant};

use bytes::Bytes;
use rdkafka::TopicPartitionList;
use rdkafka::consumer::ConsumerGroupMetadata;
use rdkafka::error::{KafkaError, RDKafkaErrorCode};
use rdkafka::producer::{FutureProducer, FutureRecord, Producer as _};
use tokio::runtime::Handle;

use crate::KafkaFailure;
use crate::blocking::blocking;
use crate::cluster::Cluster;
use crate::context::Context;
use crate::off_thread::OffThread;

/// How long a transaction may take, and ending it when it failed.
const LIMIT: Duration = Duration::from_secs(10);
const ABORT_LIMIT: Duration = Duration::from_secs(5);
/// How long the first word with the transactions' coordinator may take; it may have to end what a predecessor left.
const FIRST_LIMIT: Duration = Duration::from_secs(10);
/// Pause before a record is tried again that found the local queue full.
const FULL_PAUSE: Duration = Duration::from_millis(10);
/// How often, and after which pause, it is looked whether all reports are counted off.
const COUNTED_OFF_TRIES: u32 = 20;
const COUNTED_OFF_PAUSE: Duration = Duration::from_millis(1);
/// Pause before a step is tried again that may succeed now.
const AGAIN_PAUSE: Duration = Duration::from_millis(20);

/// One message to append.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Record {
    pub(crate) topic: String,
    pub(crate) key: String,
    pub(crate) content: Bytes,
}

/// Offsets of a member, as of the sharing-out that its metadata belongs to.
pub(crate) struct Offsets {
    pub(crate) list: TopicPartitionList,
    pub(crate) member: ConsumerGroupMetadata,
}

/// A transaction that did not come about.
#[derive(Debug)]
pub(crate) struct Broken {
    pub(crate) failure: Box<KafkaFailure>,
    /// Is it certain that nothing of it will ever be seen?
    pub(crate) is_undone: bool,
}

/// One after the other under one name; a second holder of the name shuts out the first.
#[derive(Clone)]
pub(crate) struct Transactions {
    producer: OffThread<FutureProducer<Context>>,
    context: Context,
}

impl Transactions {
    /// Takes the name, and ends what a holder before left open.
    pub(crate) async fn open(cluster: &Cluster, part: &str) -> Result<Self, KafkaFailure> {
        const STEP: &str = "opening transactions";
        let config = cluster.transacting(part);
        let context = Context::default();
        blocking(STEP, move || {
            let producer: FutureProducer<Context> = config
                .create_with_context(context.clone())
                .map_err(|e| context.failure(STEP, e))?;
            let transactions = Self {
                producer: OffThread::new(producer),
                context,
            };
            let until = Instant::now() + FIRST_LIMIT;
            transactions.again(STEP, until, |left| {
                transactions.producer.init_transactions(left)
            })?;
            Ok(transactions)
        })
        .await
    }

    /// Makes records and offsets durable together.
    pub(crate) async fn run(
        &self,
        records: Vec<Record>,
        offsets: Option<Offsets>,
    ) -> Result<(), Broken> {
        let this = self.clone();
        let handle = Handle::current();
        let ran = blocking("appending", move || {
            Ok(this.run_blocking(&handle, &records, offsets.as_ref()))
        });
        ran.await.unwrap_or_else(|failure| {
            Err(Broken {
                failure: Box::new(failure),
                is_undone: false,
            })
        })
    }

    fn run_blocking(
        &self,
        handle: &Handle,
        records: &[Record],
        offsets: Option<&Offsets>,
    ) -> Result<(), Broken> {
        let until = Instant::now() + LIMIT;
        if let Err(error) = self.producer.begin_transaction() {
            return Err(Broken {
                failure: Box::new(self.context.failure("beginning a transaction", error)),
                is_undone: true,
            });
        }
        let done = handle
            .block_on(self.deliver(records, until))
            .and_then(|()| self.send_offsets(offsets, until))
            .and_then(|()| {
                self.again("committing", until, |left| {
                    self.producer.commit_transaction(left)
                })
            });
        done.map_err(|failure| {
            let until = Instant::now() + ABORT_LIMIT;
            let aborted = self.again("aborting", until, |left| {
                self.producer.abort_transaction(left)
            });
            if let Err(error) = &aborted {
                tracing::debug!(%error, "how a transaction ended is known to Kafka only");
            }
            Broken {
                failure: Box::new(failure),
                is_undone: aborted.is_ok(),
            }
        })
    }

    /// Waits for every record here: the library's own wait at a commit looks ten times a second only.
    async fn deliver(&self, records: &[Record], until: Instant) -> Result<(), KafkaFailure> {
        const STEP: &str = "appending";
        let until = tokio::time::Instant::from_std(until);
        let mut deliveries = Vec::with_capacity(records.len());
        for record in records {
            deliveries.push(loop {
                match self.producer.send_result(record.for_producer()) {
                    Ok(delivery) => break delivery,
                    Err((error, _record))
                        if is_full(&error) && tokio::time::Instant::now() < until =>
                    {
                        tokio::time::sleep(FULL_PAUSE).await;
                    }
                    Err((error, _record)) => return Err(self.context.failure(STEP, error)),
                }
            });
        }
        let all = futures::future::join_all(deliveries);
        let all = tokio::time::timeout_at(until, all)
            .await
            .map_err(|_elapsed| self.context.slow(STEP, LIMIT))?;
        for delivery in all {
            match delivery {
                Ok(Ok(_place)) => {}
                Ok(Err((error, _record))) => return Err(self.context.failure(STEP, error)),
                Err(_cancelled) => return Err(self.context.failure(STEP, KafkaError::Canceled)),
            }
        }
        // The last report is told a moment before it is counted off, and a commit that still counts it waits long.
        for _ in 0..COUNTED_OFF_TRIES {
            if self.producer.in_flight_count() == 0 {
                break;
            }
            tokio::time::sleep(COUNTED_OFF_PAUSE).await;
        }
        Ok(())
    }

    fn send_offsets(&self, offsets: Option<&Offsets>, until: Instant) -> Result<(), KafkaFailure> {
        let Some(Offsets { list, member }) = offsets else {
            return Ok(());
        };
        self.again("moving offsets", until, |left| {
            self.producer
                .send_offsets_to_transaction(list, member, left)
        })
    }

    /// Calls until it succeeds, fails for good, or the time is over.
    fn again(
        &self,
        step: &'static str,
        until: Instant,
        call: impl Fn(Duration) -> Result<(), KafkaError>,
    ) -> Result<(), KafkaFailure> {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match call(left) {
                Ok(()) => return Ok(()),
                Err(KafkaError::Transaction(error))
                    if error.is_retriable() && left > AGAIN_PAUSE =>
                {
                    std::thread::sleep(AGAIN_PAUSE);
                }
                Err(error) => return Err(self.context.failure(step, error)),
            }
        }
    }
}

impl Record {
    pub(crate) fn for_producer(&self) -> FutureRecord<'_, str, [u8]> {
        FutureRecord::to(&self.topic)
            .key(self.key.as_str())
            .payload(&*self.content)
    }
}

pub(crate) fn is_full(error: &KafkaError) -> bool {
    error.rdkafka_error_code() == Some(RDKafkaErrorCode::QueueFull)
}
