//! Fields read before they are wanted: the job drawn last in; the fields around it in time read, their gaps filled and
//! brought to the device, one after the other, out.
//!
//! A job names fields, not steps. Which ones come next is read from the newest manifest of its product, and which way
//! time runs is seen from one job to the next, so nobody who asks for pictures needs to say.

mod neighbours;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use contract::job::RenderJob;
use contract::manifest::Manifest;
use contract::time_sample::TimeSample;
use quick_cache::unsync::Cache;
use render::Renderer;
use storage::{Store, manifests};
use tokio::sync::watch;

use crate::error::DrawError;
use crate::source::Source;
use neighbours::{Heading, next, place_of};

/// Manifests remembered.
const MOST_MANIFESTS: usize = 32;
/// A manifest younger than this is not read again for fields that it does not have: old versions are drawn, too.
const LEAST_AGE: Duration = Duration::from_secs(5);
/// Fields of one product that must fit into memory besides those ahead: two of the instant, two of the one before.
const FIELDS_IN_USE: u64 = 4;
/// Bytes of a cell: its value and the estimated error of a filled one.
const CELL_BYTES: u64 = 8;

/// What was drawn last; none before the first picture.
type Wish = Option<Arc<RenderJob>>;

/// Reads ahead of what is drawn, on a task of its own.
pub(crate) struct Prefetch {
    reader: Arc<Reader>,
    /// The task's ear; there from the first picture on.
    wish: OnceLock<watch::Sender<Wish>>,
}

struct Reader {
    store: Store,
    source: Arc<Source>,
    renderer: Arc<Renderer>,
    fields_ahead: usize,
}

/// A manifest, and when it was the newest.
type Known = (Arc<Manifest>, Instant);

/// What the task has learnt.
struct Learnt {
    manifests: Cache<String, Known>,
    /// Place of the last instant of a product, and the direction to it.
    last: BTreeMap<String, (f64, Heading)>,
}

impl Prefetch {
    /// Reads up to so many fields ahead of every product of a job; none with 0.
    pub(crate) fn new(
        store: Store,
        source: Arc<Source>,
        renderer: Arc<Renderer>,
        fields_ahead: usize,
    ) -> Self {
        Self {
            reader: Arc::new(Reader {
                store,
                source,
                renderer,
                fields_ahead,
            }),
            wish: OnceLock::new(),
        }
    }

    /// Tells of a job that was drawn. Needs a runtime.
    pub(crate) fn drawn(&self, job: &RenderJob) {
        if self.reader.fields_ahead == 0 {
            return;
        }
        let wish = self.wish.get_or_init(|| {
            let (sender, ear) = watch::channel(None);
            tokio::spawn(run(Arc::clone(&self.reader), ear));
            sender
        });
        // Only the last one counts: whoever drags through time leaves nothing behind to be read.
        wish.send_replace(Some(Arc::new(job.clone())));
    }
}

/// Reads ahead of the last job until nobody draws any more. A job of other products ends what is under way.
async fn run(reader: Arc<Reader>, mut ear: watch::Receiver<Wish>) {
    let mut learnt = Learnt {
        manifests: Cache::new(MOST_MANIFESTS),
        last: BTreeMap::new(),
    };
    while ear.changed().await.is_ok() {
        let wish = ear.borrow_and_update().clone();
        let Some(job) = wish else {
            continue;
        };
        let mut moved_on = ear.clone();
        let left = async {
            let is_away = |next: &Wish| next.as_ref().is_some_and(|next| is_other(&job, next));
            moved_on.wait_for(is_away).await.is_ok()
        };
        tokio::select! {
            read = reader.read_ahead(&job, &mut learnt) => {
                if let Err(error) = read {
                    // Whoever draws the field meets the same and says so.
                    tracing::debug!(error = error.in_full(), "no field is read ahead");
                }
            }
            _is_away = left => reader.source.count_cancelled(),
        }
    }
}

/// Are they of other products?
fn is_other(a: &RenderJob, b: &RenderJob) -> bool {
    let vector = |job: &RenderJob| {
        let trails = job.trails.as_ref();
        trails.map(|trails| trails.eastward.domain.clone())
    };
    a.value.domain != b.value.domain || vector(a) != vector(b)
}

impl Reader {
    async fn read_ahead(&self, job: &RenderJob, learnt: &mut Learnt) -> Result<(), DrawError> {
        let parts = [
            Some(&job.value),
            job.accumulated.as_ref(),
            job.flow.as_ref().map(|flow| &flow.northward),
            job.trails.as_ref().map(|trails| &trails.eastward),
            job.trails.as_ref().map(|trails| &trails.flow.northward),
        ];
        if !self.source.is_held_whole(&job.grid) {
            // Windows of it are read quickly, and another picture shows another one.
            return Ok(());
        }
        let layer = parts[..3].iter().flatten().count() * job.grid.cell_count();
        let vector = job.trails.as_ref();
        let vector = vector.map_or(0, |trails| 2 * trails.grid.cell_count());
        let cells = (layer + vector) as u64 * (FIELDS_IN_USE + self.fields_ahead as u64);
        if cells * CELL_BYTES > self.source.most_bytes() {
            return Ok(());
        }
        let heading = self.heading(&job.value, learnt).await;
        let mut ahead: [Vec<TimeSample>; 5] = std::array::from_fn(|_| vec![]);
        for (part, ahead) in parts.into_iter().zip(&mut ahead) {
            if let Some(sample) = part
                && let Some(manifest) = self.manifest(sample, learnt).await
            {
                *ahead = next(&manifest, sample, heading, self.fields_ahead);
            }
        }
        let longest = ahead.iter().map(Vec::len).max().unwrap_or(0);
        for number in 0..longest {
            let at =
                |part: &[TimeSample], own: &TimeSample| part.get(number).unwrap_or(own).clone();
            let [value, accumulated, northward, trails_east, trails_north] = &ahead;
            let mut early = job.clone();
            early.value = at(value, &job.value);
            early.accumulated = job.accumulated.as_ref().map(|own| at(accumulated, own));
            if let Some(flow) = &mut early.flow {
                flow.northward = at(northward, &flow.northward);
            }
            if let Some(trails) = &mut early.trails {
                trails.eastward = at(trails_east, &trails.eastward);
                trails.flow.northward = at(trails_north, &trails.flow.northward);
            }
            let scene = self.source.scene_ahead(&early).await?;
            let renderer = Arc::clone(&self.renderer);
            let preparing = tokio::task::spawn_blocking(move || renderer.prepare(&early, &scene));
            preparing.await.map_err(DrawError::Thread)??;
        }
        Ok(())
    }

    /// The direction in which a product is played.
    async fn heading(&self, sample: &TimeSample, learnt: &mut Learnt) -> Heading {
        let manifest = self.manifest(sample, learnt).await;
        let Some(place) = manifest.and_then(|manifest| place_of(&manifest, sample)) else {
            return Heading::Unknown;
        };
        if learnt.last.len() > MOST_MANIFESTS {
            learnt.last.clear();
        }
        let product = sample.product().to_owned();
        let (before, heading) = *learnt
            .last
            .get(&product)
            .unwrap_or(&(place, Heading::Unknown));
        let heading = heading.after(before, place);
        learnt.last.insert(product, (place, heading));
        heading
    }

    /// The newest manifest of a sample's product, read again when the one known does not have the sample's fields.
    async fn manifest(&self, sample: &TimeSample, learnt: &mut Learnt) -> Option<Arc<Manifest>> {
        let product = sample.product().to_owned();
        if let Some((manifest, read_at)) = learnt.manifests.get(&product).cloned() {
            let is_of = place_of(&manifest, sample).is_some();
            if is_of || read_at.elapsed() < LEAST_AGE {
                return is_of.then_some(manifest);
            }
        }
        let newest = manifests::latest(&self.store, &product.parse().ok()?).await;
        let newest = match newest {
            Ok(newest) => Arc::new(newest?),
            Err(error) => {
                tracing::debug!(%error, product, "no field is read ahead");
                return None;
            }
        };
        let known = (Arc::clone(&newest), Instant::now());
        learnt.manifests.insert(product, known);
        Some(newest)
    }
}
