//! Jobs in, PNG bytes out: a source and a renderer behind one asynchronous call with bounded concurrency.

use std::num::NonZeroUsize;
use std::sync::Arc;

use bytes::Bytes;
use contract::job::RenderJob;
use storage::Store;
use tokio::sync::Semaphore;

use crate::error::RenderError;
use crate::renderer::{Backend, Renderer};
use crate::source::Source;

/// Limits of a service.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Pictures drawn at the same time.
    pub pictures: NonZeroUsize,
    /// Bytes of frames kept in memory.
    pub frame_bytes: u64,
}

impl Default for Limits {
    /// Two pictures, so that one is encoded while the next is drawn; half a GiB of frames.
    fn default() -> Self {
        Self {
            pictures: NonZeroUsize::MIN.saturating_add(1),
            frame_bytes: 512 << 20,
        }
    }
}

/// Draws jobs from a store. Cheap to clone, shared by all tasks.
#[derive(Clone)]
pub struct RenderService {
    renderer: Arc<Renderer>,
    source: Arc<Source>,
    /// One permit a picture in flight.
    permits: Arc<Semaphore>,
}

impl RenderService {
    /// Opens the backend with the default limits. Blocks while shaders compile.
    pub fn new(store: Store, backend: Backend) -> Result<Self, RenderError> {
        Self::with_limits(store, backend, Limits::default())
    }

    /// Opens the backend.
    pub fn with_limits(
        store: Store,
        backend: Backend,
        limits: Limits,
    ) -> Result<Self, RenderError> {
        let renderer = Arc::new(Renderer::new(backend)?);
        let source = Arc::new(Source::new(
            store,
            Arc::clone(&renderer),
            limits.frame_bytes,
        ));
        Ok(Self {
            renderer,
            source,
            permits: Arc::new(Semaphore::new(limits.pictures.get())),
        })
    }

    /// Name of what draws.
    pub fn name(&self) -> &str {
        self.renderer.name()
    }

    /// Draws a job; the PNG of equal jobs is equal.
    pub async fn draw(&self, job: &RenderJob) -> Result<Bytes, RenderError> {
        job.validate()?;
        let permit = Arc::clone(&self.permits).acquire_owned().await;
        let scene = self.source.scene(job).await?;
        let (renderer, job) = (Arc::clone(&self.renderer), job.clone());
        let drawing = tokio::task::spawn_blocking(move || {
            let png = renderer.render(&job, &scene)?.encode_png();
            // Held until the picture is there, also if nobody waits for it any more. It is never closed, but a
            // closed semaphore would only mean that nothing is counted.
            drop(permit);
            png
        });
        drawing.await.map_err(RenderError::Thread)?
    }
}
