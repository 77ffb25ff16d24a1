//! The parts of a service that run side by side: the first that ends by itself ends all of them, and the process with
//! its reason. A process that goes on without one of its parts would look well and do nothing.

use std::collections::HashMap;
use std::error::Error;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use tokio::task::{Id, JoinError, JoinSet};

use crate::{Board, Stop};

/// How long the other parts may take to end once one has failed: their own limits may be an hour.
const LAST_WORDS: Duration = Duration::from_mins(1);

type Cause = Box<dyn Error + Send + Sync>;

/// A part that ended although nobody had asked it to.
#[derive(Debug, thiserror::Error)]
#[error("{part} has ended")]
pub struct PartEnded {
    /// Its name.
    pub part: &'static str,
    /// Why.
    #[source]
    pub source: Cause,
}

/// Parts at work.
pub struct Parts {
    stop: Stop,
    board: Arc<Board>,
    tasks: JoinSet<Result<(), Cause>>,
    names: HashMap<Id, &'static str>,
    last_words: Duration,
}

impl Parts {
    /// None yet. They end when `stop` is said, and say it if one of them ends before; `board` tells of that one.
    pub fn new(stop: &Stop, board: &Arc<Board>) -> Self {
        Self {
            stop: stop.clone(),
            board: Arc::clone(board),
            tasks: JoinSet::new(),
            names: HashMap::new(),
            last_words: LAST_WORDS,
        }
    }

    /// Starts one: it must end when asked to stop, and not before.
    pub fn start<E: Into<Cause> + 'static>(
        &mut self,
        name: &'static str,
        part: impl Future<Output = Result<(), E>> + Send + 'static,
    ) {
        let task = async move { part.await.map_err(Into::into) };
        let handle = self.tasks.spawn(task);
        self.names.insert(handle.id(), name);
    }

    /// Waits until all have ended.
    ///
    /// # Errors
    /// The first that failed, panicked, or ended without having been asked to.
    pub async fn run(mut self) -> Result<(), PartEnded> {
        loop {
            let Some(ended) = self.tasks.join_next_with_id().await else {
                return Ok(());
            };
            if let Some(first) = self.judge(ended) {
                self.stop.now();
                self.wait_for_others().await;
                return Err(first);
            }
        }
    }

    /// The others end in their own time, within the limit.
    async fn wait_for_others(&mut self) {
        let all = async {
            while let Some(ended) = self.tasks.join_next_with_id().await {
                // Told of in the log; the first reason is that of the process.
                drop(judge(&self.names, &self.board, true, ended));
            }
        };
        if tokio::time::timeout(self.last_words, all).await.is_err() {
            let limit_s = self.last_words.as_secs();
            tracing::warn!(limit_s, "parts that did not end in time are cut off");
        }
    }

    fn judge(&self, ended: Ended) -> Option<PartEnded> {
        judge(&self.names, &self.board, self.stop.is_said(), ended)
    }
}

type Ended = Result<(Id, Result<(), Cause>), JoinError>;

/// What is wrong with the end of a part, if anything is; the log and the board are told.
fn judge(
    names: &HashMap<Id, &'static str>,
    board: &Board,
    is_stopping: bool,
    ended: Ended,
) -> Option<PartEnded> {
    let (id, source): (Id, Cause) = match ended {
        Ok((_, Ok(()))) if is_stopping => return None,
        Ok((id, Ok(()))) => (id, "nobody had asked it to".into()),
        Ok((id, Err(error))) => (id, error),
        Err(panicked) => (panicked.id(), panicked.into()),
    };
    let part = names.get(&id).copied().unwrap_or("a part");
    tracing::error!(
        part,
        error = in_full(source.as_ref()),
        "has ended; the service ends"
    );
    board.set(part, || async { Err::<String, _>("it has ended") });
    Some(PartEnded { part, source })
}

/// An error and what it came from, in one line.
fn in_full(error: &(dyn Error + 'static)) -> String {
    let (mut text, mut next) = (error.to_string(), error.source());
    while let Some(source) = next {
        text = format!("{text}: {source}");
        next = source.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Readiness as _, Report};
    use tokio::sync::oneshot;

    const BOARD: [&str; 1] = ["store"];

    fn ready() -> (Stop, Arc<Board>) {
        let board = Board::waiting_for(&BOARD);
        board.set("store", || async { Ok::<_, String>("there".to_owned()) });
        (Stop::new(), board)
    }

    async fn is_ready(board: &Board) -> bool {
        Report::of(board.parts().await).ready
    }

    /// How the parts end: a service that goes on over a dead part would keep a test for ever.
    async fn ended(parts: Parts) -> Result<(), PartEnded> {
        let ended = tokio::time::timeout(Duration::from_mins(1), parts.run()).await;
        ended.expect("the service goes on over a dead part")
    }

    /// A part that ends when asked, and tells whether the service called itself ready then. To fail by itself would be of
    /// no use: of parts that end after the first only the log is told.
    async fn lasting(
        stop: Stop,
        board: Arc<Board>,
        was_ready: oneshot::Sender<bool>,
    ) -> Result<(), String> {
        stop.said().await;
        let told = was_ready.send(is_ready(&board).await);
        told.map_err(|_gone| "nobody hears it".to_owned())
    }

    #[tokio::test]
    async fn the_first_lasting_error_ends_all_and_says_why() {
        let (stop, board) = ready();
        let mut parts = Parts::new(&stop, &board);
        let (tell, was_ready) = oneshot::channel();
        parts.start("lasting", lasting(stop.clone(), Arc::clone(&board), tell));
        assert!(is_ready(&board).await);
        parts.start("ingest", async { Err::<(), _>("topic is gone") });
        let error = ended(parts).await.unwrap_err();
        assert_eq!(
            (error.part, error.source.to_string().as_str()),
            ("ingest", "topic is gone")
        );
        assert!(!was_ready.await.unwrap(), "ready over a dead part");
        assert!(!is_ready(&board).await);
        assert!(stop.is_said());
    }

    #[tokio::test]
    async fn a_part_that_panics_or_ends_too_early_is_dead_too() {
        let (stop, board) = ready();
        let mut parts = Parts::new(&stop, &board);
        parts.start("panicking", async {
            assert!(stop_is_far(), "out of cheese");
            Ok::<_, String>(())
        });
        let error = ended(parts).await.unwrap_err();
        assert!(
            error.source.to_string().contains("out of cheese"),
            "{error:?}"
        );

        let (stop, board) = ready();
        let mut parts = Parts::new(&stop, &board);
        parts.start("hasty", async { Ok::<_, String>(()) });
        let (tell, was_ready) = oneshot::channel();
        parts.start("lasting", lasting(stop.clone(), Arc::clone(&board), tell));
        assert_eq!(ended(parts).await.unwrap_err().part, "hasty");
        assert!(!was_ready.await.unwrap(), "ready over a dead part");
    }

    /// Never true: a plain panic would make the rest of the part dead code.
    fn stop_is_far() -> bool {
        std::hint::black_box(false)
    }

    #[tokio::test]
    async fn parts_that_are_asked_to_stop_end_well() {
        let (stop, board) = ready();
        let mut parts = Parts::new(&stop, &board);
        for name in ["one", "other"] {
            let said = stop.said();
            parts.start(name, async {
                said.await;
                Ok::<_, String>(())
            });
        }
        stop.now();
        ended(parts).await.unwrap();
        assert!(is_ready(&board).await);
    }

    #[tokio::test]
    async fn a_part_that_does_not_hear_does_not_keep_the_process_up() {
        let (stop, board) = ready();
        let mut parts = Parts::new(&stop, &board);
        parts.last_words = Duration::from_millis(10);
        parts.start("deaf", std::future::pending::<Result<(), String>>());
        parts.start("failing", async { Err::<(), _>("no") });
        assert_eq!(ended(parts).await.unwrap_err().part, "failing");
    }
}
