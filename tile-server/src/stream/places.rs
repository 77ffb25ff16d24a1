//! How many streams there are, and their common end.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

use crate::error::ServerError;

/// Places of streams; as many are open at most.
#[derive(Debug)]
pub(crate) struct Places {
    free: Arc<Semaphore>,
    ending: watch::Sender<bool>,
}

/// One stream's place, given back when it ends.
#[derive(Debug)]
pub(crate) struct Place {
    _permit: OwnedSemaphorePermit,
    ending: watch::Receiver<bool>,
}

impl Places {
    /// So many.
    pub(crate) fn new(count: u32) -> Self {
        Self {
            free: Arc::new(Semaphore::new(count as usize)),
            ending: watch::Sender::new(false),
        }
    }

    /// Takes a place.
    pub(crate) fn take(&self) -> Result<Place, ServerError> {
        if *self.ending.borrow() {
            return Err(ServerError::Stopping);
        }
        let permit = Arc::clone(&self.free).try_acquire_owned();
        Ok(Place {
            _permit: permit.map_err(|_full| ServerError::TooManyStreams)?,
            ending: self.ending.subscribe(),
        })
    }

    /// Ends all streams: they would keep a server from ending.
    pub(crate) fn close(&self) {
        self.ending.send_replace(true);
    }
}

impl Place {
    /// Returns when all streams end.
    pub(crate) async fn ending(&mut self) {
        // The sender is gone only with the server.
        drop(self.ending.wait_for(|ending| *ending).await);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;

    #[test]
    fn a_place_is_free_again_when_its_stream_ends_and_none_after_the_close() {
        let places = Places::new(1);
        let mut first = places.take().unwrap();
        assert!(matches!(places.take(), Err(ServerError::TooManyStreams)));
        assert!(first.ending().now_or_never().is_none());
        places.close();
        assert!(first.ending().now_or_never().is_some());
        drop(first);
        assert!(matches!(places.take(), Err(ServerError::Stopping)));
    }
}
