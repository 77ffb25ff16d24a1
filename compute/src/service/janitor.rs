//! Looks after the folder of intermediate results: forgotten ones go, and while there are too many others no task is asked for.

use std::sync::Arc;
use std::time::Duration;

use futures::future;
use prometheus::IntGauge;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::work::WorkFolder;

/// How often the work folder is looked at.
const TIDY_INTERVAL: Duration = Duration::from_secs(10);
/// How often in between the hands that are held back pass by whoever waits for one.
const TURNS: u32 = 10;
/// Intermediate results that nobody wrote to for so long belong to queries that nobody remembers.
const FORGOTTEN: Duration = Duration::from_hours(2);

/// Removes forgotten intermediate results, and takes no new task while there are too many others.
pub(super) struct Janitor {
    pub(super) work: Arc<WorkFolder>,
    pub(super) work_bytes: IntGauge,
    pub(super) limit_bytes: u64,
    /// What a task holds one of.
    pub(super) hands: Arc<Semaphore>,
}

impl Janitor {
    pub(super) async fn run(self) {
        let mut held = vec![];
        loop {
            let work = Arc::clone(&self.work);
            let tidied = tokio::task::spawn_blocking(move || work.tidy(FORGOTTEN)).await;
            let bytes = tidied.unwrap_or(0);
            self.work_bytes.set(bytes as i64);
            if bytes <= self.limit_bytes {
                held.clear();
                tokio::time::sleep(TIDY_INTERVAL).await;
                continue;
            }
            let limit_bytes = self.limit_bytes;
            tracing::warn!(
                bytes,
                limit_bytes,
                "too many intermediate results: no new task"
            );
            for _turn in 0..TURNS {
                self.hold_back(&mut held).await;
            }
        }
    }

    /// Takes the hands that are free or become so within a turn, and gives one of those held before to whoever waits already.
    ///
    /// The loop that asks the scheduler may have been given tasks while hands were taken. It waits for a hand for each of them,
    /// without a limit, and neither reports what ended nor hears what may be removed meanwhile: it gets one a turn. Where it has
    /// no task it puts the hand back at once, where this is next in line for it, and asks for none: no hand is seen free.
    async fn hold_back(&self, held: &mut Vec<OwnedSemaphorePermit>) {
        let given = held.pop();
        let take = async {
            while let Ok(hand) = Arc::clone(&self.hands).acquire_owned().await {
                held.push(hand);
            }
        };
        // In this order: this stands in line, behind whoever waits, before the hand is let go.
        let turn = future::join(take, async { drop(given) });
        let _over = tokio::time::timeout(TIDY_INTERVAL / TURNS, turn).await;
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::fs;
    use std::path::Path;

    use super::super::background::Background;
    use super::*;

    /// Time after which a test that waits has failed.
    const LIMIT: Duration = Duration::from_secs(30);

    /// A janitor at work in whose folder there is too much; all hands that were free are held back.
    pub(in crate::service) async fn over_its_limit(
        hands: &Arc<Semaphore>,
        root: &Path,
    ) -> Background<()> {
        let (work, _gone) = WorkFolder::make(root, "a").unwrap();
        fs::write(work.path().join("result"), "x").unwrap();
        let janitor = Janitor {
            work: Arc::new(work),
            work_bytes: IntGauge::new("work_bytes", "Bytes.").unwrap(),
            limit_bytes: 0,
            hands: Arc::clone(hands),
        };
        let janitor = Background(tokio::spawn(janitor.run()));
        let all_held = async {
            while hands.available_permits() > 0 {
                tokio::task::yield_now().await;
            }
        };
        let in_time = tokio::time::timeout(LIMIT, all_held).await;
        in_time.expect("hands are held back");
        janitor
    }

    #[tokio::test]
    async fn a_task_that_came_while_hands_were_taken_gets_one_and_no_other_is_asked_for() {
        let root = tempfile::tempdir().unwrap();
        for count in [1, 2] {
            let hands = Arc::new(Semaphore::new(count));
            let busy = (1..count).map(|_task| Arc::clone(&hands).try_acquire_owned().unwrap());
            let busy: Vec<_> = busy.collect();
            let folder = root.path().join(count.to_string());
            let _janitor = over_its_limit(&hands, &folder).await;
            drop(busy);
            assert_eq!(hands.available_permits(), 0, "hands that are done are free");
            for _task in 0..2 {
                let hand = Arc::clone(&hands).acquire_owned();
                let hand = tokio::time::timeout(TIDY_INTERVAL, hand).await;
                drop(hand.expect("it waits for a hand that nobody uses").unwrap());
                assert_eq!(hands.available_permits(), 0, "a task would be asked for");
            }
        }
    }
}
