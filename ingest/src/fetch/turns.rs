//! How many files are fetched at the same time, of each source and of all: one that is slow or away holds up its own files
//! and no others.

use std::collections::BTreeMap;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Files that are fetched from one source at the same time; those that wait for it to come back are not counted.
const PER_SOURCE: usize = 4;
/// And from all sources.
const ALTOGETHER: usize = 32;
/// How often a file that waits for its turn looks whether its source is given up.
const LOOK: Duration = Duration::from_millis(250);

/// Turns to fetch, of all sources that somebody fetches from.
#[derive(Debug)]
pub(super) struct Turns {
    all: Arc<Semaphore>,
    sources: Mutex<BTreeMap<String, Arc<Source>>>,
}

/// Where files come from: a host and port, a bucket, the disks of this machine.
#[derive(Debug)]
pub(super) struct Source {
    turns: Arc<Semaphore>,
    away: Mutex<Option<Away>>,
}

/// A source that does not answer, or is out of order.
#[derive(Debug, Clone)]
struct Away {
    since: Instant,
    why: String,
}

/// A file's turn, over when dropped.
#[derive(Debug)]
pub(super) struct Turn {
    _of_source: OwnedSemaphorePermit,
    _of_all: OwnedSemaphorePermit,
}

impl Default for Turns {
    fn default() -> Self {
        Self {
            all: Arc::new(Semaphore::new(ALTOGETHER)),
            sources: Mutex::default(),
        }
    }
}

impl Turns {
    /// The source of a name; it is forgotten with the last file that is fetched from it.
    pub(super) fn source(&self, name: String) -> Arc<Source> {
        // A panic elsewhere leaves a map that is whole.
        let mut sources = self.sources.lock().unwrap_or_else(PoisonError::into_inner);
        sources.retain(|_, source| Arc::strong_count(source) > 1);
        Arc::clone(sources.entry(name).or_default())
    }

    /// Waits for a turn. If the source is away for as long as `away_limit` meanwhile, why it is instead: whoever waits does
    /// not ask again what others have just been told.
    pub(super) async fn take(&self, source: &Source, away_limit: Duration) -> Result<Turn, String> {
        let begun = Instant::now();
        let mut own = pin!(Arc::clone(&source.turns).acquire_owned());
        let of_source = loop {
            match tokio::time::timeout(LOOK, &mut own).await {
                Ok(turn) => break turn.expect("turns are never closed"),
                Err(_looking) => source.check(begun, away_limit)?,
            }
        };
        let of_all = Arc::clone(&self.all).acquire_owned().await;
        Ok(Turn {
            _of_source: of_source,
            _of_all: of_all.expect("turns are never closed"),
        })
    }
}

impl Default for Source {
    fn default() -> Self {
        Self {
            turns: Arc::new(Semaphore::new(PER_SOURCE)),
            away: Mutex::default(),
        }
    }
}

impl Source {
    fn state(&self) -> MutexGuard<'_, Option<Away>> {
        self.away.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It answered, be it that it has no such file.
    pub(super) fn answered(&self) {
        *self.state() = None;
    }

    /// It did not answer, or said that it is out of order.
    pub(super) fn is_away(&self, why: &str) {
        let mut state = self.state();
        let since = state.as_ref().map_or_else(Instant::now, |away| away.since);
        let why = why.to_owned();
        *state = Some(Away { since, why });
    }

    /// Why it is away, if it was for so long while somebody waited who began at an instant.
    fn check(&self, begun: Instant, away_limit: Duration) -> Result<(), String> {
        let away = self.state().clone();
        match away {
            Some(Away { since, why }) if since.max(begun).elapsed() >= away_limit => Err(why),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;

    const AWAY_LIMIT: Duration = Duration::from_mins(5);

    fn taken(turns: &Turns, source: &Source) -> Option<Turn> {
        turns
            .take(source, AWAY_LIMIT)
            .now_or_never()
            .map(Result::unwrap)
    }

    #[tokio::test]
    async fn a_source_whose_turns_are_taken_leaves_those_of_others() {
        let turns = Turns::default();
        let (slow, other) = (turns.source("slow".into()), turns.source("other".into()));
        let held: Vec<Turn> = (0..PER_SOURCE)
            .map(|_| taken(&turns, &slow).unwrap())
            .collect();
        assert!(taken(&turns, &slow).is_none());
        assert!(taken(&turns, &turns.source("slow".into())).is_none());
        assert!(taken(&turns, &other).is_some());
        drop(held);
        assert!(taken(&turns, &slow).is_some());
    }

    #[tokio::test]
    async fn all_sources_together_have_so_many_turns() {
        let turns = Turns::default();
        let sources: Vec<_> = (0..=ALTOGETHER)
            .map(|n| turns.source(n.to_string()))
            .collect();
        let held: Vec<Turn> = sources
            .iter()
            .map_while(|source| taken(&turns, source))
            .collect();
        assert_eq!(held.len(), ALTOGETHER);
    }

    #[tokio::test]
    async fn whoever_waits_for_a_source_that_stays_away_is_told_so() {
        let turns = Turns::default();
        let source = turns.source("away".into());
        let held: Vec<Turn> = (0..PER_SOURCE)
            .map(|_| taken(&turns, &source).unwrap())
            .collect();
        source.is_away("no answer");
        let waiting = turns.take(&source, Duration::ZERO);
        let told = tokio::time::timeout(Duration::from_mins(1), waiting).await;
        assert_eq!(told.unwrap().unwrap_err(), "no answer");
        // One that answers is waited for, however long.
        source.answered();
        let waiting = turns.take(&source, Duration::ZERO);
        let late = tokio::time::timeout(LOOK * 4, waiting).await;
        assert!(late.is_err());
        drop(held);
        assert!(turns.take(&source, Duration::ZERO).await.is_ok());
    }
}
