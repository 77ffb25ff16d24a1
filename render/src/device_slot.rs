//! Devices that pictures are drawn on: each picture takes the one with the least to do, and a device with a fault is opened
//! again while the others go on.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use crate::adapter::Adapter;
use crate::backend::{self, Backend};
use crate::device::Device;
use crate::error::RenderError;
use crate::gpu::{self, Checks, Found, Gpu};

/// A place for a device: another one takes it after a fault, while pictures under way keep the old one.
pub(crate) struct DeviceSlot {
    opener: Opener,
    most_field_bytes: Option<u64>,
    current: Mutex<Arc<Device>>,
    /// Held while a fresh device is opened, so that only one is.
    opening: Mutex<()>,
    /// Pictures that are drawn on it.
    in_flight: AtomicUsize,
}

/// How a device is opened again.
enum Opener {
    /// The first that the backend means then: after a fault it may be another adapter.
    FirstOf(Backend, Checks),
    /// The adapter that is known, and no other, since others have slots of their own.
    Same(Adapter, Checks),
}

/// A device for one picture.
pub(crate) struct Taken<'a> {
    pub(crate) device: Arc<Device>,
    slot: &'a DeviceSlot,
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        // wgpu panics over some buffers of a device that is lost, before it tells of the loss.
        if thread::panicking() {
            let gpu = self.device.gpu();
            drop(gpu.stopped("drawing", &"the thread that drew panicked"));
        }
        self.slot.in_flight.fetch_sub(1, Ordering::AcqRel);
    }
}

impl DeviceSlot {
    /// A slot for every adapter that a backend means.
    pub(crate) fn all_of(
        backend: Backend,
        checks: Checks,
        most_field_bytes: Option<u64>,
    ) -> Result<Vec<Self>, RenderError> {
        // Asking for adapters opens the drivers' libraries, which the twins need not.
        if backend == Backend::Cpu {
            return Ok(vec![]);
        }
        let found = gpu::found();
        let there: Vec<Adapter> = found.iter().map(|found| found.known().clone()).collect();
        let chosen = backend::chosen(&backend, &there)?;
        let open = |opener, at: usize| Self::new(opener, &found[at], checks, most_field_bytes);
        if let [only] = chosen[..] {
            return Ok(vec![open(Opener::FirstOf(backend, checks), only)?]);
        }
        let same = |at: usize| open(Opener::Same(there[at].clone(), checks), at);
        chosen.into_iter().map(same).collect()
    }

    /// Two slots of the most able adapter, for tests of how several are used where there is one.
    pub(crate) fn two_on_one(checks: Checks) -> Result<Vec<Self>, RenderError> {
        let found = gpu::found();
        let first = found.first().ok_or(RenderError::NoAdapter)?;
        let open = || {
            Self::new(
                Opener::Same(first.known().clone(), checks),
                first,
                checks,
                None,
            )
        };
        Ok(vec![open()?, open()?])
    }

    fn new(
        opener: Opener,
        found: &Found,
        checks: Checks,
        most_field_bytes: Option<u64>,
    ) -> Result<Self, RenderError> {
        let device = Device::new(Gpu::on(found, checks)?, 0, most_field_bytes)?;
        Ok(Self {
            opener,
            most_field_bytes,
            current: Mutex::new(Arc::new(device)),
            opening: Mutex::default(),
            in_flight: AtomicUsize::new(0),
        })
    }

    /// The device in the slot now.
    pub(crate) fn device(&self) -> Arc<Device> {
        Arc::clone(&self.lock())
    }

    /// Pictures that are drawn on it.
    pub(crate) fn in_flight(&self) -> usize {
        self.in_flight.load(Ordering::Acquire)
    }

    fn take(&self) -> Taken<'_> {
        self.in_flight.fetch_add(1, Ordering::AcqRel);
        Taken {
            device: self.device(),
            slot: self,
        }
    }

    /// Opens a fresh device if this one had a fault. Blocks while the shaders compile.
    pub(crate) fn renew(&self) -> Result<(), RenderError> {
        let _one_at_a_time = self.opening.lock().unwrap_or_else(PoisonError::into_inner);
        let failed = self.device();
        if !failed.gpu().has_fault() {
            return Ok(());
        }
        let adapter = failed.gpu().adapter_name();
        tracing::warn!(adapter, "the graphics device failed, opening it again");
        let gpu = self.opener.open()?;
        let fresh = Device::new(gpu, failed.number + 1, self.most_field_bytes)?;
        *self.lock() = Arc::new(fresh);
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Arc<Device>> {
        // The slot is changed by one assignment, so a poisoned lock still guards a whole device.
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Opener {
    fn open(&self) -> Result<Gpu, RenderError> {
        match self {
            Self::FirstOf(backend, checks) => Gpu::first_of(backend, *checks),
            Self::Same(known, checks) => {
                let there = gpu::found();
                let same = there.iter().find(|found| found.known() == known);
                let same = same.ok_or_else(|| RenderError::AdapterGone {
                    adapter: known.name().to_owned(),
                })?;
                Gpu::on(same, *checks)
            }
        }
    }
}

/// The device for a picture from these fields: of those without a fault the one with the least to do; of equal ones the
/// one where pictures from the same fields were drawn before.
pub(crate) fn least_busy(slots: &[DeviceSlot], fields: u64) -> Option<Taken<'_>> {
    let states: Vec<(bool, usize)> = slots
        .iter()
        .map(|slot| (slot.device().gpu().has_fault(), slot.in_flight()))
        .collect();
    slots.get(place(&states, fields)?).map(DeviceSlot::take)
}

/// Devices without a fault that nothing is drawn on, at most so many of them.
pub(crate) fn idle(slots: &[DeviceSlot], most: usize) -> Vec<Taken<'_>> {
    let is_idle = |slot: &&DeviceSlot| slot.in_flight() == 0 && !slot.device().gpu().has_fault();
    let idle = slots.iter().filter(is_idle);
    idle.take(most).map(DeviceSlot::take).collect()
}

/// The slot of these fields when all are idle: where they are brought before anybody wants them.
pub(crate) fn home(slots: &[DeviceSlot], fields: u64) -> Option<Arc<Device>> {
    let idle: Vec<(bool, usize)> = slots
        .iter()
        .map(|slot| (slot.device().gpu().has_fault(), 0))
        .collect();
    slots.get(place(&idle, fields)?).map(DeviceSlot::device)
}

/// `states`: has it a fault, and how many pictures are drawn on it.
fn place(states: &[(bool, usize)], fields: u64) -> Option<usize> {
    let count = states.len();
    let first = (fields % count.max(1) as u64) as usize;
    let in_turn = (0..count).map(|step| (first + step) % count);
    in_turn.min_by_key(|&at| states[at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_goes_where_least_is_to_do_and_else_where_its_fields_are() {
        assert_eq!(place(&[], 7), None);
        assert_eq!(place(&[(true, 9)], 7), Some(0), "there is no other");
        let idle = [(false, 0); 3];
        assert_eq!(
            [3, 4, 5, 6].map(|fields| place(&idle, fields)),
            [0, 1, 2, 0].map(Some)
        );
        assert_eq!(place(&[(false, 1), (false, 2), (false, 1)], 1), Some(2));
        assert_eq!(place(&[(true, 0), (false, 5)], 0), Some(1), "a fault");
    }
}
