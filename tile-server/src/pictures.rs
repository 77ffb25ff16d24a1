//! Pictures by their job: from memory, from the object store, or drawn once for all who wait, within limits. Who draws
//! a picture stores it; this looks, and says which are stored: tiles, so many bytes a day (docs/decisions/026).

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use contract::digest::Digest;
use contract::encoding::Encoding;
use contract::job::{RenderJob, View};
use contract::key::ObjectKey;
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};
use storage::{StorageError, Store};
use tokio::task::AbortHandle;

use crate::allowance::Allowance;
use crate::backend::{Draw, Keep, Turn};
use crate::error::ServerError;
use crate::gate::{Gate, Pass};
use crate::metrics::{Metrics, Source};
use crate::single_flight::SingleFlight;

/// What every PNG begins with (ISO/IEC 15948, 5.2), and every JPEG (ISO/IEC 10918-1, B.1.1.3).
const PNG_SIGNATURE: &[u8] = &[0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];
const JPEG_SIGNATURE: &[u8] = &[0xff, 0xd8, 0xff];
/// How long a stored picture is waited for before it is drawn again.
const STORE_LIMIT: Duration = Duration::from_secs(3);
/// How long drawing may take while the store does not answer. Whoever has the fields in memory draws as ever; whoever
/// has not would wait for the store in turn.
const AWAY_LIMIT: Duration = Duration::from_secs(8);
/// Size of a picture the memory is laid out for, bytes: between an empty tile (0.3 KiB) and a busy one (100 KiB).
const TYPICAL_BYTES: u64 = 20 << 10;
/// Memory an entry takes besides its bytes: digest, handle and the cache's own tables.
const ENTRY_BYTES: u64 = 128;
/// The least that a part of the memory has, bytes. A picture lies in one of the parts, which takes none that fills more than
/// 97 % of it; the cache's own number of parts is four a core, and on many cores no large view would find room.
const PART_BYTES: u64 = 64 << 20;

#[derive(Debug, Clone)]
struct ByBytes;

impl Weighter<Digest, Bytes> for ByBytes {
    fn weight(&self, _digest: &Digest, picture: &Bytes) -> u64 {
        picture.len() as u64 + ENTRY_BYTES
    }
}

/// A memory of so many bytes, in parts of [`PART_BYTES`] and more, whatever the number of cores.
fn memory_of(bytes: u64) -> Cache<Digest, Bytes, ByBytes> {
    // The cache rounds the number up to a power of two, which would make them smaller.
    let parts = 1_usize << (bytes / PART_BYTES).checked_ilog2().unwrap_or(0);
    let options = OptionsBuilder::new()
        .shards(parts)
        .estimated_items_capacity((bytes / TYPICAL_BYTES).max(16) as usize)
        .weight_capacity(bytes)
        .build()
        .expect("both capacities are given");
    Cache::with_options(
        options,
        ByBytes,
        DefaultHashBuilder::default(),
        DefaultLifecycle::default(),
    )
}

/// The pictures of one server.
pub struct Pictures {
    flights: SingleFlight<Bytes>,
    maker: Arc<Maker>,
}

/// The store does not answer.
struct StoreAway;

/// Bounds of one server's pictures.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Of those kept in memory.
    pub memory_bytes: u64,
    /// Of those that whoever asks has stored.
    pub stored_bytes_per_day: u64,
    /// How long anybody waits for one.
    pub request_limit: Duration,
}

/// What making one picture needs; shared with the tasks that draw.
struct Maker {
    store: Store,
    allowance: Allowance,
    drawer: Arc<dyn Draw>,
    gate: Gate,
    memory: Cache<Digest, Bytes, ByBytes>,
    /// How long anybody waits for a picture.
    request_limit: Duration,
    metrics: Metrics,
}

/// A drawing under way. It is given up with those who wait for it, unless one of them may have waited as long as he could
/// stand: he comes again, and finds it.
struct Waited {
    drawing: AbortHandle,
    since: Instant,
    long: Duration,
}

impl Drop for Waited {
    fn drop(&mut self) {
        if self.since.elapsed() < self.long {
            // Nothing happens to one that has ended.
            self.drawing.abort();
        }
    }
}

impl Pictures {
    /// No pictures yet.
    pub fn new(
        store: Store,
        drawer: Arc<dyn Draw>,
        gate: Gate,
        limits: &Limits,
        metrics: Metrics,
    ) -> Self {
        Self {
            flights: SingleFlight::new(&metrics.panics),
            maker: Arc::new(Maker {
                store,
                allowance: Allowance::new(limits.stored_bytes_per_day, Instant::now()),
                drawer,
                gate,
                memory: memory_of(limits.memory_bytes),
                request_limit: limits.request_limit,
                metrics,
            }),
        }
    }

    /// The picture of a job for one who looks at it for a moment: not stored, and given up when this is dropped.
    pub async fn in_passing(
        &self,
        job: &RenderJob,
        encoding: Encoding,
    ) -> Result<Bytes, ServerError> {
        let maker = &self.maker;
        let digest = job.digest();
        if encoding.is_stored()
            && let Some(picture) = self.remembered(&digest)
        {
            return Ok(picture);
        }
        let refused = |_busy: &ServerError| maker.metrics.refused.inc();
        let Pass { place, turn } = maker.gate.enter().await.inspect_err(refused)?;
        let picture = maker.draw(job, Keep::No, encoding, turn).await?;
        drop(place);
        if encoding.is_stored() {
            maker.remember(digest, &picture);
        }
        Ok(picture)
    }

    /// Counts a picture that needs no drawing.
    pub(crate) fn hit(&self, source: Source) {
        self.maker.metrics.hit(source);
    }

    /// The picture of a job, if it lies in memory.
    pub(crate) fn remembered(&self, digest: &Digest) -> Option<Bytes> {
        let picture = self.maker.memory.get(digest)?;
        self.hit(Source::Memory);
        Some(picture)
    }

    /// The picture of a job, as a PNG. Its digest is the caller's to tell: of a picture that is there it is most of the work.
    pub async fn get(&self, digest: Digest, job: RenderJob) -> Result<Bytes, ServerError> {
        if let Some(picture) = self.remembered(&digest) {
            return Ok(picture);
        }
        let maker = Arc::clone(&self.maker);
        self.flights.join(digest, || maker.make(digest, job)).await
    }
}

/// Is a picture one of those that are stored? A free camera has no end of views, of which hardly one is asked for twice.
fn is_tile(job: &RenderJob) -> bool {
    match job.view {
        View::Tile { .. } => true,
        View::Globe { .. } => false,
    }
}

fn signature(encoding: Encoding) -> &'static [u8] {
    match encoding {
        Encoding::Png => PNG_SIGNATURE,
        Encoding::Jpeg { .. } => JPEG_SIGNATURE,
    }
}

impl Maker {
    async fn make(self: Arc<Self>, digest: Digest, job: RenderJob) -> Result<Bytes, ServerError> {
        let asked_at = Instant::now();
        // The flight before this one may have ended since the memory was asked.
        if let Some(picture) = self.memory.get(&digest) {
            self.metrics.hit(Source::Memory);
            return Ok(picture);
        }
        let stored = if is_tile(&job) {
            self.stored(&job.key()).await
        } else {
            Ok(None)
        };
        if let Ok(Some(picture)) = stored {
            self.metrics.hit(Source::Store);
            self.remember(digest, &picture);
            return Ok(picture);
        }
        let limit = stored.err().map(|StoreAway| AWAY_LIMIT);
        self.metrics.cache_misses.inc();
        let waiting = Instant::now();
        let Pass { place, turn } = self
            .gate
            .enter()
            .await
            .inspect_err(|_busy| self.metrics.refused.inc())?;
        self.metrics
            .draw_wait_s
            .observe(waiting.elapsed().as_secs_f64());
        let request_limit = self.request_limit;
        let drawing = tokio::spawn(async move {
            // Nobody waits longer than once; what takes longer is found by who asks again.
            let drawing = self.draw_within(limit, &job, turn);
            let drawn = tokio::time::timeout(2 * request_limit, drawing).await;
            let picture = drawn.map_err(|_elapsed| ServerError::TimedOut {
                limit_s: 2 * request_limit.as_secs(),
            })??;
            self.remember(digest, &picture);
            // The turn went to the next one when this was drawn; pictures that are encoded count until here.
            drop(place);
            Ok(picture)
        });
        let _waited = Waited {
            drawing: drawing.abort_handle(),
            since: asked_at,
            long: request_limit / 2,
        };
        drawing.await.unwrap_or_else(|e| {
            Err(ServerError::Defect {
                what: format!("drawing ended early: {e}"),
            })
        })
    }

    async fn stored(&self, key: &ObjectKey) -> Result<Option<Bytes>, StoreAway> {
        let asked_at = Instant::now();
        let looked = tokio::time::timeout(STORE_LIMIT, self.store.get(key)).await;
        let took_s = asked_at.elapsed().as_secs_f64();
        self.metrics.look_up_s.observe(took_s);
        let error = match looked {
            Ok(Ok(picture)) => return Ok(Some(picture)),
            Ok(Err(error)) if error.is_not_found() => return Ok(None),
            Ok(Err(error @ StorageError::Damaged { .. })) => {
                self.metrics.store_failures.inc();
                tracing::warn!(%error, object.key = %key, "a damaged picture is drawn again");
                return Ok(None);
            }
            Ok(Err(error)) => error.to_string(),
            Err(_elapsed) => format!("no answer within {} s", STORE_LIMIT.as_secs()),
        };
        self.metrics.store_failures.inc();
        tracing::warn!(error, object.key = %key, "a stored picture cannot be read; it is drawn again");
        Err(StoreAway)
    }

    async fn draw_within(
        &self,
        limit: Option<Duration>,
        job: &RenderJob,
        turn: Turn,
    ) -> Result<Bytes, ServerError> {
        let Some(limit) = limit else {
            let keep = self.keep(job);
            let picture = self.draw(job, keep, Encoding::Png, turn).await?;
            if keep == Keep::Yes {
                self.allowance.used(picture.len(), Instant::now());
            }
            return Ok(picture);
        };
        // It could not be asked for a moment ago; it is stored when it is drawn for the one who asks next.
        let drawn =
            tokio::time::timeout(limit, self.draw(job, Keep::No, Encoding::Png, turn)).await;
        drawn.unwrap_or_else(|_elapsed| {
            Err(ServerError::StoreAway {
                limit_s: limit.as_secs(),
            })
        })
    }

    fn keep(&self, job: &RenderJob) -> Keep {
        let why = if !is_tile(job) {
            "view"
        } else if !self.allowance.is_left(Instant::now()) {
            "allowance"
        } else {
            return Keep::Yes;
        };
        self.metrics.not_stored.with_label_values(&[why]).inc();
        Keep::No
    }

    async fn draw(
        &self,
        job: &RenderJob,
        keep: Keep,
        encoding: Encoding,
        turn: Turn,
    ) -> Result<Bytes, ServerError> {
        let started_at = Instant::now();
        let drawn = self.drawer.draw(job, keep, encoding, turn).await;
        let mode = job.mode.as_str();
        self.metrics
            .draw_duration_s
            .with_label_values(&[mode])
            .observe(started_at.elapsed().as_secs_f64());
        let drawn = drawn.map_err(ServerError::from).and_then(|picture| {
            if picture.starts_with(signature(encoding)) {
                Ok(picture)
            } else {
                Err(ServerError::Defect {
                    what: format!("the renderer's answer is no {}", encoding.media_type()),
                })
            }
        });
        let outcome = if drawn.is_ok() { "ok" } else { "failed" };
        self.metrics.drawn.with_label_values(&[mode, outcome]).inc();
        drawn
    }

    fn remember(&self, digest: Digest, picture: &Bytes) {
        // A copy: what came over a connection is a part of its buffer, which would be kept as a whole and counted as this part.
        self.memory.insert(digest, Bytes::copy_from_slice(picture));
        self.metrics.cache_bytes.set(self.memory.weight() as i64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Is a picture of so many bytes found in a memory of so many, by whatever digest?
    fn is_remembered(picture_bytes: usize, memory_bytes: u64) -> bool {
        let memory = memory_of(memory_bytes);
        let picture = Bytes::from(vec![0_u8; picture_bytes]);
        (0..16_u8).all(|view| {
            let digest = Digest::of(&[view]);
            memory.insert(digest, picture.clone());
            memory.get(&digest).is_some()
        })
    }

    #[test]
    fn large_views_are_remembered_whatever_the_number_of_cores() {
        assert!(is_remembered(10 << 20, 64 << 20), "a small memory");
        assert!(is_remembered(60 << 20, 256 << 20), "all parts are as large");
        assert!(is_remembered(60 << 20, 500 << 20), "no power of two");
        assert!(!is_remembered(65 << 20, 64 << 20), "it has an end");
    }

    #[test]
    fn the_memory_may_be_none() {
        assert!(!is_remembered(1, 0));
    }
}
