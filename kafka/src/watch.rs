//! Finds clients that have lost their brokers, so that others take their place.
//!
//! The only broker of a cluster may answer, while it stops or starts, that there are no brokers. The library then forgets
//! those it knew, has nobody left to ask for others, reports nothing and waits for ever (librdkafka 2.12, its issue 5301).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rdkafka::consumer::{Consumer as _, ConsumerContext, StreamConsumer};
use tokio::sync::Notify;
use tokio::task::JoinHandle;

use crate::off_thread::OffThread;

/// How often a client is made to ask its brokers something.
const EVERY: Duration = Duration::from_secs(5);
/// How long it may go without an answer: brokers that are busy answer later than that they are there.
const LIMIT: Duration = Duration::from_secs(10);
/// How long the end of a watch may have to wait.
const TURN: Duration = Duration::from_secs(1);
const AGAIN_PAUSE: Duration = Duration::from_millis(50);

/// Over one client; ends when dropped, and holds the client a second longer at most.
pub(crate) struct Watch {
    shared: Arc<Shared>,
    task: JoinHandle<()>,
}

#[derive(Default)]
struct Shared {
    is_lost: AtomicBool,
    is_ended: AtomicBool,
    ended: Notify,
}

impl Watch {
    pub(crate) fn start<C: ConsumerContext + 'static>(
        client: &OffThread<StreamConsumer<C>>,
        topic: String,
    ) -> Self {
        let shared = Arc::new(Shared::default());
        let (client, of_task) = (client.clone(), Arc::clone(&shared));
        let task = tokio::spawn(async move { watch(client, topic, &of_task).await });
        Self { shared, task }
    }

    /// Must the client be replaced?
    pub(crate) fn is_lost(&self) -> bool {
        self.shared.is_lost.load(Ordering::Acquire)
    }

    /// Ends it and waits until it holds the client no more.
    pub(crate) async fn end(mut self) {
        self.shared.end();
        if let Err(error) = (&mut self.task).await {
            tracing::warn!(%error, "the watch over a Kafka client ended badly");
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.end();
    }
}

impl Shared {
    fn end(&self) {
        self.is_ended.store(true, Ordering::Release);
        self.ended.notify_one();
    }

    fn is_ended(&self) -> bool {
        self.is_ended.load(Ordering::Acquire)
    }
}

async fn watch<C: ConsumerContext + 'static>(
    client: OffThread<StreamConsumer<C>>,
    topic: String,
    shared: &Arc<Shared>,
) {
    while tokio::time::timeout(EVERY, shared.ended.notified())
        .await
        .is_err()
    {
        let (client, of_call, name) = (client.clone(), Arc::clone(shared), topic.clone());
        let asked = tokio::task::spawn_blocking(move || has_brokers(&client, &name, &of_call));
        match asked.await {
            Ok(true) => {}
            Ok(false) => {
                tracing::warn!(
                    topic,
                    "a Kafka client has had no answer for {} s; another takes its place",
                    LIMIT.as_secs()
                );
                shared.is_lost.store(true, Ordering::Release);
                return;
            }
            // The process is ending.
            Err(_cancelled) => return,
        }
    }
}

fn has_brokers<C: ConsumerContext>(
    client: &StreamConsumer<C>,
    topic: &str,
    shared: &Shared,
) -> bool {
    let until = Instant::now() + LIMIT;
    while !shared.is_ended() {
        if client.fetch_metadata(Some(topic), TURN).is_ok() {
            return true;
        }
        if Instant::now() >= until {
            return false;
        }
        std::thread::sleep(AGAIN_PAUSE);
    }
    true
}
