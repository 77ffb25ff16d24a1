//! Where scenes come from: the frames that a job's manifests name, gaps filled once, kept while there is room.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::manifest::{Bracket, Manifest, ManifestId};
use contract::time::TimeMs;
use storage::{StorageError, Store};

use crate::error::RenderError;
use crate::recent::Recent;
use crate::renderer::Renderer;
use crate::scene::{Cells, Frame, Interval, Scene};
use crate::stages::fill::Form;
use crate::stages::fill::scaled::holds;

/// Manifests kept; each is a few kilobytes a step.
const MOST_MANIFESTS: u64 = 64;

/// Loads scenes from a store.
pub struct Source {
    store: Store,
    /// Fills the gaps.
    renderer: Arc<Renderer>,
    most_bytes: u64,
    held: Mutex<Held>,
    frame_hits: AtomicU64,
    frame_misses: AtomicU64,
}

/// What a source keeps, and how often that helped.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Kept {
    /// Products of which frames are kept.
    pub products: BTreeSet<String>,
    /// Bytes of frames.
    pub frame_bytes: u64,
    /// Frames that were there when they were wanted.
    pub frame_hits: u64,
    /// Frames that had to be read.
    pub frame_misses: u64,
}

#[derive(Default)]
struct Held {
    manifests: Recent<String, Arc<Manifest>>,
    domains: Recent<ObjectKey, Arc<Cells<u32>>>,
    /// By the key of the frame and of the domain that its gaps were filled for.
    frames: Recent<(ObjectKey, ObjectKey), Arc<Frame>>,
}

impl Source {
    /// A source that keeps frames up to `most_bytes`.
    pub fn new(store: Store, renderer: Arc<Renderer>, most_bytes: u64) -> Self {
        Self {
            store,
            renderer,
            most_bytes,
            held: Mutex::default(),
            frame_hits: AtomicU64::new(0),
            frame_misses: AtomicU64::new(0),
        }
    }

    /// What is kept now.
    pub fn kept(&self) -> Kept {
        let held = self.lock();
        // A frame's key is `frames/PRODUCT/DIGEST`, or the domain's where accumulation starts.
        let product = |(frame, _): &(ObjectKey, ObjectKey)| {
            frame.as_str().split('/').nth(1).map(str::to_owned)
        };
        Kept {
            products: held.frames.keys().filter_map(product).collect(),
            frame_bytes: held.frames.sum(|frame| frame.size_bytes()),
            frame_hits: self.frame_hits.load(Ordering::Relaxed),
            frame_misses: self.frame_misses.load(Ordering::Relaxed),
        }
    }

    /// The scene of a job's instant.
    pub async fn scene(&self, job: &RenderJob) -> Result<Scene, RenderError> {
        let product = self.manifest(&job.product).await?;
        let domain = self.domain(&product).await?;
        let value = self.interval(&product, &domain, job.time).await?;
        let mut accumulated = None;
        if let Some(id) = &job.accumulated {
            let carbon = self.manifest(id).await?;
            if carbon.grid != product.grid {
                let (product, accumulated) = (job.product.to_string(), id.to_string());
                return Err(RenderError::GridMismatch {
                    product,
                    accumulated,
                });
            }
            let domain = self.domain(&carbon).await?;
            accumulated = Some(self.interval(&carbon, &domain, job.time).await?);
        }
        Ok(Scene {
            grid: product.grid,
            domain,
            value,
            accumulated,
        })
    }

    async fn interval(
        &self,
        manifest: &Manifest,
        domain: &Arc<Cells<u32>>,
        time: TimeMs,
    ) -> Result<Interval, RenderError> {
        let no_steps = || RenderError::NoSteps {
            product: manifest.product.to_string(),
        };
        let Bracket {
            before,
            after,
            weight,
        } = manifest.bracket(time).ok_or_else(no_steps)?;
        let after = self.frame(manifest, domain, after).await?;
        let before = match before {
            Some(step) => self.frame(manifest, domain, step).await?,
            None => self.nothing(manifest, domain),
        };
        Ok(Interval {
            before,
            after,
            weight,
        })
    }

    /// Where accumulation starts: zero in every cell of the domain.
    fn nothing(&self, manifest: &Manifest, domain: &Cells<u32>) -> Arc<Frame> {
        let key = (manifest.domain.clone(), manifest.domain.clone());
        if let Some(frame) = self.lock().frames.get(&key) {
            return frame;
        }
        let zero = |cell: &u32| if *cell == 0 { f32::NAN } else { 0.0 };
        let frame = Arc::new(Frame::new(domain.content().iter().map(zero).collect()));
        self.keep_frame(key, &frame);
        frame
    }

    async fn manifest(&self, id: &ManifestId) -> Result<Arc<Manifest>, RenderError> {
        let name = id.to_string();
        if let Some(manifest) = self.lock().manifests.get(&name) {
            return Ok(manifest);
        }
        let loaded = storage::manifests::load(&self.store, id).await;
        let manifest = Arc::new(loaded.map_err(|e| failed("the manifest", id, e))?);
        let kept = Arc::clone(&manifest);
        self.lock()
            .manifests
            .keep(name, kept, MOST_MANIFESTS, |_| 1);
        Ok(manifest)
    }

    async fn domain(&self, manifest: &Manifest) -> Result<Arc<Cells<u32>>, RenderError> {
        if let Some(domain) = self.lock().domains.get(&manifest.domain) {
            return Ok(domain);
        }
        let read = storage::domain::read(&self.store, &manifest.domain).await;
        let flags = read.map_err(|e| failed("the domain", &manifest.product, e))?;
        let domain = Scene::domain_of(flags);
        let (key, kept) = (manifest.domain.clone(), Arc::clone(&domain));
        self.lock().domains.keep(key, kept, MOST_MANIFESTS, |_| 1);
        Ok(domain)
    }

    async fn frame(
        &self,
        manifest: &Manifest,
        domain: &Arc<Cells<u32>>,
        step: usize,
    ) -> Result<Arc<Frame>, RenderError> {
        let key = (manifest.steps[step].frame.clone(), manifest.domain.clone());
        let held = self.lock().frames.get(&key);
        if let Some(frame) = held {
            self.frame_hits.fetch_add(1, Ordering::Relaxed);
            return Ok(frame);
        }
        self.frame_misses.fetch_add(1, Ordering::Relaxed);
        let read = storage::frames::read(&self.store, &key.0, &manifest.grid).await;
        let values = read.map_err(|e| failed("a frame", &manifest.product, e))?;
        let (renderer, grid, domain) = (
            Arc::clone(&self.renderer),
            manifest.grid,
            Arc::clone(domain),
        );
        let filled = tokio::task::spawn_blocking(move || fill(&renderer, &grid, values, &domain));
        let frame = Arc::new(filled.await.map_err(RenderError::Thread)??);
        self.keep_frame(key, &frame);
        Ok(frame)
    }

    fn keep_frame(&self, key: (ObjectKey, ObjectKey), frame: &Arc<Frame>) {
        let kept = Arc::clone(frame);
        self.lock()
            .frames
            .keep(key, kept, self.most_bytes, |frame| frame.size_bytes());
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Held> {
        // Maps are changed by single inserts and removals, so a poisoned lock still guards whole ones.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn fill(
    renderer: &Renderer,
    grid: &Grid,
    values: Vec<f32>,
    domain: &Cells<u32>,
) -> Result<Frame, RenderError> {
    let domain = domain.content();
    let mut gaps = values.iter().zip(domain);
    let has_gaps = gaps.any(|(value, domain)| *domain != 0 && !holds(*value));
    if !has_gaps || domain.len() != values.len() {
        return Ok(Frame::new(values));
    }
    renderer
        .fill(Form::Window, grid, &values, domain)
        .map(Frame::filled)
}

fn failed(
    what: &'static str,
    product: &impl std::fmt::Display,
    source: StorageError,
) -> RenderError {
    RenderError::Store {
        what,
        product: product.to_string(),
        source: Box::new(source),
    }
}
