//! What viewers are told: each item once and in order, those missed during a short absence included.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use contract::manifest::ManifestId;
use contract::time::Period;
use serde::Serialize;
use tokio::sync::broadcast;
use utoipa::ToSchema;

use crate::error::ServerError;
use crate::openapi::words;

/// Items kept for those who come back.
const KEPT: usize = 256;
/// Items that a listener may be behind before it is dropped: it then comes back and is told from the kept ones.
const BEHIND: usize = 64;
/// Listeners at the same time.
const MOST_LISTENERS: usize = 4096;

/// A new version of a product.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = News)]
pub struct Item {
    /// Number, rising.
    #[serde(skip)]
    pub id: u64,
    /// Name of the product.
    pub product: String,
    /// The new version.
    #[schema(value_type = String)]
    pub manifest: ManifestId,
    /// Times whose pictures changed.
    #[schema(value_type = Vec<words::Period>)]
    pub touched: Vec<Period>,
}

/// The news of one server.
#[derive(Debug)]
pub struct News {
    told: Mutex<Told>,
    /// Numbers begin with the time of the start, so that a number of an earlier run is never taken for one of this.
    first_id: u64,
}

#[derive(Debug)]
struct Told {
    kept: VecDeque<Arc<Item>>,
    /// None once nobody is told any more.
    sender: Option<broadcast::Sender<Arc<Item>>>,
}

/// One who listens.
#[derive(Debug)]
pub struct Listener {
    missed: VecDeque<Arc<Item>>,
    receiver: broadcast::Receiver<Arc<Item>>,
}

impl News {
    /// No news yet; numbers begin after `first_id`.
    pub fn new(first_id: u64) -> Self {
        Self {
            told: Mutex::new(Told {
                kept: VecDeque::new(),
                sender: Some(broadcast::Sender::new(BEHIND)),
            }),
            first_id,
        }
    }

    /// Tells all listeners.
    pub fn tell(&self, manifest: ManifestId, touched: Vec<Period>) {
        let mut told = self.lock();
        let id = told.kept.back().map_or(self.first_id, |last| last.id) + 1;
        let item = Arc::new(Item {
            id,
            product: manifest.product.to_string(),
            manifest,
            touched,
        });
        told.kept.push_back(Arc::clone(&item));
        if told.kept.len() > KEPT {
            told.kept.pop_front();
        }
        // Sent under the lock, so that whoever subscribes sees an item either kept or sent, never both.
        // Nobody listening is no failure.
        drop(told.sender.as_ref().map(|sender| sender.send(item)));
    }

    /// Listens from now on, after what is kept since item `last`.
    pub fn listen(&self, last: Option<u64>) -> Result<Listener, ServerError> {
        let told = self.lock();
        let sender = told.sender.as_ref().ok_or(ServerError::Stopping)?;
        if sender.receiver_count() >= MOST_LISTENERS {
            return Err(ServerError::TooManyListeners);
        }
        let missed = told
            .kept
            .iter()
            .filter(|item| last.is_some_and(|last| item.id > last));
        Ok(Listener {
            missed: missed.cloned().collect(),
            receiver: sender.subscribe(),
        })
    }

    /// Ends all listening, so that connections which would stay for ever do not keep a server from ending.
    pub fn close(&self) {
        self.lock().sender = None;
    }

    /// Is nobody told any more?
    pub(crate) fn is_closed(&self) -> bool {
        self.lock().sender.is_none()
    }

    fn lock(&self) -> MutexGuard<'_, Told> {
        // One push and one pop: a poisoned lock guards a whole queue.
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Listener {
    /// The next item; none when this listener is too slow or the server ends.
    pub async fn next(&mut self) -> Option<Arc<Item>> {
        match self.missed.pop_front() {
            Some(item) => Some(item),
            None => self.receiver.recv().await.ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(number: u64) -> ManifestId {
        format!("p@{number}-00000000").parse().unwrap()
    }

    #[tokio::test]
    async fn who_comes_back_is_told_what_was_missed_and_nothing_twice() {
        let news = News::new(100);
        news.tell(manifest(1), vec![]);
        news.tell(manifest(2), vec![]);
        let mut listener = news.listen(Some(101)).unwrap();
        news.tell(manifest(3), vec![]);
        let mut told = vec![];
        for _ in 0..2 {
            told.push(listener.next().await.unwrap().id);
        }
        assert_eq!(told, [102, 103]);
    }

    #[tokio::test]
    async fn the_end_is_told_to_all_and_nobody_comes_after_it() {
        let news = News::new(0);
        let mut listener = news.listen(None).unwrap();
        news.tell(manifest(1), vec![]);
        news.close();
        assert_eq!(listener.next().await.unwrap().id, 1);
        assert!(listener.next().await.is_none());
        assert!(news.listen(None).unwrap_err().is_retryable());
    }

    #[test]
    fn more_listeners_than_are_served_are_asked_to_come_later() {
        let news = News::new(0);
        let all: Vec<_> = (0..MOST_LISTENERS)
            .map(|_| news.listen(None).unwrap())
            .collect();
        assert!(matches!(
            news.listen(None),
            Err(ServerError::TooManyListeners)
        ));
        drop(all);
        assert!(news.listen(None).is_ok());
    }

    #[tokio::test]
    async fn a_slow_listener_is_dropped() {
        let news = News::new(0);
        let mut listener = news.listen(None).unwrap();
        for number in 1..=(BEHIND as u64 + 1) {
            news.tell(manifest(number), vec![]);
        }
        assert!(listener.next().await.is_none());
    }
}
