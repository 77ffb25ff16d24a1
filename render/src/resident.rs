//! Frames that stay on the device between pictures, least recently drawn first to go.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::Pod;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::scene::Cells;

/// Share of a device's own memory for frames: the rest is for pictures in flight and for others.
const SHARE: u64 = 8;
/// Bytes kept where nobody knows what the device has.
const UNKNOWN_BYTES: u64 = 512 << 20;

/// The cells of a frame, and the part of them that is held.
type Id = (u64, usize, usize);

/// Buffers by what they hold. One that is being sent is waited for by those who want the same, and by nobody else.
pub(crate) struct Resident<B = wgpu::Buffer> {
    held: Mutex<Held<B>>,
}

struct Held<B> {
    /// Bytes kept at most, apart from frames in flight.
    most_bytes: u64,
    by_id: BTreeMap<Id, Slot<B>>,
    uses: u64,
}

/// The place of one buffer; locked while it is sent.
struct Slot<B> {
    buffer: Arc<Mutex<Option<B>>>,
    /// 0 until it is there.
    bytes: u64,
    last_use: u64,
}

impl Resident {
    /// Nothing yet; up to so many bytes, a share of what the device has if none are named.
    pub(crate) fn new(gpu: &Gpu, most_bytes: Option<u64>) -> Self {
        let share = || gpu.own_bytes().map_or(UNKNOWN_BYTES, |own| own / SHARE);
        Self::holding(most_bytes.unwrap_or_else(share))
    }

    /// A part of the cells on the device, uploaded if it is not there.
    pub(crate) fn buffer<T: Pod>(
        &self,
        gpu: &Gpu,
        cells: &Cells<T>,
        part: Range<usize>,
    ) -> Result<wgpu::Buffer, RenderError> {
        let id = (cells.id(), part.start, part.end);
        self.kept(id, wgpu::Buffer::size, || {
            gpu.storage("frame", &cells.content()[part])
        })
    }
}

impl<B: Clone> Resident<B> {
    fn holding(most_bytes: u64) -> Self {
        let held = Held {
            most_bytes,
            by_id: BTreeMap::new(),
            uses: 0,
        };
        Self {
            held: Mutex::new(held),
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        self.lock().bytes()
    }

    /// What is held under an id, made if it is not there; nothing else waits for that.
    fn kept(
        &self,
        id: Id,
        size: impl FnOnce(&B) -> u64,
        make: impl FnOnce() -> Result<B, RenderError>,
    ) -> Result<B, RenderError> {
        let slot = self.lock().slot(id);
        // What failed half-way left nothing behind.
        let mut place = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(buffer) = &*place {
            return Ok(buffer.clone());
        }
        let buffer = make()?;
        *place = Some(buffer.clone());
        drop(place);
        self.lock().count(id, &slot, size(&buffer));
        Ok(buffer)
    }

    fn lock(&self) -> MutexGuard<'_, Held<B>> {
        // Entries come and go whole, so a poisoned lock still guards what is true.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<B> Held<B> {
    fn bytes(&self) -> u64 {
        self.by_id.values().map(|slot| slot.bytes).sum()
    }

    /// The place of a buffer, which may not be there yet.
    fn slot(&mut self, id: Id) -> Arc<Mutex<Option<B>>> {
        self.uses += 1;
        let slot = self.by_id.entry(id).or_insert_with(|| Slot {
            buffer: Arc::default(),
            bytes: 0,
            last_use: 0,
        });
        slot.last_use = self.uses;
        Arc::clone(&slot.buffer)
    }

    /// Counts a buffer that was made, if it has not been forgotten meanwhile, and makes room for it.
    fn count(&mut self, id: Id, place: &Arc<Mutex<Option<B>>>, made_bytes: u64) {
        let slot = self.by_id.get_mut(&id);
        if let Some(slot) = slot.filter(|slot| Arc::ptr_eq(&slot.buffer, place)) {
            slot.bytes = made_bytes;
            self.evict();
        }
    }

    fn evict(&mut self) {
        let mut bytes = self.bytes();
        while bytes > self.most_bytes && self.by_id.len() > 1 {
            let oldest = self
                .by_id
                .iter()
                .min_by_key(|(_, slot)| slot.last_use)
                .map(|(id, _)| *id);
            let Some(slot) = oldest.and_then(|id| self.by_id.remove(&id)) else {
                return;
            };
            bytes -= slot.bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;
    use std::thread;
    use std::time::Duration;

    use super::*;

    /// Longer than any machine needs.
    const LIMIT: Duration = Duration::from_mins(1);

    fn id(number: u64) -> Id {
        (number, 0, 1)
    }

    #[test]
    fn a_frame_that_is_there_is_had_while_another_is_sent() {
        let resident = Resident::<u64>::holding(100);
        let had = |number: u64| {
            resident
                .kept(id(number), |_buffer| 1, || Ok(number))
                .unwrap()
        };
        assert_eq!(had(1), 1);
        let (begun_tx, begun) = sync_channel(1);
        let (go, wait) = sync_channel::<()>(1);
        thread::scope(|scope| {
            let resident = &resident;
            let sending = scope.spawn(move || {
                let slow = || {
                    begun_tx.send(()).unwrap();
                    let told = wait.recv_timeout(LIMIT);
                    Ok(if told.is_ok() { 2 } else { 0 })
                };
                resident.kept(id(2), |_buffer| 1, slow)
            });
            begun.recv_timeout(LIMIT).unwrap();
            assert_eq!((had(1), resident.bytes()), (1, 1));
            go.send(()).unwrap();
            assert_eq!(sending.join().unwrap().unwrap(), 2, "the other one waited");
        });
        assert_eq!(resident.bytes(), 2);
    }

    #[test]
    fn what_could_not_be_sent_is_sent_by_the_next_one_who_wants_it() {
        let resident = Resident::<u64>::holding(100);
        let failed = resident.kept(
            id(1),
            |_buffer| 1,
            || Err(RenderError::OutOfMemory { what: "a test" }),
        );
        assert!(failed.is_err());
        assert_eq!(resident.kept(id(1), |_buffer| 1, || Ok(7)).unwrap(), 7);
        let again = resident.kept(id(1), |_buffer| 1, || unreachable!("it is there"));
        assert_eq!(again.unwrap(), 7);
    }

    #[test]
    fn what_was_used_longest_ago_makes_room() {
        let resident = Resident::<u64>::holding(2);
        let made = |number: u64| {
            let mut made = false;
            let make = || {
                made = true;
                Ok(number)
            };
            resident.kept(id(number), |_buffer| 1, make).unwrap();
            made
        };
        assert!(made(1) && made(2) && !made(1) && made(3));
        assert_eq!(resident.bytes(), 2);
        assert!(!made(1) && made(2));
    }
}
