//! A Kafka client that ends on a thread of its own: its end waits for brokers and must not hold up anybody else.

use std::ops::Deref;
use std::sync::Arc;

/// Shared; the last holder ends it.
pub(crate) struct OffThread<T: Send + Sync + 'static>(Option<Arc<T>>);

impl<T: Send + Sync + 'static> OffThread<T> {
    pub(crate) fn new(client: T) -> Self {
        Self(Some(Arc::new(client)))
    }

    /// Is it the same client?
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }

    /// The client itself, if this is the last holder.
    pub(crate) fn into_last(mut self) -> Option<T> {
        self.0.take().and_then(Arc::into_inner)
    }
}

impl<T: Send + Sync + 'static> Clone for OffThread<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: Send + Sync + 'static> Deref for OffThread<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0
            .as_ref()
            .expect("the client is taken out by value or by drop only")
    }
}

impl<T: Send + Sync + 'static> Drop for OffThread<T> {
    fn drop(&mut self) {
        let Some(client) = self.0.take().and_then(Arc::into_inner) else {
            return;
        };
        let thread = std::thread::Builder::new().name("kafka-end".to_owned());
        if let Err(error) = thread.spawn(move || drop(client)) {
            tracing::warn!(%error, "a Kafka client ended on the thread that used it");
        }
    }
}
