//! A worker's desk: jobs come in from many sides, each is drawn once, kept in the store and given to all who asked.

mod drawing;
mod flight;
mod queue;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use ::service::Red;
use bytes::Bytes;
use contract::job::RenderJob;
use prometheus::{IntCounterVec, Opts, Registry};
use render::RenderError;
use storage::Store;
use tracing::Instrument as _;

use crate::error::DrawError;
use crate::gauges::Gauges;
use crate::service::RenderService;
use drawing::picture_failed;
use flight::Flights;
use queue::Queue;

pub use queue::Class;

/// Name of this service in its metrics.
pub const METRICS: &str = "render_worker";
/// What a picture is thought to take before one was drawn.
const FIRST_GUESS: Duration = Duration::from_millis(200);

/// Draws jobs for many. Cheap to clone.
#[derive(Clone)]
pub struct Desk {
    inner: Arc<Inner>,
}

struct Inner {
    service: RenderService,
    store: Store,
    queue: Arc<Queue>,
    flights: Flights,
    red: Red,
    pictures: IntCounterVec,
    /// Running mean of what a picture takes, microseconds.
    mean_us: AtomicU64,
    stopping: AtomicBool,
    /// Did a device fail that could not be opened again so far?
    is_without_device: AtomicBool,
}

/// A picture.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// PNG bytes.
    pub png: Bytes,
    /// Where it comes from.
    pub origin: Origin,
    /// Is it in the store?
    pub kept: bool,
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

impl Desk {
    /// A desk whose metrics go to `registry`; at most `draw_queue` jobs that somebody waits for are not begun.
    pub fn new(
        service: RenderService,
        store: Store,
        draw_queue: usize,
        registry: &Registry,
    ) -> Result<Self, prometheus::Error> {
        let name = format!("fluxglobe_{METRICS}_pictures_total");
        let help = "Pictures given out, by where they came from.";
        let pictures = IntCounterVec::new(Opts::new(name, help), &["origin"])?;
        registry.register(Box::new(pictures.clone()))?;
        let inner = Inner {
            store,
            queue: Queue::new(service.draws_at_once().get(), draw_queue),
            service,
            flights: Flights::default(),
            red: Red::register(registry, METRICS)?,
            pictures,
            mean_us: AtomicU64::new(FIRST_GUESS.as_micros() as u64),
            stopping: AtomicBool::new(false),
            is_without_device: AtomicBool::new(false),
        };
        let desk = Self {
            inner: Arc::new(inner),
        };
        registry.register(Box::new(Gauges::of(&desk)?))?;
        desk.service().register(registry)?;
        Ok(desk)
    }

    /// The picture of a job. Dropping the future gives it up; a picture that all have given up is not drawn on.
    pub async fn draw(&self, job: &RenderJob, class: Class) -> Result<Drawn, DeskError> {
        let inner = &self.inner;
        if class == Class::OnDemand && inner.stopping.load(Ordering::Acquire) {
            return Err(DeskError::Stopping);
        }
        let valid = job.validate().map_err(RenderError::from);
        valid.map_err(DrawError::from)?;
        let digest = job.digest();
        let (passenger, opened) = inner.flights.board(digest, class);
        if let Some(flight) = opened {
            let (desk, job) = (Arc::clone(inner), job.clone());
            let flying = async move {
                // Its own task, so that a panic lands the flight too.
                let flown = {
                    let (desk, flight) = (Arc::clone(&desk), Arc::clone(&flight));
                    let fly = async move { desk.fly(&job, &flight, class).await };
                    tokio::spawn(fly.in_current_span()).await
                };
                let outcome = flown.unwrap_or_else(|lost| Err(DrawError::Thread(lost).into()));
                desk.flights.land(&digest, &flight, outcome);
            };
            tokio::spawn(flying.in_current_span());
        }
        passenger.outcome().await
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
        if self.inner.is_without_device.load(Ordering::Acquire) {
            let service = &self.inner.service;
            service.renew(service.renderer().device_number()).await?;
            self.inner.is_without_device.store(false, Ordering::Release);
        }
        // Any answer about any key is a store that can be read.
        let probe = contract::key::ObjectKey::tile(&contract::digest::Digest::of(b"ready"));
        let asked = self.inner.store.exists(&probe).await;
        asked.map_err(|source| picture_failed("look for", &probe, source))?;
        Ok(format!("draws on {}", self.service().name()))
    }

    /// How it is.
    pub fn condition(&self) -> Condition {
        let inner = &self.inner;
        Condition {
            waiting_on_demand: inner.queue.waiting(Class::OnDemand),
            waiting_batch: inner.queue.waiting(Class::Batch),
            in_flight: inner.queue.in_use(self.draws_at_once()),
            encoding: inner.service.encoding_count(),
            stopping: inner.stopping.load(Ordering::Acquire),
        }
    }

    /// What draws.
    pub fn service(&self) -> &RenderService {
        &self.inner.service
    }

    /// Pictures drawn at the same time.
    pub(crate) fn draws_at_once(&self) -> usize {
        self.inner.service.draws_at_once().get()
    }

    pub(crate) fn red(&self) -> &Red {
        &self.inner.red
    }
}
