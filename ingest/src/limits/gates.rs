//! How much is worked on at the same time: files, and the memory that they need.

use tokio::sync::{Semaphore, SemaphorePermit};

use crate::limits::room::{Room, Taken};
use crate::settings::Settings;

/// Lets in a bounded number of files, which need a bounded amount of memory.
#[derive(Debug)]
pub(crate) struct Gates {
    files: Semaphore,
    memory: Room,
    memory_bytes: u64,
}

/// A file's seat: what it needs is found out while it is held.
#[derive(Debug)]
pub(crate) struct Seat<'a> {
    file: SemaphorePermit<'a>,
    gates: &'a Gates,
}

/// Held while the values of a file are worked on.
#[derive(Debug)]
pub(crate) struct Pass<'a> {
    _file: SemaphorePermit<'a>,
    _memory: Taken,
}

impl Gates {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            files: Semaphore::new(settings.parallel_files.clamp(1, 64)),
            memory: Room::new(settings.parallel_bytes),
            memory_bytes: settings.parallel_bytes,
        }
    }

    /// Waits until there is memory for work that needs no seat.
    pub(crate) async fn memory(&self, bytes: u64) -> Taken {
        self.memory.take(bytes).await
    }

    /// Waits until there is a seat for a file.
    pub(crate) async fn seat(&self) -> Seat<'_> {
        let file = self.files.acquire().await;
        Seat {
            file: file.expect("the gates are never closed"),
            gates: self,
        }
    }
}

impl<'a> Seat<'a> {
    /// Waits until there is memory for the file; one that needs more than all of it has it alone.
    ///
    /// It takes the seat, so that a file asks once: always a seat first and then memory, and nobody who holds memory
    /// waits for either.
    pub(crate) async fn with_memory(self, bytes: u64) -> Pass<'a> {
        let Gates {
            memory,
            memory_bytes,
            ..
        } = self.gates;
        if bytes > *memory_bytes {
            tracing::info!(
                bytes,
                limit_bytes = memory_bytes,
                "a file needs more memory than files may have together; it is worked on alone"
            );
        }
        Pass {
            _memory: memory.take(bytes).await,
            _file: self.file,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::room::UNIT_BYTES;
    use crate::settings::DecoderCommand;
    use futures::FutureExt as _;

    fn gates(units: u64) -> Gates {
        let program = "/nowhere".into();
        let arguments = vec![];
        let settings = Settings::with_decoder(DecoderCommand { program, arguments });
        Gates::new(&Settings {
            parallel_files: 2,
            parallel_bytes: units * UNIT_BYTES,
            ..settings
        })
    }

    async fn enter(gates: &Gates, units: u64) -> Pass<'_> {
        gates.seat().await.with_memory(units * UNIT_BYTES).await
    }

    #[test]
    fn a_file_larger_than_all_memory_goes_alone_and_ends() {
        let gates = gates(4);
        let small = enter(&gates, 1).now_or_never().unwrap();
        let mut large = Box::pin(enter(&gates, 400));
        assert!(large.as_mut().now_or_never().is_none(), "it is not alone");
        drop(small);
        let alone = large.now_or_never().expect("it is alone now");
        assert!(
            enter(&gates, 1).now_or_never().is_none(),
            "nobody is beside it"
        );
        drop(alone);
        assert!(enter(&gates, 1).now_or_never().is_some());
    }

    #[test]
    fn files_are_bounded_by_number_and_by_memory() {
        let gates = gates(4);
        let first = enter(&gates, 2).now_or_never().unwrap();
        assert!(enter(&gates, 3).now_or_never().is_none(), "memory");
        let second = enter(&gates, 1).now_or_never().unwrap();
        assert!(enter(&gates, 1).now_or_never().is_none(), "files");
        drop((first, second));
    }
}
