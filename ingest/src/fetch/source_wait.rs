//! Whether a file is waited for because its source is slow or away: such a wait takes no place from other notices.

use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A file that is there within this time was not waited for.
const PROMPT: Duration = Duration::from_secs(2);

/// Is a file waited for? Clones share it.
#[derive(Debug, Clone, Default)]
pub(crate) struct SourceWait(Arc<AtomicBool>);

impl SourceWait {
    pub(crate) fn is_long(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Has a file from its source.
    pub(crate) async fn during<T>(&self, fetch: impl Future<Output = T>) -> T {
        let mut fetch = pin!(fetch);
        if let Ok(prompt) = tokio::time::timeout(PROMPT, &mut fetch).await {
            return prompt;
        }
        self.0.store(true, Ordering::Relaxed);
        let late = fetch.await;
        self.0.store(false, Ordering::Relaxed);
        late
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_wait_is_long_while_it_lasts() {
        let wait = SourceWait::default();
        let seen = wait.clone();
        let fetch = async {
            assert!(!seen.is_long());
            while !seen.is_long() {
                tokio::time::sleep(PROMPT / 100).await;
            }
            7
        };
        assert_eq!(wait.during(fetch).await, 7);
        assert!(!wait.is_long());
        let is_long = wait.during(async { wait.is_long() }).await;
        assert!(!is_long, "one that is there at once is not waited for");
    }
}
