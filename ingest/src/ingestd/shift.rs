//! The service at work, from joining the readers of notices to leaving them: takes notices, works on a bounded number of
//! them at the same time, publishes what is ready, and finishes each with what follows from it.

use std::collections::{BTreeMap, BTreeSet};
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use contract::topic::Origin;
use futures::FutureExt as _;
use futures::future::{AbortHandle, Abortable, Shared};
use futures::stream::StreamExt as _;
use storage::log::{Finished, Message, Reader};
use tokio::time::Instant;
use tracing::Instrument as _;

use super::publish_queue::{Number, PublishQueue};
use super::work::{self, Done, Work, alongside};
use super::{GROUP, IngestService, TOPIC, now};
use crate::notice::answer::{Answer, Asked};
use crate::error::IngestError;
use crate::pipeline::metrics;
use crate::notice::Outcome;
use crate::pipeline::Pipeline;
use crate::pipeline::progress::Progress;
use crate::put::StoredGranule;

/// How long notices are waited for while nothing is under way: bounds how late a stop is heard.
const IDLE_WAIT: Duration = Duration::from_millis(250);
/// And while something is: bounds how late what is done is finished.
const BUSY_WAIT: Duration = Duration::from_millis(20);

/// Messages that may wait for their sources for each that may be under way: what is kept of them is small.
const WAITING_FOR_EACH: usize = 16;

/// A file that is under way.
struct Job {
    asked: Arc<Asked>,
    /// Number of its message.
    message: Number,
    /// Ends its preparation.
    prepare: AbortHandle,
}

/// A message some of whose files are under way.
struct Open {
    origin: Origin,
    trace: String,
    /// In the order of its files.
    answers: Vec<(Number, Option<Answer>)>,
    running: service::Running,
}

struct Shift<'a> {
    service: &'a IngestService,
    pipeline: Pipeline<'a>,
    publish_queue: PublishQueue<StoredGranule>,
    jobs: BTreeMap<Number, Job>,
    open: BTreeMap<Number, Open>,
    next: Number,
    work: Work<'a>,
    done: Vec<Done>,
    /// Messages of which everything is answered.
    finished: Vec<Open>,
}

/// Works until `stop`, or until the event log fails; what is not finished then comes again.
pub(super) async fn run(
    service: &IngestService,
    progress: &dyn Progress,
    stop: Shared<impl Future<Output = ()> + Send>,
) -> Result<(), IngestError> {
    let mut reader = service
        .log
        .join(TOPIC, GROUP)
        .await
        .map_err(IngestError::storage("join the readers of notices"))?;
    let mut shift = Shift {
        service,
        pipeline: service.pipeline(progress),
        publish_queue: PublishQueue::default(),
        jobs: BTreeMap::new(),
        open: BTreeMap::new(),
        next: 0,
        work: Work::new(),
        done: Vec::new(),
        finished: Vec::new(),
    };
    let mut last_call = None;
    loop {
        shift.settle();
        shift.give_up(&reader.lost());
        shift.publish();
        shift.finish(reader.as_mut()).await?;
        if last_call.is_none() && stop.clone().now_or_never().is_some() {
            tracing::info!(under_way = shift.open.len(), "finishing what is under way");
            last_call = Some(Instant::now() + service.drain);
        }
        if let Some(last_call) = last_call {
            let is_late = Instant::now() >= last_call;
            if shift.open.is_empty() && shift.done.is_empty() || is_late {
                if is_late {
                    tracing::warn!(under_way = shift.open.len(), "out of time; it comes again");
                }
                return reader
                    .leave()
                    .await
                    .map_err(IngestError::storage("leave the readers of notices"));
            }
        }
        if last_call.is_none() && shift.room() > 0 {
            shift.take(reader.as_mut()).await?;
        } else {
            shift.wait(&stop, last_call).await;
        }
    }
}

impl Shift<'_> {
    /// How many further messages may be taken. Those that wait for a source that is slow or away take no place from others,
    /// as long as they are not very many.
    fn room(&self) -> usize {
        let is_waited_for = |number: &Number| {
            let job = self.jobs.get(number);
            job.is_some_and(|job| job.asked.source_wait.is_long())
        };
        let waits = |open: &&Open| open.answers.iter().any(|(number, _)| is_waited_for(number));
        let waiting = self.open.values().filter(waits).count();
        let parallel = self.service.parallel_notices;
        let places = parallel + waiting.min(parallel.saturating_mul(WAITING_FOR_EACH));
        places.saturating_sub(self.open.len())
    }

    /// Takes further messages, as many as there is room for.
    async fn take(&mut self, reader: &mut dyn Reader) -> Result<(), IngestError> {
        let room = self.room();
        let wait = if self.work.is_empty() {
            IDLE_WAIT
        } else {
            BUSY_WAIT
        };
        let read = reader.next(room, wait);
        let messages = alongside(&mut self.work, &mut self.done, read).await;
        let messages = messages.map_err(IngestError::storage("read notices"))?;
        // Before anything is begun: what was lost may have come back, to be begun anew.
        self.give_up(&reader.lost());
        for message in messages {
            self.begin(&message);
        }
        Ok(())
    }

    fn begin(&mut self, message: &Message) {
        let number = self.count();
        let mut answers = Vec::new();
        let mut trace = String::new();
        for asked in Asked::of(message, &self.service.settings, now()) {
            trace.clone_from(&asked.notice.cause.trace);
            let job = self.count();
            answers.push((job, None));
            self.publish_queue.add(job, asked.notice.order_key.clone());
            let asked = Arc::new(asked);
            let span = tracing::info_span!("notice", trace = asked.notice.cause.trace, origin = %message.origin);
            let work = work::prepare(self.pipeline, &self.service.health, job, Arc::clone(&asked));
            let (prepare, registration) = AbortHandle::new_pair();
            let work = Abortable::new(work.instrument(span), registration);
            let work = work.map(|ended| ended.unwrap_or(Done::GivenUp));
            self.work.push(Box::pin(work));
            self.jobs.insert(
                job,
                Job {
                    asked,
                    message: number,
                    prepare,
                },
            );
        }
        let open = Open {
            origin: message.origin,
            trace,
            answers,
            running: self.service.metrics.start("notice"),
        };
        self.open.insert(number, open);
    }

    /// Ends what is under way for messages that another member has now: it does all of it again. What is being published
    /// is published, as it would be by the other one.
    fn give_up(&mut self, lost: &[Origin]) {
        if lost.is_empty() {
            return;
        }
        let lost: BTreeSet<Origin> = lost.iter().copied().collect();
        let gone = self
            .open
            .extract_if(.., |_, open| lost.contains(&open.origin));
        let jobs: Vec<Number> = gone
            .flat_map(|(_, open)| open.answers.into_iter().map(|(job, _)| job))
            .collect();
        tracing::info!(
            files = jobs.len(),
            "given up: another member has their notices now"
        );
        for number in jobs {
            self.publish_queue.remove(number);
            if let Some(job) = self.jobs.remove(&number) {
                job.prepare.abort();
            }
        }
    }

    fn count(&mut self) -> Number {
        self.next += 1;
        self.next
    }

    /// Waits for a piece of work.
    async fn wait(
        &mut self,
        stop: &Shared<impl Future<Output = ()> + Send>,
        last_call: Option<Instant>,
    ) {
        let until = last_call.unwrap_or_else(|| Instant::now() + IDLE_WAIT);
        tokio::select! {
            Some(done) = self.work.next() => self.done.push(done),
            () = stop.clone(), if last_call.is_none() => {}
            () = tokio::time::sleep_until(until) => {}
        }
    }

    /// Notes what ended.
    fn settle(&mut self) {
        for done in std::mem::take(&mut self.done) {
            match done {
                Done::ToPublish(number, granule) => {
                    let product = granule.target.product.clone();
                    self.publish_queue.ready(number, product, *granule);
                }
                Done::Answered(number, answer) => self.answered(number, &answer),
                Done::GivenUp => {}
                Done::Published(product, answers) => {
                    self.publish_queue.free(&product);
                    for (number, answer) in answers {
                        self.answered(number, &answer);
                    }
                }
            }
        }
    }

    fn answered(&mut self, number: Number, answer: &Answer) {
        self.publish_queue.remove(number);
        let Some(job) = self.jobs.remove(&number) else {
            return;
        };
        let Some(open) = self.open.get_mut(&job.message) else {
            return;
        };
        for (own, place) in &mut open.answers {
            if *own == number {
                *place = Some(answer.clone());
            }
        }
        if open.answers.iter().all(|(_, answer)| answer.is_some()) {
            self.finished.extend(self.open.remove(&job.message));
        }
    }

    /// Begins to publish what may be.
    fn publish(&mut self) {
        for (product, files) in self.publish_queue.take() {
            let batch = files.into_iter().filter_map(|(number, granule)| {
                let asked = Arc::clone(&self.jobs.get(&number)?.asked);
                Some((number, asked, granule))
            });
            let work = work::publish(
                self.pipeline,
                &self.service.health,
                product,
                batch.collect(),
            );
            self.work.push(Box::pin(work));
        }
    }

    /// Finishes what is answered.
    async fn finish(&mut self, reader: &mut dyn Reader) -> Result<(), IngestError> {
        if self.finished.is_empty() {
            return Ok(());
        }
        let finished = std::mem::take(&mut self.finished);
        let events = |open: &Open| {
            open.answers
                .iter()
                .filter_map(|(_, answer)| answer.as_ref()?.event.clone())
                .collect()
        };
        let messages = finished.iter().map(|open| Finished {
            origin: open.origin,
            follows: events(open),
        });
        let told = reader.finish(messages.collect());
        alongside(&mut self.work, &mut self.done, told)
            .await
            .map_err(IngestError::storage("finish notices"))?;
        for open in finished {
            tell(open, self.pipeline);
        }
        Ok(())
    }
}

/// Counts and logs a message whose events are told.
fn tell(open: Open, pipeline: Pipeline<'_>) {
    let mut ended = service::Outcome::Ok;
    for (_, answer) in open.answers {
        let Some(Answer { outcome, event }) = answer else {
            continue;
        };
        let trace = open.trace.as_str();
        let noticed = event.as_ref().and_then(|event| event.noticed);
        match &outcome {
            Outcome::Rejected { reason, .. } => {
                ended = service::Outcome::Refused;
                pipeline.metrics.rejected(*reason);
                let reason = metrics::class(*reason);
                tracing::warn!(trace, origin = %open.origin, reason, "refused {outcome}");
            }
            Outcome::Landed {
                manifest, masked, ..
            } => {
                pipeline.metrics.landed(noticed, now());
                pipeline.metrics.masked(&manifest.product, *masked);
                tracing::info!(trace, origin = %open.origin, "{outcome}");
            }
            Outcome::Superseded { .. } => {
                pipeline.metrics.superseded();
                tracing::warn!(trace, origin = %open.origin, told = event.is_some(), "{outcome}");
            }
            Outcome::Observed {
                dataset,
                stored,
                masked,
                ..
            } => {
                // A file that comes again brings nothing, and masks nothing.
                if stored.new + stored.replaced > 0 {
                    pipeline.metrics.masked(dataset, *masked);
                }
                tracing::info!(trace, origin = %open.origin, "{outcome}");
            }
            Outcome::AlreadyLanded { .. } => {
                tracing::info!(trace, origin = %open.origin, told = event.is_some(), "{outcome}");
            }
        }
        pipeline.progress.done(&outcome);
    }
    open.running.done(ended);
}
