//! Jobs in, PNG bytes out: a source and a renderer behind one asynchronous call with bounded concurrency.
//!
//! A picture has a turn to be drawn and then a core to be encoded on: turns are as many as suit the device, cores as many
//! as there are, and no turn is held while a picture is encoded.

use std::num::NonZeroUsize;
use std::sync::Arc;

use bytes::Bytes;
use contract::job::RenderJob;
use render::scene::Scene;
use render::{Backend, Image, RenderError, Renderer};
use storage::Store;
use tokio::sync::Semaphore;

use crate::encoding::Encoders;
use crate::error::DrawError;
use crate::prefetch::Prefetch;
use crate::source::{Kept, Source};

/// Limits of a service.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Pictures drawn at the same time; none named is what suits the adapter. Those that are encoded do not count.
    pub draws_at_once: Option<NonZeroUsize>,
    /// Bytes of frames kept in memory.
    pub frame_bytes: u64,
    /// Bytes of frames kept on the device; none named is a share of what the device has.
    pub device_frame_bytes: Option<u64>,
    /// Frames of every product read ahead of the one drawn; none with 0.
    pub frames_ahead: usize,
}

impl Default for Limits {
    /// As many pictures as suit the adapter; half a GiB of frames, the next one of them.
    fn default() -> Self {
        Self {
            draws_at_once: None,
            frame_bytes: 512 << 20,
            device_frame_bytes: None,
            frames_ahead: 1,
        }
    }
}

/// Asked between the parts of a picture: does anybody still want it?
pub type IsWanted = Arc<dyn Fn() -> bool + Send + Sync>;

/// Draws jobs from a store. Cheap to clone, shared by all tasks.
#[derive(Clone)]
pub struct RenderService {
    renderer: Arc<Renderer>,
    source: Arc<Source>,
    prefetch: Arc<Prefetch>,
    draws_at_once: NonZeroUsize,
    /// One permit a picture that is drawn.
    turns: Arc<Semaphore>,
    encoders: Encoders,
}

impl RenderService {
    /// Opens the backend with the default limits. Blocks while shaders compile.
    pub fn new(store: Store, backend: Backend) -> Result<Self, DrawError> {
        Self::with_limits(store, backend, Limits::default())
    }

    /// Opens the backend.
    pub fn with_limits(store: Store, backend: Backend, limits: Limits) -> Result<Self, DrawError> {
        let renderer = Arc::new(Renderer::keeping(backend, limits.device_frame_bytes)?);
        let source = Arc::new(Source::new(
            store.clone(),
            Arc::clone(&renderer),
            limits.frame_bytes,
        ));
        let prefetch = Arc::new(Prefetch::new(
            store,
            Arc::clone(&source),
            Arc::clone(&renderer),
            limits.frames_ahead,
        ));
        let suited = || renderer.adapter().draws_at_once();
        let draws_at_once = limits.draws_at_once.unwrap_or_else(suited);
        Ok(Self {
            renderer,
            source,
            prefetch,
            draws_at_once,
            turns: Arc::new(Semaphore::new(draws_at_once.get())),
            encoders: Encoders::on_all_cores(),
        })
    }

    /// Pictures drawn at the same time.
    pub fn draws_at_once(&self) -> NonZeroUsize {
        self.draws_at_once
    }

    /// Pictures that are encoded now.
    pub fn encoding_count(&self) -> usize {
        self.encoders.busy()
    }

    /// Tells in the metrics what it draws on.
    pub fn register(&self, registry: &prometheus::Registry) -> Result<(), prometheus::Error> {
        registry.register(Box::new(crate::gauges::AdapterInfo::of(self)?))
    }

    /// Name of what draws.
    pub fn name(&self) -> &str {
        self.renderer.name()
    }

    /// What draws.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Frames in memory.
    pub fn kept(&self) -> Kept {
        self.source.kept()
    }

    /// Draws a job; the PNG of equal jobs is equal. A job that the device fails at is drawn on a fresh one, once.
    pub async fn draw(&self, job: &RenderJob) -> Result<Bytes, DrawError> {
        self.draw_in_turn(job, ()).await
    }

    /// The same for a caller who gives out turns as well: his is let go when the picture is drawn and its encoding begins.
    pub async fn draw_in_turn(
        &self,
        job: &RenderJob,
        turn: impl Send + Sync + 'static,
    ) -> Result<Bytes, DrawError> {
        job.validate().map_err(RenderError::from)?;
        // It is never closed, but a closed semaphore would only mean that nothing is counted.
        let own = Arc::clone(&self.turns).acquire_owned().await;
        let turns = Arc::new((own, turn));
        let attempt = || async {
            let scene = self.scene(job).await?;
            let wanted: IsWanted = Arc::new(|| true);
            let held = Arc::clone(&turns);
            self.picture(job, scene, wanted, held).await
        };
        let image = self.on_a_sound_device(attempt).await?;
        self.encode(image, turns).await
    }

    /// Loads what a job is drawn from.
    pub async fn scene(&self, job: &RenderJob) -> Result<Scene, DrawError> {
        self.source.scene(job).await
    }

    /// Draws a loaded scene; `held` is let go when the drawing thread has ended, also if nobody waits for it.
    pub async fn picture(
        &self,
        job: &RenderJob,
        scene: Scene,
        is_wanted: IsWanted,
        held: impl Send + 'static,
    ) -> Result<Image, DrawError> {
        let (renderer, own) = (Arc::clone(&self.renderer), job.clone());
        let drawing = tokio::task::spawn_blocking(move || {
            let image = renderer.render_while(&own, &scene, &*is_wanted);
            drop(held);
            image
        });
        let image = drawing.await.map_err(DrawError::Thread)??;
        // Not before: what is wanted now goes first.
        self.prefetch.drawn(job);
        Ok(image)
    }

    /// Writes a picture as PNG; `turn` is let go when that begins, which may have to wait for a core.
    pub async fn encode(
        &self,
        image: Image,
        turn: impl Send + 'static,
    ) -> Result<Bytes, DrawError> {
        self.encoders.png(image, turn).await
    }

    /// Tries, and if the device failed tries once more on a fresh one.
    pub async fn on_a_sound_device<T, F>(&self, attempt: impl Fn() -> F) -> Result<T, DrawError>
    where
        F: Future<Output = Result<T, DrawError>>,
    {
        let number = self.renderer.device_number();
        match attempt().await {
            Err(error) if error.is_device_fault() => {
                tracing::warn!(error = error.in_full(), "drawing again on a fresh device");
                self.renew(number).await?;
                attempt().await
            }
            done => done,
        }
    }

    /// Opens a fresh device in place of the one of this number; see [`Renderer::renew`].
    pub async fn renew(&self, failed_number: u64) -> Result<(), DrawError> {
        let renderer = Arc::clone(&self.renderer);
        let renewing = tokio::task::spawn_blocking(move || renderer.renew(failed_number));
        Ok(renewing.await.map_err(DrawError::Thread)??)
    }
}
