//! How the parts of the server were when they were last asked: many may ask whether it is ready, the parts are asked by one
//! at a time and not more often than that.

use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::http::StatusCode;
use tokio::sync::Mutex;

/// An answer that others may have too: its status and its body.
pub(crate) type Said = (StatusCode, Bytes);

/// The last answer.
#[derive(Debug, Default)]
pub(crate) struct Readiness(Mutex<Option<(Instant, Said)>>);

impl Readiness {
    /// The last answer if it is no older than `age`, else that of `ask`, which others wait for. Whoever goes away while he
    /// asks leaves it to the next one.
    pub(crate) async fn within(&self, age: Duration, ask: impl Future<Output = Said>) -> Said {
        let mut last = self.0.lock().await;
        if let Some((at, said)) = last.as_ref()
            && at.elapsed() < age
        {
            return said.clone();
        }
        let said = ask.await;
        *last = Some((Instant::now(), said.clone()));
        said
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use futures::FutureExt as _;
    use futures::future::join_all;

    use super::*;

    const LONG: Duration = Duration::from_hours(1);

    #[tokio::test]
    async fn a_crowd_asks_the_parts_once_and_whoever_wants_it_fresh_again() {
        let (readiness, asked) = (Readiness::default(), AtomicUsize::new(0));
        let ask = async |age| {
            let parts = async {
                tokio::task::yield_now().await;
                let count = asked.fetch_add(1, Ordering::SeqCst);
                (StatusCode::OK, Bytes::from(count.to_string()))
            };
            readiness.within(age, parts).await.1
        };
        let crowd = join_all((0..50).map(|_| ask(LONG))).await;
        assert!(crowd.iter().all(|said| said == "0"), "{crowd:?}");
        assert_eq!(ask(Duration::ZERO).await, "1");
        assert_eq!(ask(LONG).await, "1");
    }

    #[tokio::test]
    async fn whoever_goes_away_while_he_asks_keeps_nobody_waiting() {
        let readiness = Readiness::default();
        let mut gone = Box::pin(readiness.within(LONG, std::future::pending()));
        assert!(gone.as_mut().now_or_never().is_none());
        drop(gone);
        let said = (StatusCode::OK, Bytes::new());
        let asking = readiness.within(LONG, std::future::ready(said.clone()));
        assert_eq!(asking.now_or_never(), Some(said));
    }
}
