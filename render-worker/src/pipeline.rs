//! The steps of one picture: fields loaded and filled, drawn on a sound device, encoded.
//!
//! A step knows nothing of who asks, in which order, or what is stored: that is the business of the [`desk`](crate::desk).

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use contract::encoding::Encoding;
use contract::job::RenderJob;
use render::plan::Part;
use render::scene::Scene;
use render::{Backend, Image, Renderer, timings};
use storage::Store;

use crate::annotation::Lifted;
use crate::encoding::Encoders;
use crate::error::DrawError;
use crate::large::MOST_WHOLE_CELLS;
use crate::prefetch::Prefetch;
use crate::source::{Kept, Source};

/// What one worker takes on.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Pictures drawn at the same time; none named is what suits the adapter. Those that are encoded do not count.
    pub draws_at_once: Option<NonZeroUsize>,
    /// Jobs that somebody waits for and that are not begun; more are sent away.
    pub draw_queue: usize,
    /// Bytes of fields kept in memory; see [`Source::new`] for fields larger than half of them.
    pub field_bytes: u64,
    /// Bytes of fields kept on the device; none named is a share of what the device has.
    pub device_field_bytes: Option<u64>,
    /// Fields of every product read ahead of the one drawn; none with 0.
    pub fields_ahead: usize,
    /// Fields of more cells are not held whole: what pictures show of them is read by windows of their levels.
    pub whole_cells: u64,
}

impl Default for Limits {
    /// As many pictures as suit the adapter; half a GiB of fields, the next one of them.
    fn default() -> Self {
        Self {
            draws_at_once: None,
            draw_queue: 256,
            field_bytes: 512 << 20,
            device_field_bytes: None,
            fields_ahead: 1,
            whole_cells: MOST_WHOLE_CELLS,
        }
    }
}

/// Asked between the parts of a picture: does anybody still want it?
pub type IsWanted = Arc<dyn Fn() -> bool + Send + Sync>;

/// Takes the steps of any number of pictures. Cheap to clone, shared by all tasks.
#[derive(Clone)]
pub struct Pipeline {
    renderer: Arc<Renderer>,
    source: Arc<Source>,
    prefetch: Arc<Prefetch>,
    encoders: Encoders,
}

/// A picture as it is drawn.
#[derive(Debug)]
pub struct Picture {
    /// Its pixels.
    pub image: Image,
    /// How far its columns go, where it has a height bar.
    pub lifted: Lifted,
    /// How long the steps took.
    pub timings: Timings,
}

/// Steps of drawing by name, and how long each took.
type Timings = [(&'static str, Duration); 5];

impl Pipeline {
    /// Opens the backend. Blocks while shaders compile.
    pub fn open(store: Store, backend: Backend, limits: &Limits) -> Result<Self, DrawError> {
        let renderer = Arc::new(Renderer::keeping(backend, limits.device_field_bytes)?);
        let source = Source::new(store.clone(), Arc::clone(&renderer), limits.field_bytes);
        let source = Arc::new(source.holding_whole(limits.whole_cells));
        let prefetch = Arc::new(Prefetch::new(
            store,
            Arc::clone(&source),
            Arc::clone(&renderer),
            limits.fields_ahead,
        ));
        Ok(Self {
            renderer,
            source,
            prefetch,
            encoders: Encoders::on_all_cores(),
        })
    }

    /// Pictures that are encoded now.
    pub fn encoding_count(&self) -> usize {
        self.encoders.busy()
    }

    /// Name of what draws.
    pub fn name(&self) -> &str {
        self.renderer.name()
    }

    /// What draws.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Fields in memory.
    pub fn kept(&self) -> Kept {
        self.source.kept()
    }

    /// Loads what a valid job is drawn from.
    pub async fn scene(&self, job: &RenderJob) -> Result<Scene, DrawError> {
        self.source.scene(job).await
    }

    /// Draws a loaded scene, or a part of its picture; `held` is let go when the drawing thread has ended, also if nobody
    /// waits for it.
    pub async fn picture(
        &self,
        job: &RenderJob,
        part: Option<Part>,
        scene: Scene,
        is_wanted: IsWanted,
        held: impl Send + 'static,
    ) -> Result<Picture, DrawError> {
        let (renderer, own) = (Arc::clone(&self.renderer), job.clone());
        let drawing = tokio::task::spawn_blocking(move || {
            let image = renderer.render_part(&own, &scene, part, &*is_wanted);
            let lifted = Lifted::of(&own, &scene);
            drop(held);
            // Also what a picture took that was not wanted any more: it is not the next one's.
            let timings = timings::taken();
            image.map(|image| Picture {
                image,
                lifted,
                timings,
            })
        });
        let drawn = drawing.await.map_err(DrawError::Thread)??;
        // Not before: what is wanted now goes first.
        self.prefetch.drawn(job);
        Ok(drawn)
    }

    /// Encodes a picture, with the annotations of a job over it if one is given, whose columns go so far; `turn` is let go when that begins, which
    /// may have to wait for a core.
    pub async fn encode(
        &self,
        annotated: Option<(RenderJob, Lifted)>,
        image: Image,
        encoding: Encoding,
        turn: impl Send + 'static,
    ) -> Result<Bytes, DrawError> {
        self.encoders.encode(annotated, image, encoding, turn).await
    }

    /// Tries, and if the device failed tries once more on a fresh one.
    pub async fn on_a_sound_device<T, F>(&self, attempt: impl Fn() -> F) -> Result<T, DrawError>
    where
        F: Future<Output = Result<T, DrawError>>,
    {
        match attempt().await {
            Err(error) if error.is_device_fault() => {
                tracing::warn!(error = error.in_full(), "drawing again on a fresh device");
                self.renew().await?;
                attempt().await
            }
            done => done,
        }
    }

    /// Opens fresh devices in place of those that failed; see [`Renderer::renew`].
    pub async fn renew(&self) -> Result<(), DrawError> {
        let renderer = Arc::clone(&self.renderer);
        let renewing = tokio::task::spawn_blocking(move || renderer.renew());
        Ok(renewing.await.map_err(DrawError::Thread)??)
    }
}
