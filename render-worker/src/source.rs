//! Where scenes come from: the fields that a job names, gaps filled once, kept while there is room.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use contract::context::Relief;
use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::time_sample::{After, TimeSample};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use render::Renderer;
use render::field_cache::field_cache;
use render::scene::{Cells, Field, Interval, Scene, Terrain};
use render::stages::fill::Form;
use render::stages::fill::scaled::holds;
use storage::{StorageError, Store};

use crate::error::DrawError;
use crate::large::{Large, MOST_WHOLE_CELLS};
use crate::unfilled::Gaps;

/// Domains kept; each has four bytes a cell.
const MOST_DOMAINS: usize = 64;

/// Loads scenes from a store.
pub struct Source {
    store: Store,
    /// Fills the gaps.
    renderer: Arc<Renderer>,
    most_bytes: u64,
    domains: Cache<ObjectKey, Arc<Cells<u32>>>,
    /// Draws what is not held whole.
    large: Large,
    /// Fields of more cells are not.
    most_whole_cells: u64,
    /// One reads a field, others who want it wait; if he gives up, the next one reads.
    fields: Cache<FieldKey, Held, ByBytes>,
    field_hits: AtomicU64,
    field_misses: AtomicU64,
    early_reads: AtomicU64,
    early_hits: AtomicU64,
    early_cancelled: AtomicU64,
}

/// A field, the domain that its gaps were filled for, the counts that say what its sums lack, if that is drawn, and what became of its gaps.
type FieldKey = (ObjectKey, ObjectKey, Option<ObjectKey>, Gaps);

/// A field in memory.
#[derive(Clone)]
struct Held {
    field: Arc<Field>,
    /// Its size, which must not change while it is here.
    bytes: u64,
    /// Nobody has wanted it yet.
    is_early: Arc<AtomicBool>,
}

/// The weight of a field is its size. One of more than half of all room weighs a half: the cache would turn it away, and a
/// picture lies between two.
#[derive(Clone)]
struct ByBytes {
    most_bytes: u64,
}

impl Weighter<FieldKey, Held> for ByBytes {
    fn weight(&self, _key: &FieldKey, held: &Held) -> u64 {
        if held.bytes <= self.most_bytes {
            held.bytes.min(self.most_bytes / 2)
        } else {
            held.bytes
        }
    }
}

/// Why a field is read.
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
    /// Products of which fields are kept.
    pub products: BTreeSet<String>,
    /// Bytes of fields.
    pub field_bytes: u64,
    /// Fields that were there when they were wanted.
    pub field_hits: u64,
    /// Fields that had to be read.
    pub field_misses: u64,
    /// Fields that were read before anybody wanted them.
    pub early_reads: u64,
    /// Those of them that were wanted then.
    pub early_hits: u64,
    /// Times that reading ahead was given up, because the view moved to another product.
    pub early_cancelled: u64,
}

impl Held {
    fn new(field: Field, wanted: Wanted) -> Self {
        Self {
            bytes: field.size_bytes(),
            field: Arc::new(field),
            is_early: Arc::new(AtomicBool::new(wanted == Wanted::Ahead)),
        }
    }
}

impl Source {
    /// A source that keeps fields up to `most_bytes`, or two that are each larger than half of that and not larger than it.
    pub fn new(store: Store, renderer: Arc<Renderer>, most_bytes: u64) -> Self {
        Self {
            large: Large::new(store.clone(), Arc::clone(&renderer)),
            most_whole_cells: MOST_WHOLE_CELLS,
            store,
            renderer,
            most_bytes,
            domains: Cache::new(MOST_DOMAINS),
            fields: field_cache(most_bytes, ByBytes { most_bytes }),
            field_hits: AtomicU64::new(0),
            field_misses: AtomicU64::new(0),
            early_reads: AtomicU64::new(0),
            early_hits: AtomicU64::new(0),
            early_cancelled: AtomicU64::new(0),
        }
    }

    /// The same with fields of more than so many cells not held whole.
    #[must_use]
    pub fn holding_whole(mut self, most_whole_cells: u64) -> Self {
        self.most_whole_cells = most_whole_cells;
        self
    }

    /// Is a field of this grid held whole?
    pub(crate) fn is_held_whole(&self, grid: &Grid) -> bool {
        grid.cell_count() as u64 <= self.most_whole_cells
    }

    /// Bytes of fields that are kept at most.
    pub(crate) fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    /// Counts that reading ahead was given up.
    pub(crate) fn count_cancelled(&self) {
        self.early_cancelled.fetch_add(1, Ordering::Relaxed);
    }

    /// What is kept now.
    pub fn kept(&self) -> Kept {
        // A field's key is `frames/PRODUCT/DIGEST`, or the domain's where accumulation starts.
        let product = |((field, ..), _): (FieldKey, Held)| {
            field.as_str().split('/').nth(1).map(str::to_owned)
        };
        Kept {
            products: self.fields.iter().filter_map(product).collect(),
            field_bytes: self.fields.iter().map(|(_, held)| held.bytes).sum(),
            field_hits: self.field_hits.load(Ordering::Relaxed),
            field_misses: self.field_misses.load(Ordering::Relaxed),
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
        // Boxed, as are its parts: a job is large, and whoever waits for a scene would carry it.
        let scene = Box::pin(self.scene_alone(job, wanted)).await?;
        let Some(alone) = job.trails_alone().map(Box::new) else {
            return Ok(scene);
        };
        let vector = Box::pin(self.scene_alone(&alone, wanted)).await?;
        Ok(Scene {
            trails: Some(Arc::new(vector)),
            ..scene
        })
    }

    /// The scene of a job without its trails.
    async fn scene_alone(&self, job: &RenderJob, wanted: Wanted) -> Result<Scene, DrawError> {
        let grid = &job.grid;
        if !self.is_held_whole(grid) {
            let terrain = self.any_terrain(job.relief.as_ref()).await?;
            return Box::pin(self.large.scene(job, terrain)).await;
        }
        let other = |sample| self.other_interval(grid, sample, wanted);
        let northward = job.flow.as_ref().map(|flow| &flow.northward);
        // All at once: a store that is far away is waited for once.
        let ((domain, value), accumulated, northward, terrain) = tokio::try_join!(
            self.interval(grid, (&job.value, Gaps::of(job)), wanted),
            other(job.accumulated.as_ref()),
            other(northward),
            self.any_terrain(job.relief.as_ref()),
        )?;
        Ok(Scene {
            grid: *grid,
            domain,
            value,
            accumulated,
            terrain,
            northward,
            trails: None,
            whole: None,
        })
    }

    /// The fields around a sample, if there is one.
    async fn other_interval(
        &self,
        grid: &Grid,
        sample: Option<&TimeSample>,
        wanted: Wanted,
    ) -> Result<Option<Interval>, DrawError> {
        let Some(sample) = sample else {
            return Ok(None);
        };
        let (_domain, interval) = self.interval(grid, (sample, Gaps::Filled), wanted).await?;
        Ok(Some(interval))
    }

    async fn any_terrain(&self, relief: Option<&Relief>) -> Result<Option<Terrain>, DrawError> {
        match relief {
            Some(relief) => self.terrain(relief).await.map(Some),
            None => Ok(None),
        }
    }

    /// The field of a relief, as it is stored: what is missing stays so.
    async fn terrain(&self, relief: &Relief) -> Result<Terrain, DrawError> {
        let grid = relief.grid;
        // No domain: its gaps are not filled.
        let key = (relief.field.clone(), relief.field.clone(), None, Gaps::Left);
        let place = match self.fields.get_value_or_guard_async(&key).await {
            Ok(held) => {
                let elevation = held.field;
                self.field_hits.fetch_add(1, Ordering::Relaxed);
                // Found under its content, which says nothing of the grid of another job.
                let fits = elevation.cells.content().len() == grid.cell_count();
                let mismatch = || DrawError::mismatch(&relief.field);
                return fits
                    .then_some(Terrain { grid, elevation })
                    .ok_or_else(mismatch);
            }
            Err(place) => place,
        };
        self.field_misses.fetch_add(1, Ordering::Relaxed);
        let read = storage::fields::read(&self.store, &relief.field, &grid).await;
        let values = read.map_err(|source| DrawError::Store {
            what: "the relief",
            product: relief.field.to_string(),
            source: Box::new(source),
        })?;
        let held = Held::new(Field::new(values), Wanted::Now);
        let elevation = Arc::clone(&held.field);
        drop(place.insert(held));
        Ok(Terrain { grid, elevation })
    }

    /// The domain of a sample and the fields around it.
    async fn interval(
        &self,
        grid: &Grid,
        (sample, gaps): (&TimeSample, Gaps),
        wanted: Wanted,
    ) -> Result<(Arc<Cells<u32>>, Interval), DrawError> {
        let counts = sample.contributed.clone().unwrap_or_default();
        let part = |field: &ObjectKey, counts: &Option<ObjectKey>| {
            (field.clone(), sample.domain.clone(), counts.clone(), gaps)
        };
        let before = async {
            if let Some(field) = &sample.before {
                let key = part(field, &counts.before);
                self.field(grid, key, wanted).await
            } else {
                // All that is accumulated until the end of the first step is of that step.
                let key = part(&sample.domain, &counts.after);
                self.nothing(grid, key).await
            }
        };
        let after = async {
            match &sample.after {
                Some(After { field, weight }) => {
                    let key = part(field, &counts.after);
                    Ok(Some((self.field(grid, key, wanted).await?, *weight)))
                }
                None => Ok(None),
            }
        };
        let domain = self.domain(grid, &sample.domain);
        let (domain, before, after) = tokio::try_join!(domain, before, after)?;
        let (after, weight) = after.unwrap_or_else(|| (Arc::clone(&before), 0.0));
        let interval = Interval {
            before,
            after,
            weight,
        };
        Ok((domain, interval))
    }

    /// Where accumulation starts: zero in every cell of the domain, which stands for the field in the key.
    async fn nothing(&self, grid: &Grid, key: FieldKey) -> Result<Arc<Field>, DrawError> {
        if let Some(held) = self.fields.get(&key) {
            return Ok(held.field);
        }
        let (_, of_domain, counts, _) = &key;
        let domain = self.domain(grid, of_domain);
        let (domain, lacking) =
            tokio::try_join!(domain, self.lacking(grid, of_domain, counts.as_ref()))?;
        let zero = |cell: &u32| if *cell == 0 { f32::NAN } else { 0.0 };
        let field = Field::new(domain.content().iter().map(zero).collect());
        let held = Held::new(uncertain(field, lacking), Wanted::Now);
        self.fields.insert(key, held.clone());
        Ok(held.field)
    }

    /// What sums lack, if counts say so.
    async fn lacking(
        &self,
        grid: &Grid,
        domain: &ObjectKey,
        counts: Option<&ObjectKey>,
    ) -> Result<Option<Vec<f32>>, DrawError> {
        let Some(counts) = counts else {
            return Ok(None);
        };
        let read = storage::contributed::read(&self.store, counts, grid).await;
        let counts = read.map_err(|e| failed("the counts of steps", domain, e))?;
        Ok(Some(counts.lacking()))
    }

    async fn domain(&self, grid: &Grid, key: &ObjectKey) -> Result<Arc<Cells<u32>>, DrawError> {
        let reading = async {
            let read = storage::domain::read_cells(&self.store, key).await;
            let cells = read.map_err(|e| failed("the domain", key, e))?;
            // A few bytes may stand for any number of cells.
            if cells.map_count() != grid.cell_count() {
                return Err(DrawError::mismatch(key));
            }
            Ok(Scene::domain_of(cells.flags(0..cells.map_count())))
        };
        let kept = self.domains.get_or_insert_async(key, reading);
        let domain = kept.await?;
        // Before anything as large as the grid claims to be is laid out.
        if domain.content().len() == grid.cell_count() {
            return Ok(domain);
        }
        Err(DrawError::mismatch(key))
    }

    async fn field(
        &self,
        grid: &Grid,
        key: FieldKey,
        wanted: Wanted,
    ) -> Result<Arc<Field>, DrawError> {
        let place = match self.fields.get_value_or_guard_async(&key).await {
            Ok(held) => {
                if wanted == Wanted::Now {
                    self.field_hits.fetch_add(1, Ordering::Relaxed);
                    let was_early = held.is_early.swap(false, Ordering::Relaxed);
                    self.early_hits
                        .fetch_add(u64::from(was_early), Ordering::Relaxed);
                }
                return Ok(held.field);
            }
            Err(place) => place,
        };
        if wanted == Wanted::Now {
            self.field_misses.fetch_add(1, Ordering::Relaxed);
        }
        let held = Held::new(self.read(grid, &key).await?, wanted);
        if wanted == Wanted::Ahead {
            self.early_reads.fetch_add(1, Ordering::Relaxed);
        }
        let field = Arc::clone(&held.field);
        // A field that is too large to be kept is drawn all the same.
        drop(place.insert(held));
        Ok(field)
    }

    /// A field from the store, gaps filled.
    async fn read(&self, grid: &Grid, key: &FieldKey) -> Result<Field, DrawError> {
        let (field, of_domain, counts, gaps) = key;
        let reading = async {
            let read = storage::fields::read(&self.store, field, grid).await;
            read.map_err(|e| failed("a field", of_domain, e))
        };
        let (values, domain, lacking) = tokio::try_join!(
            reading,
            self.domain(grid, of_domain),
            self.lacking(grid, of_domain, counts.as_ref()),
        )?;
        if *gaps == Gaps::Left {
            return Ok(uncertain(Field::new(values), lacking));
        }
        let (renderer, of_grid) = (Arc::clone(&self.renderer), *grid);
        let fill = move || fill(&renderer, &of_grid, values, &domain);
        let filled = tokio::task::spawn_blocking(fill).await;
        let filled = filled.map_err(DrawError::Thread)??;
        Ok(uncertain(filled, lacking))
    }
}

/// A field with what its sums lack, if that is known.
fn uncertain(field: Field, lacking: Option<Vec<f32>>) -> Field {
    match lacking {
        Some(lacking) => field.with_lacking(lacking),
        None => field,
    }
}

fn fill(
    renderer: &Renderer,
    grid: &Grid,
    values: Vec<f32>,
    domain: &Cells<u32>,
) -> Result<Field, DrawError> {
    let domain = domain.content();
    let mut gaps = values.iter().zip(domain);
    let has_gaps = gaps.any(|(value, domain)| *domain != 0 && !holds(*value));
    if !has_gaps || domain.len() != values.len() {
        return Ok(Field::new(values));
    }
    let filled = renderer.fill(Form::Window, grid, &values, domain)?;
    Ok(Field::filled(filled))
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
