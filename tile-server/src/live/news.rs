//! What viewers are told: each item once and in order, those missed during a short absence included.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use contract::manifest::ManifestId;
use contract::time::Period;
use serde::Serialize;
use tokio::sync::broadcast;

use crate::error::ServerError;

/// Items kept for those who come back.
const KEPT: usize = 256;
/// Items that a listener may be behind before it is dropped: it then comes back and is told from the kept ones.
const BEHIND: usize = 64;
/// Listeners at the same time.
const MOST_LISTENERS: usize = 4096;

/// A new version of a product.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Item {
    /// Number, rising.
    #[serde(skip)]
    pub id: u64,
    /// Name of the product.
    pub product: String,
    /// The new version.
    pub manifest: ManifestId,
    /// Times whose pictures changed.
    pub touched: Vec<Period>,
}

/// The news of one server.
#[derive(Debug)]
pub struct News {
    kept: Mutex<VecDeque<Arc<Item>>>,
    sender: broadcast::Sender<Arc<Item>>,
    /// Numbers begin with the time of the start, so that a number of an earlier run is never taken for one of this.
    first_id: u64,
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
            kept: Mutex::default(),
            sender: broadcast::Sender::new(BEHIND),
            first_id,
        }
    }

    /// Tells all listeners.
    pub fn tell(&self, manifest: ManifestId, touched: Vec<Period>) {
        let mut kept = self.lock();
        let id = kept.back().map_or(self.first_id, |last| last.id) + 1;
        let item = Arc::new(Item {
            id,
            product: manifest.product.to_string(),
            manifest,
            touched,
        });
        kept.push_back(Arc::clone(&item));
        if kept.len() > KEPT {
            kept.pop_front();
        }
        // Sent under the lock, so that whoever subscribes sees an item either kept or sent, never both.
        // Nobody listening is no failure.
        drop(self.sender.send(item));
    }

    /// Listens from now on, after what is kept since item `last`.
    pub fn listen(&self, last: Option<u64>) -> Result<Listener, ServerError> {
        let kept = self.lock();
        if self.sender.receiver_count() >= MOST_LISTENERS {
            return Err(ServerError::TooManyListeners);
        }
        let missed = kept
            .iter()
            .filter(|item| last.is_some_and(|last| item.id > last));
        Ok(Listener {
            missed: missed.cloned().collect(),
            receiver: self.sender.subscribe(),
        })
    }

    /// Listeners now.
    pub fn listeners(&self) -> usize {
        self.sender.receiver_count()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Arc<Item>>> {
        // One push and one pop: a poisoned lock guards a whole queue.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
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
    async fn a_slow_listener_is_dropped() {
        let news = News::new(0);
        let mut listener = news.listen(None).unwrap();
        for number in 1..=(BEHIND as u64 + 1) {
            news.tell(manifest(number), vec![]);
        }
        assert!(listener.next().await.is_none());
    }
}
