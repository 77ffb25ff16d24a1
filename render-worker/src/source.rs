//! Where scenes come from: the frames that a job's manifests name, gaps filled once, kept while there is room.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::manifest::{Bracket, Manifest, ManifestId};
use contract::time::TimeMs;
use storage::{StorageError, Store};

use crate::error::RenderError;
use crate::renderer::Renderer;
use crate::scene::{Cells, Frame, Interval, Scene};

/// Manifests kept; each is a few kilobytes a step.
const MOST_MANIFESTS: usize = 64;

/// Loads scenes from a store.
pub struct Source {
    store: Store,
    /// Fills the gaps.
    renderer: Arc<Renderer>,
    most_bytes: u64,
    held: Mutex<Held>,
}

#[derive(Default)]
struct Held {
    manifests: BTreeMap<String, (Arc<Manifest>, u64)>,
    domains: BTreeMap<ObjectKey, (Arc<Cells<u32>>, u64)>,
    /// By the key of the frame and of the domain that its gaps were filled for.
    frames: BTreeMap<(ObjectKey, ObjectKey), (Arc<Frame>, u64)>,
    uses: u64,
}

impl Source {
    /// A source that keeps frames up to `most_bytes`.
    pub fn new(store: Store, renderer: Arc<Renderer>, most_bytes: u64) -> Self {
        Self {
            store,
            renderer,
            most_bytes,
            held: Mutex::default(),
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
        if let Some(frame) = self.lock().frame(&key) {
            return frame;
        }
        let zero = |cell: &u32| if *cell == 0 { f32::NAN } else { 0.0 };
        let frame = Arc::new(Frame::new(domain.content().iter().map(zero).collect()));
        self.lock().keep(key, &frame, self.most_bytes);
        frame
    }

    async fn manifest(&self, id: &ManifestId) -> Result<Arc<Manifest>, RenderError> {
        let name = id.to_string();
        if let Some(manifest) = self.lock().manifest(&name) {
            return Ok(manifest);
        }
        let loaded = storage::manifests::load(&self.store, id).await;
        let manifest = Arc::new(loaded.map_err(|e| failed("the manifest", id, e))?);
        let mut held = self.lock();
        let use_count = held.next_use();
        held.manifests
            .insert(name, (Arc::clone(&manifest), use_count));
        drop_oldest(&mut held.manifests, MOST_MANIFESTS);
        Ok(manifest)
    }

    async fn domain(&self, manifest: &Manifest) -> Result<Arc<Cells<u32>>, RenderError> {
        if let Some(domain) = self.lock().domain(&manifest.domain) {
            return Ok(domain);
        }
        let read = storage::domain::read(&self.store, &manifest.domain).await;
        let flags = read.map_err(|e| failed("the domain", &manifest.product, e))?;
        let domain = Scene::domain_of(flags);
        let mut held = self.lock();
        let use_count = held.next_use();
        held.domains
            .insert(manifest.domain.clone(), (Arc::clone(&domain), use_count));
        drop_oldest(&mut held.domains, MOST_MANIFESTS);
        Ok(domain)
    }

    async fn frame(
        &self,
        manifest: &Manifest,
        domain: &Arc<Cells<u32>>,
        step: usize,
    ) -> Result<Arc<Frame>, RenderError> {
        let key = (manifest.steps[step].frame.clone(), manifest.domain.clone());
        if let Some(frame) = self.lock().frame(&key) {
            return Ok(frame);
        }
        let read = storage::frames::read(&self.store, &key.0, &manifest.grid).await;
        let values = read.map_err(|e| failed("a frame", &manifest.product, e))?;
        let (renderer, grid, domain) = (
            Arc::clone(&self.renderer),
            manifest.grid,
            Arc::clone(domain),
        );
        let filled = tokio::task::spawn_blocking(move || fill(&renderer, &grid, values, &domain));
        let frame = Arc::new(filled.await.map_err(RenderError::Thread)??);
        self.lock().keep(key, &frame, self.most_bytes);
        Ok(frame)
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
    let raw = Frame::new(values);
    let gaps = raw.cells.content().iter().zip(domain.content());
    let has_gaps = gaps
        .into_iter()
        .any(|(value, domain)| *domain != 0 && crate::stages::layout::is_missing(*value));
    if !has_gaps || domain.content().len() != raw.cells.content().len() {
        return Ok(raw);
    }
    Ok(Frame::new(renderer.fill(
        grid,
        raw.cells.content(),
        domain.content(),
    )?))
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

fn drop_oldest<K: Ord + Clone, V>(held: &mut BTreeMap<K, (V, u64)>, most: usize) {
    while held.len() > most {
        let oldest = held
            .iter()
            .min_by_key(|(_, (_, last_use))| *last_use)
            .map(|(key, _)| key.clone());
        let Some(key) = oldest else { return };
        held.remove(&key);
    }
}

impl Held {
    fn next_use(&mut self) -> u64 {
        self.uses += 1;
        self.uses
    }

    fn manifest(&mut self, name: &str) -> Option<Arc<Manifest>> {
        let use_count = self.next_use();
        self.manifests
            .get_mut(name)
            .map(|held| touched(held, use_count))
    }

    fn domain(&mut self, key: &ObjectKey) -> Option<Arc<Cells<u32>>> {
        let use_count = self.next_use();
        self.domains
            .get_mut(key)
            .map(|held| touched(held, use_count))
    }

    fn frame(&mut self, key: &(ObjectKey, ObjectKey)) -> Option<Arc<Frame>> {
        let use_count = self.next_use();
        self.frames
            .get_mut(key)
            .map(|held| touched(held, use_count))
    }

    fn keep(&mut self, key: (ObjectKey, ObjectKey), frame: &Arc<Frame>, most_bytes: u64) {
        let use_count = self.next_use();
        self.frames.insert(key, (Arc::clone(frame), use_count));
        while self.frames.len() > 1
            && self
                .frames
                .values()
                .map(|(frame, _)| frame.size_bytes())
                .sum::<u64>()
                > most_bytes
        {
            let fewer = self.frames.len() - 1;
            drop_oldest(&mut self.frames, fewer);
        }
    }
}

fn touched<T>(held: &mut (Arc<T>, u64), use_count: u64) -> Arc<T> {
    held.1 = use_count;
    Arc::clone(&held.0)
}
