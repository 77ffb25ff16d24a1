//! Work in the background that ends with its owner.

use tokio::task::JoinHandle;

/// A task that is ended when this is dropped.
pub(super) struct Background<T>(pub(super) JoinHandle<T>);

impl<T> Drop for Background<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}
