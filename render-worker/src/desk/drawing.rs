//! One job at the desk: looked for in the store, else drawn in turn, then kept.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use ::service::Outcome as Ended;
use bytes::Bytes;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use render::RenderError;
use render::plan::Part;
use storage::{StorageError, Store};
use tracing::Instrument as _;

use super::queue::{Full, Permit};
use super::single_flight::{Flight, Outcome};
use super::{Class, DeskError, Drawn, Inner, Order, Origin, Storing, Turn};
use crate::annotation::Lifted;
use crate::error::DrawError;
use crate::pipeline::Picture;

/// Shortest and longest hint when to ask a full worker again.
const RETRY_HINT: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(30)];

impl Inner {
    /// One job from the store or from the device.
    pub(super) async fn make(
        self: &Arc<Self>,
        job: &RenderJob,
        flight: &Arc<Flight>,
        order: Order,
        turn: Turn,
    ) -> Outcome {
        if order.storing == Storing::LookUpAndKeep
            && let Some(drawn) = flight.while_wanted(self.stored(job)).await?
        {
            return Ok(drawn);
        }
        let waiting = Instant::now();
        let permit = Arc::new((self.turn(flight, order.class).await?, turn));
        self.wait_s.observe(waiting.elapsed().as_secs_f64());
        let begun = Instant::now();
        let drawn = self.drawn(job, order.part, flight, &permit).await;
        self.note(&drawn);
        let Picture { image, lifted, .. } = drawn?;
        self.learn(begun.elapsed());
        // Another draws while this one is encoded and stored.
        // Annotations go over the whole picture, by whoever puts parts together.
        let annotated = job.annotations.as_ref().filter(|_| order.part.is_none());
        let annotated = annotated.map(|_some| (job.clone(), lifted));
        let encoding = self
            .pipeline
            .encode(annotated, image, order.encoding, permit);
        let encoding = flight.while_wanted(Box::pin(encoding));
        let bytes = self.measured("encode", encoding).await?;
        let drawn = Drawn {
            bytes,
            origin: Origin::Drawn,
            kept: false,
            lifted,
        };
        Ok(self.kept(job, drawn, order).await)
    }

    /// A picture after what the store has to do with it.
    async fn kept(self: &Arc<Self>, job: &RenderJob, drawn: Drawn, order: Order) -> Drawn {
        if order.storing == Storing::Nothing {
            self.pictures.with_label_values(&["drawn"]).inc();
            return drawn;
        }
        let count = |desk: &Self, name: &str| desk.pictures.with_label_values(&[name]).inc();
        if self.stores_behind(job, &drawn.bytes, order, count) {
            return drawn;
        }
        let (name, drawn) = self.put(job, drawn.bytes).await;
        count(self, name);
        drawn
    }

    /// A picture that was not kept, given to somebody who ordered it to be.
    pub(super) async fn kept_after_all(
        self: &Arc<Self>,
        job: &RenderJob,
        drawn: Drawn,
        order: Order,
    ) -> Drawn {
        if self.stores_behind(job, &drawn.bytes, order, |_counted, _before| ()) {
            return drawn;
        }
        self.put(job, drawn.bytes).await.1
    }

    /// Begins to store a picture that somebody waits for, who need not wait for the store; false if it must be stored first.
    fn stores_behind(
        self: &Arc<Self>,
        job: &RenderJob,
        bytes: &Bytes,
        order: Order,
        count: impl Fn(&Self, &str) + Send + 'static,
    ) -> bool {
        // Whoever looks in the store himself is told what is there.
        if order.class != Class::OnDemand || order.storing != Storing::Keep {
            return false;
        }
        let Some(room) = self.writes.room(bytes.len()) else {
            return false;
        };
        let (desk, job, picture) = (Arc::clone(self), job.clone(), bytes.clone());
        let writing = async move {
            let (name, _given_already) = desk.put(&job, picture).await;
            count(&desk, name);
            drop(room);
        };
        tokio::spawn(writing.in_current_span());
        true
    }

    /// What is given out of a picture that is to be kept, and the name of how that went.
    async fn put(&self, job: &RenderJob, drawn: Bytes) -> (&'static str, Drawn) {
        let kept = self.writes.timed(self.keep(job, drawn.clone())).await;
        let (name, bytes, origin, kept) = match kept {
            Ok(None) => ("drawn", drawn, Origin::Drawn, true),
            Ok(Some(theirs)) => ("conflict", theirs, Origin::Stored, true),
            Err(error) => {
                let error = error.in_full();
                tracing::warn!(error, "a picture is given out but not kept");
                ("not_kept", drawn, Origin::Drawn, false)
            }
        };
        (
            name,
            Drawn {
                bytes,
                origin,
                kept,
                lifted: Lifted::default(),
            },
        )
    }

    /// The picture, if it was drawn before. A store that cannot be asked is one more reason to draw.
    async fn stored(&self, job: &RenderJob) -> Result<Option<Drawn>, DrawError> {
        match self.store.get(&job.key()).await {
            Ok(bytes) => {
                self.pictures.with_label_values(&["stored"]).inc();
                let origin = Origin::Stored;
                Ok(Some(Drawn {
                    bytes,
                    origin,
                    kept: true,
                    lifted: Lifted::default(),
                }))
            }
            Err(error) if error.is_not_found() => Ok(None),
            Err(error) => {
                tracing::warn!(%error, "the store cannot be asked for a picture");
                Ok(None)
            }
        }
    }

    /// Waits for a permit as long as somebody wants the picture.
    async fn turn(&self, flight: &Flight, class: Class) -> Result<Permit, DeskError> {
        let in_turn = async {
            if class == Class::OnDemand {
                return self.queue.permit(class).await;
            }
            tokio::select! {
                permit = self.queue.permit(class) => permit,
                // Whoever joined waits as if he had opened the flight.
                () = flight.turns_urgent() => {
                    Ok(self.queue.permit_of_known(Class::OnDemand).await)
                }
            }
        };
        let permit = flight.while_wanted(async { Ok(in_turn.await) }).await?;
        permit.map_err(|Full { waiting }| DeskError::Full {
            waiting,
            retry_after: self.retry_after(waiting),
        })
    }

    async fn drawn(
        &self,
        job: &RenderJob,
        part: Option<Part>,
        flight: &Arc<Flight>,
        permit: &Arc<(Permit, Turn)>,
    ) -> Result<Picture, DrawError> {
        let attempt = || async {
            let loading = flight.while_wanted(self.pipeline.scene(job));
            let scene = self.measured("load", loading).await?;
            let held = Arc::clone(permit);
            let wanted = flight.is_wanted();
            let drawing = self.pipeline.picture(job, part, scene, wanted, held);
            let picture = self.measured("draw", drawing).await?;
            for (step, took) in picture.timings {
                let histogram = self.step_s.with_label_values(&[step]);
                histogram.observe(took.as_secs_f64());
            }
            Ok(picture)
        };
        self.pipeline.on_a_sound_device(attempt).await
    }

    async fn measured<T>(
        &self,
        operation: &'static str,
        work: impl Future<Output = Result<T, DrawError>>,
    ) -> Result<T, DrawError> {
        let running = self.red.start(operation);
        let done = work.await;
        running.done(done.as_ref().map_or_else(ended, |_there| Ended::Ok));
        done
    }

    /// Stores a picture; see [`keep`].
    pub(super) async fn keep(
        &self,
        job: &RenderJob,
        png: Bytes,
    ) -> Result<Option<Bytes>, DrawError> {
        keep(&self.store, job, png, self.pipeline.name()).await
    }

    fn note(&self, drawn: &Result<Picture, DrawError>) {
        let away = &self.is_without_device;
        match drawn {
            Ok(_picture) => away.store(false, Ordering::Release),
            Err(DrawError::Render(
                RenderError::NoAdapter
                | RenderError::UnknownAdapter { .. }
                | RenderError::AdapterGone { .. }
                | RenderError::SoftwareAdapter { .. }
                | RenderError::NoDevice { .. },
            )) => {
                away.store(true, Ordering::Release);
            }
            Err(_other) => {}
        }
    }

    fn learn(&self, took: Duration) {
        let mean = self.mean_us.load(Ordering::Relaxed);
        // An eighth of the news: one slow picture does not send everybody away.
        let next = mean - mean / 8 + took.as_micros() as u64 / 8;
        self.mean_us.store(next, Ordering::Relaxed);
    }

    /// When the queue should have moved on by itself.
    fn retry_after(&self, waiting: usize) -> Duration {
        let mean = Duration::from_micros(self.mean_us.load(Ordering::Relaxed));
        let turns = waiting / self.draws_at_once.get() + 1;
        let [shortest, longest] = RETRY_HINT;
        mean.saturating_mul(turns as u32).clamp(shortest, longest)
    }
}

/// How an operation ended that brought no picture.
fn ended(error: &DrawError) -> Ended {
    match error {
        error if error.is_not_wanted() => Ended::Dropped,
        error if error.is_bad_request() || error.is_not_found() => Ended::Refused,
        error if error.is_retryable() => Ended::Retryable,
        _ => Ended::Failed,
    }
}

/// Stores a picture drawn by an adapter, or by several workers. None: it is there now. Some: another one was there, and a
/// key has one content for ever.
pub(crate) async fn keep(
    store: &Store,
    job: &RenderJob,
    png: Bytes,
    drawn_by: &str,
) -> Result<Option<Bytes>, DrawError> {
    let key = job.key();
    match store.put_new(&key, png.clone()).await {
        Ok(_new) => Ok(None),
        Err(StorageError::Conflict { .. }) => match store.get(&key).await {
            Ok(theirs) => {
                tracing::error!(%key, drawn_by, "another adapter drew this job differently");
                Ok(Some(theirs))
            }
            Err(error @ StorageError::Damaged { .. }) => {
                tracing::warn!(%error, "a damaged picture is drawn again");
                let put = store.put_over(&key, png).await;
                put.map(|()| None)
                    .map_err(|e| picture_failed("store", &key, e))
            }
            Err(e) => Err(picture_failed("read", &key, e)),
        },
        Err(source) => Err(picture_failed("store", &key, source)),
    }
}

pub(super) fn picture_failed(
    what: &'static str,
    key: &ObjectKey,
    source: StorageError,
) -> DrawError {
    DrawError::Picture {
        what,
        key: key.clone(),
        source: Box::new(source),
    }
}
