//! Work in the background that ends with its owner.

use tokio::task::JoinHandle;

/// A task that is ended when this is dropped.
pub(super) struct Background<T>(pub(super) JoinHandle<T>);

impl<T> Background<T> {
    /// Ends it, and waits until it holds nothing any more.
    pub(super) async fn end(mut self) {
        self.0.abort();
        let _ended = (&mut self.0).await;
    }
}

impl<T> Drop for Background<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}
