//! How much is worked on at the same time: files, and bytes of files.

use tokio::sync::{Semaphore, SemaphorePermit};

use crate::settings::Settings;

/// Bytes are counted in units of this, so that they fit the semaphore's counter.
const UNIT_BYTES: u64 = 64 << 10;

/// Lets in a bounded number of files and bytes.
#[derive(Debug)]
pub(crate) struct Gates {
    files: Semaphore,
    bytes: Semaphore,
    units: u32,
}

/// Held while a file is worked on.
#[derive(Debug)]
pub(crate) struct Pass<'a> {
    _file: SemaphorePermit<'a>,
    _bytes: SemaphorePermit<'a>,
}

impl Gates {
    pub(crate) fn new(settings: &Settings) -> Self {
        let units = u32::try_from(settings.parallel_bytes / UNIT_BYTES).unwrap_or(u32::MAX);
        let units = units.max(1);
        Self {
            files: Semaphore::new(settings.parallel_files.clamp(1, 64)),
            bytes: Semaphore::new(units as usize),
            units,
        }
    }

    /// Waits until there is room; a file larger than all of it has it alone.
    pub(crate) async fn enter(&self, bytes: u64) -> Pass<'_> {
        let units = u32::try_from(bytes.div_ceil(UNIT_BYTES)).unwrap_or(u32::MAX);
        // Always in this order, so that nobody holds bytes and waits for a file.
        let file = self.files.acquire().await;
        let bytes = self.bytes.acquire_many(units.clamp(1, self.units)).await;
        Pass {
            _file: file.expect("the gates are never closed"),
            _bytes: bytes.expect("the gates are never closed"),
        }
    }
}
