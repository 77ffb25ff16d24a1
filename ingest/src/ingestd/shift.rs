//! The one driver of all files, those of a stream and those of a command, from joining the readers of notices to leaving
//! them: takes notices, works on a bounded number of them at the same time, publishes what is ready, and finishes each
//! with what follows from it.

use std::collections::{BTreeMap, BTreeSet};
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use contract::product::ProductId;
use contract::topic::Origin;
use futures::FutureExt as _;
use futures::future::{AbortHandle, Abortable, Shared};
use futures::stream::StreamExt as _;
use storage::log::{Finished, Message, Reader};
use tokio::time::Instant;
use tracing::Instrument as _;

use super::publish_queue::{Number, PublishQueue};
use super::retry::Caller;
use super::work::{self, Done, Ended, Ready, Work, alongside};
use super::{GROUP, IngestService, TOPIC, now};
use crate::commit::{Claim, ClaimName};
use crate::error::IngestError;
use crate::notice::{Answer, Outcome, PendingNotice};
use crate::pipeline::metrics::{Metrics, class};
use crate::pipeline::progress::Progress;
use crate::pipeline::{Pipeline, Prepared};

/// How long notices are waited for while nothing is under way: bounds how late a stop is heard.
const IDLE_WAIT: Duration = Duration::from_millis(250);
/// And while something is: bounds how late what is done is finished.
const BUSY_WAIT: Duration = Duration::from_millis(20);

/// A command has read all notices when none comes for so long.
const END_WAIT: Duration = Duration::from_millis(10);

/// Messages that may wait for their sources for each that may be under way: what is kept of them is small.
const WAITING_FOR_EACH: usize = 16;
/// Messages of a group of a command: bounds what a crash makes be done again.
pub(super) const GROUP_MESSAGES: usize = 64;

/// A file that is under way.
struct Job {
    notice: Arc<PendingNotice>,
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
    caller: Caller,
    pipeline: Pipeline<'a>,
    publish_queue: PublishQueue<Ready>,
    jobs: BTreeMap<Number, Job>,
    open: BTreeMap<Number, Open>,
    next: Number,
    work: Work<'a>,
    ended: Vec<Ended>,
    /// Files that are there, whose place files that were offered before them do not take.
    claims: BTreeMap<ClaimName, Claim>,
    /// The newest version of each product that was published here.
    published: BTreeMap<ProductId, u64>,
    /// Files to be looked at again once their product is not being published: they were there before.
    again: Vec<(Number, Claim, Answer)>,
    /// Messages of which everything is answered.
    finished: BTreeMap<Number, Open>,
    /// What became of the files of a command, in the order of their notices.
    told: &'a mut Vec<Outcome>,
}

/// Works until `stop`, or for a command until no notice is left, or until the event log fails; what is not finished then
/// comes again.
pub(super) async fn run(
    service: &IngestService,
    caller: Caller,
    progress: &dyn Progress,
    stop: Shared<impl Future<Output = ()> + Send>,
    told: &mut Vec<Outcome>,
) -> Result<(), IngestError> {
    let mut reader = service
        .log
        .join(TOPIC, GROUP)
        .await
        .map_err(IngestError::storage("join the readers of notices"))?;
    let mut shift = Shift {
        service,
        caller,
        pipeline: service.pipeline(progress),
        publish_queue: PublishQueue::default(),
        jobs: BTreeMap::new(),
        open: BTreeMap::new(),
        next: 0,
        work: Work::new(),
        ended: Vec::new(),
        claims: BTreeMap::new(),
        published: BTreeMap::new(),
        again: Vec::new(),
        finished: BTreeMap::new(),
        told,
    };
    let mut last_call = None;
    loop {
        shift.settle()?;
        shift.give_up(&reader.lost());
        shift.look_again();
        shift.publish();
        shift.finish(reader.as_mut()).await?;
        if last_call.is_none() && stop.clone().now_or_never().is_some() {
            tracing::info!(under_way = shift.open.len(), "finishing what is under way");
            last_call = Some(Instant::now() + service.drain);
        }
        if let Some(last_call) = last_call {
            let is_late = Instant::now() >= last_call;
            if shift.open.is_empty() && shift.ended.is_empty() || is_late {
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
            let has_come = shift.take(reader.as_mut()).await?;
            if caller == Caller::Command && !has_come {
                last_call = Some(Instant::now() + service.drain);
            }
        } else {
            shift.wait(&stop, last_call).await;
        }
    }
}

impl<'a> Shift<'a> {
    /// How many further messages may be taken. Those that wait for a source that is slow or away take no place from others,
    /// as long as they are not very many.
    fn room(&self) -> usize {
        if self.caller == Caller::Command {
            let is_between_groups = self.open.is_empty();
            return if is_between_groups { GROUP_MESSAGES } else { 0 };
        }
        let is_waited_for = |number: &Number| {
            let job = self.jobs.get(number);
            job.is_some_and(|job| job.notice.source_wait.is_long())
        };
        let waits = |open: &&Open| open.answers.iter().any(|(number, _)| is_waited_for(number));
        let waiting = self.open.values().filter(waits).count();
        let parallel = self.service.parallel_notices;
        let places = parallel + waiting.min(parallel.saturating_mul(WAITING_FOR_EACH));
        places.saturating_sub(self.open.len())
    }

    /// Takes further messages, as many as there is room for. Were there any?
    async fn take(&mut self, reader: &mut dyn Reader) -> Result<bool, IngestError> {
        let room = self.room();
        let wait = match self.caller {
            Caller::Command => END_WAIT,
            Caller::Service if self.work.is_empty() => IDLE_WAIT,
            Caller::Service => BUSY_WAIT,
        };
        let read = reader.next(room, wait);
        let messages = alongside(&mut self.work, &mut self.ended, read).await;
        let messages = messages.map_err(IngestError::storage("read notices"))?;
        // Before anything is begun: what was lost may have come back, to be begun anew.
        self.give_up(&reader.lost());
        for message in &messages {
            self.begin(message);
        }
        Ok(!messages.is_empty())
    }

    fn begin(&mut self, message: &Message) {
        let number = self.count();
        let mut answers = Vec::new();
        let mut trace = String::new();
        for notice in PendingNotice::of(message, &self.service.settings, now()) {
            trace.clone_from(&notice.cause.trace);
            let job = self.count();
            answers.push((job, None));
            self.publish_queue.add(job, notice.order_key());
            let notice = Arc::new(notice);
            let prepare = self.prepare(job, &notice);
            let message = number;
            self.jobs.insert(
                job,
                Job {
                    notice,
                    message,
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

    /// Begins to take a file as far as to the manifest.
    fn prepare(&mut self, job: Number, notice: &Arc<PendingNotice>) -> AbortHandle {
        let by = (self.caller, &self.service.health);
        let work = work::prepare(self.pipeline, by, job, Arc::clone(notice));
        self.push(notice, work)
    }

    /// Work on a file that can be ended.
    fn push(
        &mut self,
        notice: &PendingNotice,
        work: impl Future<Output = Ended> + Send + 'a,
    ) -> AbortHandle {
        let origin = notice.origin;
        let span = tracing::info_span!("notice", trace = notice.cause.trace, %origin);
        let (prepare, registration) = AbortHandle::new_pair();
        let work = Abortable::new(work.instrument(span), registration);
        let work = work.map(|ended| ended.unwrap_or(Ok(Done::GivenUp)));
        self.work.push(Box::pin(work));
        prepare
    }

    /// Looks again at files that were there in a version that others were published over meanwhile.
    fn look_again(&mut self) {
        let queue = &self.publish_queue;
        let free = self
            .again
            .extract_if(.., |(_, claim, _)| !queue.is_busy(&claim.product));
        for (number, mut claim, answer) in free.collect::<Vec<_>>() {
            let Some(notice) = self.jobs.get(&number).map(|job| Arc::clone(&job.notice)) else {
                continue;
            };
            // It is compared with what there is now.
            let published = self.published.get(&claim.product).copied();
            claim.version = published.unwrap_or_default().max(claim.version);
            let by = (self.caller, &self.service.health);
            let file = (number, Arc::clone(&notice));
            let work = work::prepare_again(self.pipeline, by, file, (claim, answer));
            let prepare = self.push(&notice, work);
            if let Some(job) = self.jobs.get_mut(&number) {
                job.prepare = prepare;
            }
        }
    }

    /// A file changes nothing in a version of its product.
    fn there(&mut self, number: Number, claim: Claim, answer: Answer) {
        if !self.jobs.contains_key(&number) {
            return;
        }
        let published = self.published.get(&claim.product);
        if self.publish_queue.is_busy(&claim.product)
            || published.is_some_and(|newest| *newest > claim.version)
        {
            self.again.push((number, claim, answer));
            return;
        }
        self.claim(claim);
        self.answered(number, answer);
    }

    /// Keeps the place of a file that is there.
    fn claim(&mut self, claim: Claim) {
        let of = claim.name();
        let before = self.claims.get(&of).map(|before| before.place);
        if before.is_none_or(|before| before < claim.place) {
            self.claims.insert(of, claim);
        }
    }

    /// What files claim that are there, as long as others that were offered before them are on their way.
    fn claims_of(&self, product: &ProductId) -> Vec<Claim> {
        let of_it = self
            .claims
            .values()
            .filter(|claim| claim.product == *product);
        of_it.cloned().collect()
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
            Some(ended) = self.work.next() => self.ended.push(ended),
            () = stop.clone(), if last_call.is_none() => {}
            () = tokio::time::sleep_until(until) => {}
        }
    }

    /// Notes what ended.
    fn settle(&mut self) -> Result<(), IngestError> {
        for ended in std::mem::take(&mut self.ended) {
            match ended? {
                Done::Prepared(number, prepared) => match *prepared {
                    Prepared::ToCommit(granule) => {
                        let product = granule.product.clone();
                        let ready = Ready::Granule(Box::new(granule));
                        self.publish_queue.ready(number, product, ready);
                    }
                    Prepared::ToStore(file) => {
                        let dataset = file.dataset.clone();
                        let ready = Ready::Observed(Box::new(file));
                        self.publish_queue.ready(number, dataset, ready);
                    }
                    Prepared::Answered(answer) => self.answered(number, answer),
                    Prepared::There(claim, answer) => self.there(number, claim, answer),
                },
                Done::GivenUp => {}
                Done::Published(product, answers) => {
                    self.publish_queue.free(&product);
                    for (number, answer, claim) in answers {
                        match &answer.outcome {
                            // The version has its place.
                            Outcome::Landed { manifest, .. } => {
                                let newest = self.published.entry(product.clone()).or_default();
                                *newest = manifest.number.max(*newest);
                            }
                            Outcome::AlreadyLanded { .. } | Outcome::Superseded { .. } => {
                                if let Some(claim) = claim {
                                    self.claim(claim);
                                }
                            }
                            Outcome::Rejected { .. } | Outcome::Observed { .. } => {}
                        }
                        self.answered(number, answer);
                    }
                }
            }
        }
        Ok(())
    }

    fn answered(&mut self, number: Number, answer: Answer) {
        self.publish_queue.remove(number);
        let Some(job) = self.jobs.remove(&number) else {
            return;
        };
        if !self.claims.is_empty() {
            let places = self.jobs.values().map(|job| job.notice.place);
            let first = places.min();
            self.claims
                .retain(|_, claim| first.is_some_and(|first| first < claim.place));
        }
        let Some(open) = self.open.get_mut(&job.message) else {
            return;
        };
        if let Some((_, place)) = open.answers.iter_mut().find(|(own, _)| *own == number) {
            *place = Some(answer);
        }
        if open.answers.iter().all(|(_, answer)| answer.is_some())
            && let Some(open) = self.open.remove(&job.message)
        {
            self.finished.insert(job.message, open);
        }
    }

    /// Begins to publish what may be: a group of a command once all of it is ready.
    fn publish(&mut self) {
        if self.caller == Caller::Command && self.publish_queue.is_preparing() {
            return;
        }
        for (product, files) in self.publish_queue.take() {
            let by = (self.caller, &self.service.health);
            let claims = self.claims_of(&product);
            let work = work::publish(self.pipeline, by, (product, claims), files);
            self.work.push(Box::pin(work));
        }
    }

    /// Finishes what is answered: a group of a command once all of it is.
    async fn finish(&mut self, reader: &mut dyn Reader) -> Result<(), IngestError> {
        let is_in_group = self.caller == Caller::Command && !self.open.is_empty();
        if self.finished.is_empty() || is_in_group {
            return Ok(());
        }
        let finished = std::mem::take(&mut self.finished);
        let events = |open: &Open| {
            open.answers
                .iter()
                .filter_map(|(_, answer)| answer.as_ref()?.event.clone())
                .collect()
        };
        let messages = finished.values().map(|open| Finished {
            origin: open.origin,
            follows: events(open),
        });
        let finish = reader.finish(messages.collect());
        alongside(&mut self.work, &mut self.ended, finish)
            .await
            .map_err(IngestError::storage("finish notices"))?;
        for open in finished.into_values() {
            self.tell(open);
        }
        Ok(())
    }

    /// Tells of a message whose events are told: a service to its operators, a command to its caller.
    fn tell(&mut self, open: Open) {
        let mut ended = service::Outcome::Ok;
        for answer in open.answers.into_iter().filter_map(|(_, answer)| answer) {
            if answer.outcome.is_rejected() {
                ended = service::Outcome::Refused;
            }
            if self.caller == Caller::Service {
                count(self.pipeline.metrics, (&open.trace, open.origin), &answer);
            }
            self.pipeline.progress.done(&answer.outcome);
            if self.caller == Caller::Command {
                self.told.push(answer.outcome);
            }
        }
        open.running.done(ended);
    }
}

/// Counts and logs what became of a file.
fn count(metrics: &Metrics, (trace, origin): (&str, Origin), answer: &Answer) {
    let Answer { outcome, event } = answer;
    match outcome {
        Outcome::Rejected { reason, .. } => {
            metrics.rejected(*reason);
            let reason = class(*reason);
            tracing::warn!(trace, %origin, reason, "refused {outcome}");
        }
        Outcome::Landed {
            manifest, masked, ..
        } => {
            let noticed = event.as_ref().and_then(|event| event.noticed);
            metrics.landed(noticed, now());
            metrics.masked(&manifest.product, *masked);
            tracing::info!(trace, %origin, "{outcome}");
        }
        Outcome::Superseded { .. } => {
            metrics.superseded();
            tracing::warn!(trace, %origin, told = event.is_some(), "{outcome}");
        }
        Outcome::Observed {
            dataset,
            stored,
            masked,
            ..
        } => {
            // A file that comes again brings nothing, and masks nothing.
            if stored.new + stored.replaced > 0 {
                metrics.masked(dataset, *masked);
            }
            tracing::info!(trace, %origin, "{outcome}");
        }
        Outcome::AlreadyLanded { .. } => {
            tracing::info!(trace, %origin, told = event.is_some(), "{outcome}");
        }
    }
}
