//! What went wrong with a device, noted when the driver tells and asked for when a picture is read back.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::error::RenderError;

/// The first fault of a device. It stays: a device with a fault draws nothing more.
#[derive(Debug, Clone, Default)]
pub(super) struct FaultNote {
    first: Arc<OnceLock<Fault>>,
    /// Kept apart from the first fault: a lost device is told of in a callback that must not wait.
    text: Arc<Mutex<String>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    OutOfMemory,
    Stopped,
}

impl FaultNote {
    /// Listens to a device, which else would end the process at its first fault.
    pub(super) fn listen(&self, device: &wgpu::Device) {
        let note = self.clone();
        device.on_uncaptured_error(Arc::new(move |error| note.of_error(&error)));
        let note = self.clone();
        device.set_device_lost_callback(move |reason, text| {
            // A device that was dropped in order is "destroyed" too; nobody draws on it any more.
            note.keep(Fault::Stopped, format!("{reason:?}: {text}"));
        });
    }

    fn of_error(&self, error: &wgpu::Error) {
        let fault = match error {
            wgpu::Error::OutOfMemory { .. } => Fault::OutOfMemory,
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => Fault::Stopped,
        };
        self.keep(fault, error.to_string());
    }

    /// A device that does not answer, of which the driver has told nothing.
    pub(super) fn note_stopped(&self, text: String) {
        self.keep(Fault::Stopped, text);
    }

    /// Was there one?
    pub(super) fn is_there(&self) -> bool {
        self.first.get().is_some()
    }

    fn keep(&self, fault: Fault, text: String) {
        if self.first.set(fault).is_ok() {
            tracing::debug!(?fault, text, "the graphics device has a fault");
            *self.text.lock().unwrap_or_else(PoisonError::into_inner) = text;
        }
    }

    /// An error if there was a fault; `what` was being done.
    pub(super) fn check(&self, what: &'static str) -> Result<(), RenderError> {
        match self.first.get() {
            None => Ok(()),
            Some(Fault::OutOfMemory) => Err(RenderError::OutOfMemory { what }),
            Some(Fault::Stopped) => {
                let text = self.text.lock().unwrap_or_else(PoisonError::into_inner);
                tracing::warn!(text = text.as_str(), "the graphics device stopped");
                Err(RenderError::DeviceStopped { what })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_fault_decides_and_memory_is_told_from_the_rest() {
        let note = FaultNote::default();
        assert!(note.check("drawing").is_ok());
        note.of_error(&wgpu::Error::OutOfMemory {
            source: "too much".into(),
        });
        note.of_error(&wgpu::Error::Internal {
            source: "later".into(),
            description: "later".into(),
        });
        let error = note.check("drawing").unwrap_err();
        assert!(matches!(error, RenderError::OutOfMemory { .. }) && error.is_device_fault());
        let note = FaultNote::default();
        note.of_error(&wgpu::Error::Validation {
            source: "invalid buffer".into(),
            description: "invalid buffer".into(),
        });
        assert!(matches!(
            note.check("drawing"),
            Err(RenderError::DeviceStopped { .. })
        ));
    }
}
