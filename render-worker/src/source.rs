//! Where scenes come from: the frames that a job names, gaps filled once, kept while there is room.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::moment::Moment;
use storage::{StorageError, Store};

use crate::error::RenderError;
use crate::recent::Recent;
use crate::renderer::Renderer;
use crate::scene::{Cells, Frame, Interval, Scene};
use crate::stages::fill::Form;
use crate::stages::fill::scaled::holds;

/// Domains kept; each has four bytes a cell.
const MOST_DOMAINS: u64 = 64;

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

    /// The scene of a job.
    pub async fn scene(&self, job: &RenderJob) -> Result<Scene, RenderError> {
        let grid = &job.grid;
        let (domain, value) = self.interval(grid, &job.value).await?;
        let accumulated = match &job.accumulated {
            Some(carbon) => Some(self.interval(grid, carbon).await?.1),
            None => None,
        };
        let northward = match &job.flow {
            Some(flow) => Some(self.interval(grid, &flow.northward).await?.1),
            None => None,
        };
        Ok(Scene {
            grid: *grid,
            domain,
            value,
            accumulated,
            northward,
        })
    }

    /// The domain of a moment and the frames around it.
    async fn interval(
        &self,
        grid: &Grid,
        moment: &Moment,
    ) -> Result<(Arc<Cells<u32>>, Interval), RenderError> {
        let domain = self.domain(grid, moment).await?;
        let before = match &moment.before {
            Some(frame) => self.frame(grid, moment, &domain, frame).await?,
            None => self.nothing(moment, &domain),
        };
        let (after, weight) = match &moment.after {
            Some(after) => (
                self.frame(grid, moment, &domain, &after.frame).await?,
                after.weight,
            ),
            None => (Arc::clone(&before), 0.0),
        };
        let interval = Interval {
            before,
            after,
            weight,
        };
        Ok((domain, interval))
    }

    /// Where accumulation starts: zero in every cell of the domain.
    fn nothing(&self, moment: &Moment, domain: &Cells<u32>) -> Arc<Frame> {
        let key = (moment.domain.clone(), moment.domain.clone());
        if let Some(frame) = self.lock().frames.get(&key) {
            return frame;
        }
        let zero = |cell: &u32| if *cell == 0 { f32::NAN } else { 0.0 };
        let frame = Arc::new(Frame::new(domain.content().iter().map(zero).collect()));
        self.keep_frame(key, &frame);
        frame
    }

    async fn domain(&self, grid: &Grid, moment: &Moment) -> Result<Arc<Cells<u32>>, RenderError> {
        let held = self.lock().domains.get(&moment.domain);
        let domain = if let Some(domain) = held {
            domain
        } else {
            let read = storage::domain::read(&self.store, &moment.domain).await;
            let flags = read.map_err(|e| failed("the domain", moment, e))?;
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
        Err(RenderError::GridMismatch {
            product: "the job".to_owned(),
            accumulated: moment.domain.to_string(),
        })
    }

    async fn frame(
        &self,
        grid: &Grid,
        moment: &Moment,
        domain: &Arc<Cells<u32>>,
        frame: &ObjectKey,
    ) -> Result<Arc<Frame>, RenderError> {
        let key = (frame.clone(), moment.domain.clone());
        let held = self.lock().frames.get(&key);
        if let Some(frame) = held {
            self.frame_hits.fetch_add(1, Ordering::Relaxed);
            return Ok(frame);
        }
        self.frame_misses.fetch_add(1, Ordering::Relaxed);
        let read = storage::frames::read(&self.store, frame, grid).await;
        let values = read.map_err(|e| failed("a frame", moment, e))?;
        let (renderer, grid, domain) = (Arc::clone(&self.renderer), *grid, Arc::clone(domain));
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

fn failed(what: &'static str, moment: &Moment, source: StorageError) -> RenderError {
    RenderError::Store {
        what,
        product: moment.product().to_owned(),
        source: Box::new(source),
    }
}
