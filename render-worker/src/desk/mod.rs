//! The one way from a job to its picture, for a worker of a cluster and for a server that draws in its own process: jobs
//! come in from many sides, each is drawn once, in turn, kept in the store and given to all who asked.

mod drawing;
mod gauges;
mod order;
mod queue;
mod single_flight;
mod write_behind;

use std::any::Any;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use ::service::Red;
use bytes::Bytes;
use contract::job::RenderJob;
use prometheus::{Histogram, HistogramOpts, HistogramVec, IntCounterVec, Opts, Registry};
use render::{Backend, RenderError};
use storage::Store;
use tracing::Instrument as _;

use crate::adapter_info::AdapterInfo;
use crate::annotation::Lifted;
use crate::error::DrawError;
use crate::pipeline::{Limits, Pipeline};
pub(crate) use drawing::keep;
use drawing::picture_failed;
use gauges::Gauges;
use queue::Queue;
use single_flight::SingleFlight;
use write_behind::WriteBehind;

pub use order::{Order, Storing};
pub use queue::Class;

/// Name of this service in its metrics.
pub const METRICS: &str = "render_worker";
/// What a picture is thought to take before one was drawn.
const FIRST_GUESS: Duration = Duration::from_millis(200);

/// Bounds of times that jobs wait or are stored, seconds: from nothing to a store that is nearly away.
const BOUNDS_S: [f64; 12] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0,
];

/// Draws jobs for many. Cheap to clone.
#[derive(Clone)]
pub struct Desk {
    inner: Arc<Inner>,
}

struct Inner {
    pipeline: Pipeline,
    store: Store,
    draws_at_once: NonZeroUsize,
    queue: Arc<Queue>,
    flights: SingleFlight,
    red: Red,
    pictures: IntCounterVec,
    /// How long jobs wait for a permit to draw.
    wait_s: Histogram,
    /// How long the steps of drawing take.
    step_s: HistogramVec,
    writes: WriteBehind,
    /// Running mean of what a picture takes, microseconds.
    mean_us: AtomicU64,
    stopping: AtomicBool,
    /// Did a device fail that could not be opened again so far?
    is_without_device: AtomicBool,
}

/// A picture.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// In the encoding that was ordered.
    pub bytes: Bytes,
    /// Where it comes from.
    pub origin: Origin,
    /// Is it in the store? One that somebody waits for and that is stored behind his back is not, yet.
    pub kept: bool,
    /// Of a part: how far columns of the whole picture go, where it has a height bar.
    pub lifted: Lifted,
}

/// Where a picture comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// Drawn now.
    Drawn,
    /// Found in the store.
    Stored,
}

/// How a desk is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Condition {
    /// Jobs that somebody waits for and that are not begun.
    pub waiting_on_demand: usize,
    /// Jobs of the batch that are not begun.
    pub waiting_batch: usize,
    /// Jobs that are drawn.
    pub in_flight: usize,
    /// Pictures that are encoded.
    pub encoding: usize,
    /// Is nothing new taken?
    pub stopping: bool,
}

/// Why there is no picture; clones go to all who asked.
#[derive(Debug, Clone, thiserror::Error)]
pub enum DeskError {
    /// Too many wait.
    #[error("{waiting} jobs wait already; ask again in {} ms or ask another worker", retry_after.as_millis())]
    Full {
        waiting: usize,
        retry_after: Duration,
    },
    /// The worker takes nothing new.
    #[error("the worker is stopping; ask another one")]
    Stopping,
    /// It could not be drawn.
    #[error(transparent)]
    Render(Arc<DrawError>),
}

impl DeskError {
    /// May the same job succeed later, or elsewhere?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Full { .. } | Self::Stopping => true,
            Self::Render(error) => error.is_retryable(),
        }
    }
}

impl From<DrawError> for DeskError {
    fn from(error: DrawError) -> Self {
        Self::Render(Arc::new(error))
    }
}

/// A desk that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// No renderer.
    #[error(transparent)]
    Render(#[from] DrawError),
    /// Two metrics of one name.
    #[error("a metric cannot be registered")]
    Metrics(#[from] prometheus::Error),
}

impl OpenError {
    /// May the same succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Render(error) => error.is_retryable(),
            Self::Metrics(_) => false,
        }
    }
}

/// A time of jobs, seconds.
fn timed(what: &str, help: &str) -> Result<Histogram, prometheus::Error> {
    Histogram::with_opts(timed_as(what, help))
}

fn timed_as(what: &str, help: &str) -> HistogramOpts {
    let name = format!("fluxglobe_{METRICS}_{what}");
    HistogramOpts::new(name, help).buckets(BOUNDS_S.to_vec())
}

/// What a caller holds who gives out turns to draw as well.
type Turn = Box<dyn Any + Send + Sync>;

impl Desk {
    /// Opens the backend and a desk before it, whose metrics go to `registry`. Blocks while shaders compile.
    pub fn open(
        store: Store,
        backend: Backend,
        limits: &Limits,
        registry: &Registry,
    ) -> Result<Self, OpenError> {
        let pipeline = Pipeline::open(store.clone(), backend, limits)?;
        let suited = || pipeline.renderer().draws_at_once();
        let draws_at_once = limits.draws_at_once.unwrap_or_else(suited);
        let name = format!("fluxglobe_{METRICS}_pictures_total");
        let help = "Pictures given out, by where they came from.";
        let pictures = IntCounterVec::new(Opts::new(name, help), &["origin"])?;
        registry.register(Box::new(pictures.clone()))?;
        registry.register(Box::new(AdapterInfo::of(&pipeline)?))?;
        let wait_s = timed("wait_seconds", "Time that jobs wait for a permit to draw.")?;
        registry.register(Box::new(wait_s.clone()))?;
        let step_s = HistogramVec::new(
            timed_as(
                "draw_step_seconds",
                "Time of the steps of drawing: plan, mask, upload, device, read_back.",
            ),
            &["step"],
        )?;
        registry.register(Box::new(step_s.clone()))?;
        let store_s = timed("store_seconds", "Time to put a picture into the store.")?;
        registry.register(Box::new(store_s.clone()))?;
        let inner = Inner {
            store,
            queue: Queue::new(draws_at_once.get(), limits.draw_queue),
            draws_at_once,
            pipeline,
            flights: SingleFlight::default(),
            red: Red::register(registry, METRICS)?,
            pictures,
            wait_s,
            step_s,
            writes: WriteBehind::new(store_s),
            mean_us: AtomicU64::new(FIRST_GUESS.as_micros() as u64),
            stopping: AtomicBool::new(false),
            is_without_device: AtomicBool::new(false),
        };
        let desk = Self {
            inner: Arc::new(inner),
        };
        registry.register(Box::new(Gauges::of(&desk)?))?;
        Ok(desk)
    }

    /// The picture of a job. Dropping the future gives it up; a picture that all have given up is not drawn on. Whoever
    /// joins an equal job under way has the picture of that one, and has it kept if that one did not.
    pub async fn draw(&self, job: &RenderJob, order: Order) -> Result<Drawn, DeskError> {
        self.draw_in_turn(job, order, ()).await
    }

    /// The same for a caller who gives out turns as well: his is let go with the desk's own, when the picture is drawn
    /// and its encoding begins.
    pub async fn draw_in_turn(
        &self,
        job: &RenderJob,
        order: Order,
        turn: impl Send + Sync + 'static,
    ) -> Result<Drawn, DeskError> {
        let inner = &self.inner;
        if order.class == Class::OnDemand && inner.stopping.load(Ordering::Acquire) {
            return Err(DeskError::Stopping);
        }
        let valid = job.validate().map_err(RenderError::from);
        valid.map_err(DrawError::from)?;
        let digest = job.digest();
        let order = order.encoded(order.encoding);
        let flown = (digest, order.encoding, order.part);
        let (waiter, begun) = inner.flights.join(flown, order.class);
        let has_joined = begun.is_none();
        if let Some(flight) = begun {
            let (desk, job, turn) = (Arc::clone(inner), job.clone(), Box::new(turn) as Turn);
            let flying = async move {
                // Its own task, so that a panic completes the flight too.
                let drawn = {
                    let (desk, flight) = (Arc::clone(&desk), Arc::clone(&flight));
                    let make = async move { desk.make(&job, &flight, order, turn).await };
                    tokio::spawn(make.in_current_span()).await
                };
                let outcome = drawn.unwrap_or_else(|lost| Err(DrawError::Thread(lost).into()));
                desk.flights.complete(&flown, &flight, outcome);
            };
            tokio::spawn(flying.in_current_span());
        }
        let drawn = waiter.outcome().await?;
        if has_joined && !drawn.kept && order.storing != Storing::Nothing {
            return Ok(inner.kept_after_all(job, drawn, order).await);
        }
        Ok(drawn)
    }

    /// Puts a picture into the store; done already is done.
    pub async fn keep(&self, job: &RenderJob, png: Bytes) -> Result<(), DrawError> {
        self.inner.keep(job, png).await.map(|_theirs| ())
    }

    /// Takes nothing new from those who wait; what is under way goes on.
    pub fn stop(&self) {
        self.inner.stopping.store(true, Ordering::Release);
    }

    /// Can pictures be drawn now? What there is, for operators.
    pub async fn ready(&self) -> Result<String, DrawError> {
        // Nobody brings jobs to a worker that is not ready, so it tries by itself to become so.
        let pipeline = &self.inner.pipeline;
        let is_without = self.inner.is_without_device.load(Ordering::Acquire);
        if is_without || pipeline.renderer().has_fault() {
            pipeline.renew().await?;
            self.inner.is_without_device.store(false, Ordering::Release);
        }
        // Any answer about any key is a store that can be read.
        let probe = contract::key::ObjectKey::tile(&contract::digest::Digest::of(b"ready"));
        let asked = self.inner.store.exists(&probe).await;
        asked.map_err(|source| picture_failed("look for", &probe, source))?;
        Ok(format!("draws on {}", self.pipeline().name()))
    }

    /// Returns when pictures that were given out before they were stored are stored.
    pub async fn settled(&self) {
        self.inner.writes.settled().await;
    }

    /// How it is.
    pub fn condition(&self) -> Condition {
        let inner = &self.inner;
        Condition {
            waiting_on_demand: inner.queue.waiting(Class::OnDemand),
            waiting_batch: inner.queue.waiting(Class::Batch),
            in_flight: inner.queue.in_use(inner.draws_at_once.get()),
            encoding: inner.pipeline.encoding_count(),
            stopping: inner.stopping.load(Ordering::Acquire),
        }
    }

    /// What takes the steps of its pictures.
    pub fn pipeline(&self) -> &Pipeline {
        &self.inner.pipeline
    }

    /// Pictures drawn at the same time.
    pub fn draws_at_once(&self) -> NonZeroUsize {
        self.inner.draws_at_once
    }

    pub(crate) fn red(&self) -> &Red {
        &self.inner.red
    }
}
