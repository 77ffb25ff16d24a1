//! Light that pictures share: a block of tiles in, the depth above the middle of every slice out, made once and kept.
//!
//! The first tile of a block at an instant makes its own light, so that nobody waits for a block of which nothing else
//! is looked at; the second one makes the block's, which serves all others. Both kinds hold the same numbers.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use contract::job::RenderJob;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::plan::LightWindow;
use crate::scene::{Interval, Scene};

/// Share of a device's own memory for light.
const SHARE: u64 = 16;
/// Bytes kept where nobody knows what the device has.
const UNKNOWN_BYTES: u64 = 512 << 20;
/// Share of that which one block may take: a screen shows more than one.
const BLOCK_SHARE: u64 = 2;
/// Blocks remembered, those without light included.
const MOST_BLOCKS: usize = 1024;

/// The light of a block of tiles on the device.
pub(crate) struct SharedLight {
    pub(crate) window: LightWindow,
    pub(crate) buffer: wgpu::Buffer,
}

/// How light was shared so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LightCounts {
    /// Bytes kept now.
    pub bytes: u64,
    /// Blocks whose light was made.
    pub made: u64,
    /// Tiles drawn in the light of a block.
    pub used: u64,
}

/// What light depends on: the block with its style, and the frames of the instant as they are in memory.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    block: String,
    frames: [Option<[u64; 3]>; 2],
}

/// The light of one block; locked while it is made.
#[derive(Default)]
enum State {
    #[default]
    NotMade,
    Made(Arc<SharedLight>),
    /// Too large to be shared.
    Refused,
}

struct Block {
    state: Arc<Mutex<State>>,
    bytes: u64,
    last_use: u64,
}

/// Lights by block, least recently used first to go.
pub(crate) struct Lights {
    most_bytes: u64,
    held: Mutex<Held>,
}

#[derive(Default)]
struct Held {
    blocks: BTreeMap<Key, Block>,
    uses: u64,
    counts: LightCounts,
}

impl Key {
    fn new(block: &RenderJob, scene: &Scene) -> Self {
        let frames = |interval: &Interval| {
            let weight = interval.weight.to_bits();
            [
                interval.before.cells.id(),
                interval.after.cells.id(),
                weight,
            ]
        };
        Self {
            block: block.key().to_string(),
            frames: [
                Some(frames(&scene.value)),
                scene.accumulated.as_ref().map(frames),
            ],
        }
    }
}

impl Lights {
    /// None yet.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            most_bytes: gpu.own_bytes().map_or(UNKNOWN_BYTES, |own| own / SHARE),
            held: Mutex::default(),
        }
    }

    /// Bytes, and what was made and used.
    pub(crate) fn counts(&self) -> LightCounts {
        self.lock().counts
    }

    /// The light of a block if it is there; nothing waits, nothing is remembered.
    pub(crate) fn made(&self, block: &RenderJob, scene: &Scene) -> Option<Arc<SharedLight>> {
        let state = {
            let mut held = self.lock();
            held.uses += 1;
            let use_count = held.uses;
            let block = held.blocks.get_mut(&Key::new(block, scene))?;
            block.last_use = use_count;
            Arc::clone(&block.state)
        };
        let state = match state.try_lock() {
            Ok(state) => state,
            // What failed half-way left no light behind.
            Err(TryLockError::Poisoned(state)) => state.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        let light = match &*state {
            State::Made(light) => Some(Arc::clone(light)),
            State::NotMade | State::Refused => None,
        };
        drop(state);
        self.lock().counts.used += u64::from(light.is_some());
        light
    }

    /// May a block's light take so many bytes?
    pub(crate) fn fits(&self, bytes: u64) -> bool {
        bytes <= self.most_bytes / BLOCK_SHARE
    }

    /// The light of a block that was asked for before, made by `make` if it is not there; none the first time, and where
    /// `make` has none to give. Others who want the same wait until it is made.
    ///
    /// # Errors
    /// What `make` fails with but for sizes.
    pub(crate) fn of(
        &self,
        block: &RenderJob,
        scene: &Scene,
        make: impl FnOnce() -> Result<Option<SharedLight>, RenderError>,
    ) -> Result<Option<Arc<SharedLight>>, RenderError> {
        let key = Key::new(block, scene);
        let Some(place) = self.lock().known(&key) else {
            return Ok(None);
        };
        let mut state = place.lock().unwrap_or_else(PoisonError::into_inner);
        if let State::NotMade = *state {
            *state = match make() {
                Ok(Some(light)) => {
                    self.lock()
                        .keep(&key, &place, light.buffer.size(), self.most_bytes);
                    State::Made(Arc::new(light))
                }
                Ok(None)
                | Err(RenderError::TooLarge { .. } | RenderError::TooManyParticles { .. }) => {
                    State::Refused
                }
                Err(error) => return Err(error),
            };
        }
        Ok(match &*state {
            State::Made(light) => {
                self.lock().counts.used += 1;
                Some(Arc::clone(light))
            }
            State::NotMade | State::Refused => None,
        })
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        // Counts and a map that is changed entry by entry: a poisoned lock still guards what is true.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    /// The place for a block's light; none if nobody asked for it before.
    fn known(&mut self, key: &Key) -> Option<Arc<Mutex<State>>> {
        self.uses += 1;
        if let Some(block) = self.blocks.get_mut(key) {
            block.last_use = self.uses;
            return Some(Arc::clone(&block.state));
        }
        let block = Block {
            state: Arc::default(),
            bytes: 0,
            last_use: self.uses,
        };
        self.blocks.insert(key.clone(), block);
        if self.blocks.len() > MOST_BLOCKS {
            let oldest = oldest(self.blocks.iter());
            if let Some(key) = oldest {
                self.forget(&key);
            }
        }
        None
    }

    /// Counts a light that was made, if its block has not been forgotten meanwhile, and makes room for it.
    fn keep(&mut self, key: &Key, place: &Arc<Mutex<State>>, bytes: u64, most_bytes: u64) {
        self.counts.made += 1;
        let block = self.blocks.get_mut(key);
        let Some(block) = block.filter(|block| Arc::ptr_eq(&block.state, place)) else {
            return;
        };
        self.counts.bytes += bytes - block.bytes;
        block.bytes = bytes;
        while self.counts.bytes > most_bytes {
            let lit = self
                .blocks
                .iter()
                .filter(|(own, block)| block.bytes > 0 && *own != key);
            let Some(oldest) = oldest(lit) else {
                return;
            };
            self.forget(&oldest);
        }
    }

    fn forget(&mut self, key: &Key) {
        if let Some(block) = self.blocks.remove(key) {
            self.counts.bytes -= block.bytes;
        }
    }
}

/// The block that was not asked for for longest.
fn oldest<'a>(blocks: impl Iterator<Item = (&'a Key, &'a Block)>) -> Option<Key> {
    let oldest = blocks.min_by_key(|(_, block)| block.last_use);
    oldest.map(|(key, _)| key.clone())
}
