//! What is made on other cores while this one goes on.

use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

/// Something that may be still under way; whoever looks at it waits until it is there. Clones share it.
#[derive(Debug)]
pub struct Later<T>(Arc<OnceLock<Option<T>>>);

impl<T> Clone for Later<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T: Default> Default for Later<T> {
    fn default() -> Self {
        Self::ready(T::default())
    }
}

impl<T> Later<T> {
    /// What is there already.
    pub fn ready(made: T) -> Self {
        Self(Arc::new(OnceLock::from(Some(made))))
    }

    /// Is it there, so that looking at it does not wait?
    pub fn is_ready(&self) -> bool {
        self.0.get().is_some()
    }
}

impl<T: Send + Sync + 'static> Later<T> {
    /// Begins to make it on the pool of threads. Nobody on that pool may wait for it.
    pub fn begun(make: impl FnOnce() -> T + Send + 'static) -> Self {
        let later = Self(Arc::default());
        let place = Arc::clone(&later.0);
        rayon::spawn(move || {
            // Who waits is told of a panic, and goes on to tell the next one.
            let made = catch_unwind(AssertUnwindSafe(make)).ok();
            drop(place.set(made));
        });
        later
    }
}

impl<T> Deref for Later<T> {
    type Target = T;

    fn deref(&self) -> &T {
        let made = self.0.wait().as_ref();
        made.expect("making it did not panic")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    #[test]
    fn what_is_under_way_is_waited_for() {
        let (go, wait) = sync_channel::<u32>(1);
        let later = Later::begun(move || wait.recv().unwrap());
        let same = later.clone();
        assert!(!later.is_ready());
        go.send(7).unwrap();
        assert_eq!((*later, *same), (7, 7));
        assert!(later.is_ready() && Later::ready(1).is_ready());
    }

    #[test]
    fn who_waits_for_what_panics_does_not_wait_for_ever() {
        let later: Later<u32> = Later::begun(|| panic!("planned"));
        assert!(catch_unwind(AssertUnwindSafe(|| *later)).is_err());
    }
}
