//! Where scenes come from: the frames that a job names, gaps filled once, kept while there is room.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use contract::context::Relief;
use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::moment::{After, Moment};
use render::scene::{Cells, Frame, Interval, Scene, Terrain};
use render::stages::fill::Form;
use render::stages::fill::scaled::holds;
use render::{RenderError, Renderer};
use storage::{StorageError, Store};

use crate::error::DrawError;
use crate::recent::Recent;

/// Domains kept; each has four bytes a cell.
const MOST_DOMAINS: u64 = 64;
/// Early frames remembered before those that are gone are forgotten.
const MOST_EARLY: usize = 256;

/// Loads scenes from a store.
pub struct Source {
    store: Store,
    /// Fills the gaps.
    renderer: Arc<Renderer>,
    most_bytes: u64,
    held: Mutex<Held>,
    frame_hits: AtomicU64,
    frame_misses: AtomicU64,
    early_reads: AtomicU64,
    early_hits: AtomicU64,
    early_cancelled: AtomicU64,
}

/// A frame, the domain that its gaps were filled for, and the counts that say what its sums lack, if that is drawn.
type FrameKey = (ObjectKey, ObjectKey, Option<ObjectKey>);

/// Why a frame is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    /// A picture waits for it.
    Now,
    /// One may come that needs it.
    Ahead,
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
    /// Frames that were read before anybody wanted them.
    pub early_reads: u64,
    /// Those of them that were wanted then.
    pub early_hits: u64,
    /// Times that reading ahead was given up, because the view moved to another product.
    pub early_cancelled: u64,
}

#[derive(Default)]
struct Held {
    domains: Recent<ObjectKey, Arc<Cells<u32>>>,
    frames: Recent<FrameKey, Arc<Frame>>,
    /// Frames that nobody has wanted yet.
    early: BTreeSet<FrameKey>,
    /// Frames that are being read: whoever wants one too waits for it.
    reading: BTreeMap<FrameKey, Arc<tokio::sync::Mutex<()>>>,
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
            early_reads: AtomicU64::new(0),
            early_hits: AtomicU64::new(0),
            early_cancelled: AtomicU64::new(0),
        }
    }

    /// Bytes of frames that are kept at most.
    pub(crate) fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    /// Counts that reading ahead was given up.
    pub(crate) fn count_cancelled(&self) {
        self.early_cancelled.fetch_add(1, Ordering::Relaxed);
    }

    /// What is kept now.
    pub fn kept(&self) -> Kept {
        let held = self.lock();
        // A frame's key is `frames/PRODUCT/DIGEST`, or the domain's where accumulation starts.
        let product = |(frame, ..): &FrameKey| frame.as_str().split('/').nth(1).map(str::to_owned);
        Kept {
            products: held.frames.keys().filter_map(product).collect(),
            frame_bytes: held.frames.sum(|frame| frame.size_bytes()),
            frame_hits: self.frame_hits.load(Ordering::Relaxed),
            frame_misses: self.frame_misses.load(Ordering::Relaxed),
            early_reads: self.early_reads.load(Ordering::Relaxed),
            early_hits: self.early_hits.load(Ordering::Relaxed),
            early_cancelled: self.early_cancelled.load(Ordering::Relaxed),
        }
    }

    /// The scene of a job.
    pub async fn scene(&self, job: &RenderJob) -> Result<Scene, DrawError> {
        self.scene_for(job, Wanted::Now).await
    }

    /// The same before anybody wants it.
    pub(crate) async fn scene_ahead(&self, job: &RenderJob) -> Result<Scene, DrawError> {
        self.scene_for(job, Wanted::Ahead).await
    }

    async fn scene_for(&self, job: &RenderJob, wanted: Wanted) -> Result<Scene, DrawError> {
        let grid = &job.grid;
        let (domain, value) = self.interval(grid, &job.value, wanted).await?;
        let accumulated = match &job.accumulated {
            Some(carbon) => Some(self.interval(grid, carbon, wanted).await?.1),
            None => None,
        };
        let northward = match &job.flow {
            Some(flow) => Some(self.interval(grid, &flow.northward, wanted).await?.1),
            None => None,
        };
        let terrain = match &job.relief {
            Some(relief) => Some(self.terrain(relief).await?),
            None => None,
        };
        Ok(Scene {
            grid: *grid,
            domain,
            value,
            accumulated,
            terrain,
            northward,
        })
    }

    /// The frame of a relief, as it is stored: what is missing stays so.
    async fn terrain(&self, relief: &Relief) -> Result<Terrain, DrawError> {
        let grid = relief.grid;
        // No domain: its gaps are not filled.
        let key = (relief.frame.clone(), relief.frame.clone(), None);
        let held = self.lock().frames.get(&key);
        if let Some(elevation) = held {
            self.frame_hits.fetch_add(1, Ordering::Relaxed);
            // Found under its content, which says nothing of the grid of another job.
            let fits = elevation.cells.content().len() == grid.cell_count();
            let mismatch = || mismatch(&relief.frame);
            return fits
                .then_some(Terrain { grid, elevation })
                .ok_or_else(mismatch);
        }
        self.frame_misses.fetch_add(1, Ordering::Relaxed);
        let read = storage::frames::read(&self.store, &relief.frame, &grid).await;
        let values = read.map_err(|source| DrawError::Store {
            what: "the relief",
            product: relief.frame.to_string(),
            source: Box::new(source),
        })?;
        let elevation = Arc::new(Frame::new(values));
        self.lock().keep(key, &elevation, self.most_bytes);
        Ok(Terrain { grid, elevation })
    }

    /// The domain of a moment and the frames around it.
    async fn interval(
        &self,
        grid: &Grid,
        moment: &Moment,
        wanted: Wanted,
    ) -> Result<(Arc<Cells<u32>>, Interval), DrawError> {
        let domain = self.domain(grid, moment).await?;
        let counts = moment.contributed.clone().unwrap_or_default();
        let part = |frame: &ObjectKey, counts: &Option<ObjectKey>| {
            (frame.clone(), moment.domain.clone(), counts.clone())
        };
        let before = match &moment.before {
            Some(frame) => {
                let key = part(frame, &counts.before);
                self.frame(grid, &domain, key, wanted).await?
            }
            // All that is accumulated until the end of the first step is of that step.
            None => {
                self.nothing(grid, &domain, part(&moment.domain, &counts.after))
                    .await?
            }
        };
        let (after, weight) = match &moment.after {
            Some(After { frame, weight }) => {
                let key = part(frame, &counts.after);
                (self.frame(grid, &domain, key, wanted).await?, *weight)
            }
            None => (Arc::clone(&before), 0.0),
        };
        let interval = Interval {
            before,
            after,
            weight,
        };
        Ok((domain, interval))
    }

    /// Where accumulation starts: zero in every cell of the domain, which stands for the frame in the key.
    async fn nothing(
        &self,
        grid: &Grid,
        domain: &Cells<u32>,
        key: FrameKey,
    ) -> Result<Arc<Frame>, DrawError> {
        if let Some(frame) = self.lock().frames.get(&key) {
            return Ok(frame);
        }
        let zero = |cell: &u32| if *cell == 0 { f32::NAN } else { 0.0 };
        let frame = Frame::new(domain.content().iter().map(zero).collect());
        let frame = Arc::new(self.doubted(frame, grid, &key).await?);
        self.lock().keep(key, &frame, self.most_bytes);
        Ok(frame)
    }

    /// A frame with what its sums lack, if its key names counts.
    async fn doubted(
        &self,
        frame: Frame,
        grid: &Grid,
        (_, domain, counts): &FrameKey,
    ) -> Result<Frame, DrawError> {
        let Some(counts) = counts else {
            return Ok(frame);
        };
        let read = storage::contributed::read(&self.store, counts, grid).await;
        let counts = read.map_err(|e| failed("the counts of steps", domain, e))?;
        Ok(frame.with_lacking(counts.lacking()))
    }

    async fn domain(&self, grid: &Grid, moment: &Moment) -> Result<Arc<Cells<u32>>, DrawError> {
        let held = self.lock().domains.get(&moment.domain);
        let domain = if let Some(domain) = held {
            domain
        } else {
            let read = storage::domain::read(&self.store, &moment.domain).await;
            let flags = read.map_err(|e| failed("the domain", &moment.domain, e))?;
            let domain = Scene::domain_of(flags);
            let kept = Arc::clone(&domain);
            self.lock()
                .domains
                .keep(moment.domain.clone(), kept, MOST_DOMAINS, |_| 1);
            domain
        };
        // Before anything as large as the grid claims to be is laid out.
        if domain.content().len() == grid.cell_count() {
            return Ok(domain);
        }
        Err(mismatch(&moment.domain))
    }

    async fn frame(
        &self,
        grid: &Grid,
        domain: &Arc<Cells<u32>>,
        key: FrameKey,
        wanted: Wanted,
    ) -> Result<Arc<Frame>, DrawError> {
        if let Some(frame) = self.held(&key, wanted) {
            return Ok(frame);
        }
        // One reads, the others wait; if he gives up, the next one reads.
        let turn = Arc::clone(self.lock().reading.entry(key.clone()).or_default());
        let reading = turn.lock().await;
        if let Some(frame) = self.held(&key, wanted) {
            return Ok(frame);
        }
        if wanted == Wanted::Now {
            self.frame_misses.fetch_add(1, Ordering::Relaxed);
        }
        let done = self.read(grid, domain, &key).await;
        let mut held = self.lock();
        held.reading.remove(&key);
        held.forget_dropped();
        if let Ok(frame) = &done {
            if wanted == Wanted::Ahead {
                self.early_reads.fetch_add(1, Ordering::Relaxed);
                held.early.insert(key.clone());
            }
            held.keep(key, frame, self.most_bytes);
        }
        drop(held);
        drop(reading);
        done
    }

    /// The frame of a key, if it is in memory.
    fn held(&self, key: &FrameKey, wanted: Wanted) -> Option<Arc<Frame>> {
        let mut held = self.lock();
        let frame = held.frames.get(key)?;
        if wanted == Wanted::Now {
            self.frame_hits.fetch_add(1, Ordering::Relaxed);
            if held.early.remove(key) {
                self.early_hits.fetch_add(1, Ordering::Relaxed);
            }
        }
        Some(frame)
    }

    /// A frame from the store, gaps filled.
    async fn read(
        &self,
        grid: &Grid,
        domain: &Arc<Cells<u32>>,
        key: &FrameKey,
    ) -> Result<Arc<Frame>, DrawError> {
        let (frame, of_domain, _) = key;
        let read = storage::frames::read(&self.store, frame, grid).await;
        let values = read.map_err(|e| failed("a frame", of_domain, e))?;
        let (renderer, of_grid, domain) = (Arc::clone(&self.renderer), *grid, Arc::clone(domain));
        let fill = move || fill(&renderer, &of_grid, values, &domain);
        let filled = tokio::task::spawn_blocking(fill).await;
        let filled = filled.map_err(DrawError::Thread)??;
        Ok(Arc::new(self.doubted(filled, grid, key).await?))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Held> {
        // Maps are changed by single inserts and removals, so a poisoned lock still guards whole ones.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    fn keep(&mut self, key: FrameKey, frame: &Arc<Frame>, most_bytes: u64) {
        let kept = Arc::clone(frame);
        self.frames
            .keep(key, kept, most_bytes, |frame| frame.size_bytes());
    }

    /// Forgets of frames that went unwanted that they were early, and of readings that were given up.
    fn forget_dropped(&mut self) {
        self.reading.retain(|_, turn| Arc::strong_count(turn) > 1);
        if self.early.len() > MOST_EARLY {
            let there: BTreeSet<FrameKey> = self.frames.keys().cloned().collect();
            self.early.retain(|key| there.contains(key));
        }
    }
}

fn fill(
    renderer: &Renderer,
    grid: &Grid,
    values: Vec<f32>,
    domain: &Cells<u32>,
) -> Result<Frame, DrawError> {
    let domain = domain.content();
    let mut gaps = values.iter().zip(domain);
    let has_gaps = gaps.any(|(value, domain)| *domain != 0 && !holds(*value));
    if !has_gaps || domain.len() != values.len() {
        return Ok(Frame::new(values));
    }
    let filled = renderer.fill(Form::Window, grid, &values, domain)?;
    Ok(Frame::filled(filled))
}

/// What is stored does not lie on the grid of the job.
fn mismatch(key: &ObjectKey) -> DrawError {
    let mismatch = RenderError::GridMismatch {
        product: "the job".to_owned(),
        accumulated: key.to_string(),
    };
    mismatch.into()
}

/// Named by the product, which a domain's folder is called after.
fn failed(what: &'static str, domain: &ObjectKey, source: StorageError) -> DrawError {
    let product = domain.as_str().split('/').nth(1).unwrap_or_default();
    DrawError::Store {
        what,
        product: product.to_owned(),
        source: Box::new(source),
    }
}
