//! Fields that stay on the device between pictures.

use std::ops::Range;

use bytemuck::Pod;
use quick_cache::Weighter;
use quick_cache::sync::Cache;

use crate::error::RenderError;
use crate::field_cache::field_cache;
use crate::gpu::Gpu;
use crate::scene::Cells;

/// Share of a device's own memory for fields: the rest is for pictures in flight and for others.
const SHARE: u64 = 8;
/// Bytes kept where nobody knows what the device has.
const UNKNOWN_BYTES: u64 = 512 << 20;

/// The cells of a field, and the part of them that is held.
type Id = (u64, usize, usize);

/// Buffers by what they hold. One that is being sent is waited for by those who want the same, and by nobody else.
pub(crate) struct Resident<B: Clone = wgpu::Buffer> {
    held: Cache<Id, Held<B>, ByBytes>,
}

#[derive(Clone)]
struct Held<B> {
    buffer: B,
    bytes: u64,
}

#[derive(Clone)]
struct ByBytes;

impl<B> Weighter<Id, Held<B>> for ByBytes {
    fn weight(&self, _id: &Id, held: &Held<B>) -> u64 {
        held.bytes
    }
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
            gpu.storage("field", &cells.content()[part])
        })
    }
}

impl<B: Clone> Resident<B> {
    fn holding(most_bytes: u64) -> Self {
        Self {
            held: field_cache(most_bytes, ByBytes),
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        self.held.weight()
    }

    /// What is held under an id, made if it is not there; nothing else waits for that.
    fn kept(
        &self,
        id: Id,
        size: impl FnOnce(&B) -> u64,
        make: impl FnOnce() -> Result<B, RenderError>,
    ) -> Result<B, RenderError> {
        let make = || -> Result<Held<B>, RenderError> {
            let buffer = make()?;
            let bytes = size(&buffer);
            Ok(Held { buffer, bytes })
        };
        let held = self.held.get_or_insert_with(&id, make)?;
        Ok(held.buffer)
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
    fn a_field_that_is_there_is_had_while_another_is_sent() {
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
    fn what_has_just_come_is_there_for_the_next_picture() {
        let resident = Resident::<u64>::holding(4);
        let made = |number: u64| {
            let mut made = false;
            let make = || {
                made = true;
                Ok(number)
            };
            resident.kept(id(number), |_buffer| 1, make).unwrap();
            made
        };
        assert!(made(1) && made(2) && made(3) && made(4));
        assert!(!made(1) && !made(2) && !made(3) && !made(4));
        // A picture brings two at a time, and the next one needs both.
        for later in (5..25).step_by(2) {
            assert!(made(later) && made(later + 1), "{later}");
            assert_eq!(resident.bytes(), 4);
            assert!(!made(later) && !made(later + 1), "{later}");
        }
    }

    #[test]
    fn what_is_larger_than_all_room_is_had_and_not_held() {
        let resident = Resident::<u64>::holding(4);
        let had = resident.kept(id(1), |_buffer| 5, || Ok(7)).unwrap();
        assert_eq!((had, resident.bytes()), (7, 0));
    }
}
