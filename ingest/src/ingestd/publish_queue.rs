//! Files on their way: which may be published now, or have their observations stored, so that what must keep its order keeps it.

use std::collections::{BTreeMap, BTreeSet};

use contract::product::ProductId;

/// A file's place in the order in which files came.
pub(super) type Number = u64;

/// Files that are not published yet.
#[derive(Debug)]
pub(super) struct PublishQueue<T> {
    files: BTreeMap<Number, File<T>>,
    /// Products that are being published, and datasets that observations are stored in: one at a time each, so that a process does not
    /// race with itself.
    busy: BTreeSet<ProductId>,
}

#[derive(Debug)]
struct File<T> {
    /// Files of one key are published in the order in which they came.
    key: String,
    state: State<T>,
}

#[derive(Debug)]
enum State<T> {
    Preparing,
    Ready(ProductId, T),
    Publishing,
}

impl<T> Default for PublishQueue<T> {
    fn default() -> Self {
        Self {
            files: BTreeMap::new(),
            busy: BTreeSet::new(),
        }
    }
}

impl<T> PublishQueue<T> {
    /// A file came.
    pub(super) fn add(&mut self, number: Number, key: String) {
        let state = State::Preparing;
        self.files.insert(number, File { key, state });
    }

    /// A file can be published.
    pub(super) fn ready(&mut self, number: Number, product: ProductId, file: T) {
        if let Some(entry) = self.files.get_mut(&number) {
            entry.state = State::Ready(product, file);
        }
    }

    /// A file has been answered.
    pub(super) fn remove(&mut self, number: Number) {
        self.files.remove(&number);
    }

    /// Is any file not ready yet?
    pub(super) fn is_preparing(&self) -> bool {
        let mut files = self.files.values();
        files.any(|file| matches!(file.state, State::Preparing))
    }

    /// Is a product being published?
    pub(super) fn is_busy(&self, product: &ProductId) -> bool {
        self.busy.contains(product)
    }

    /// A product is no longer being published.
    pub(super) fn free(&mut self, product: &ProductId) {
        self.busy.remove(product);
    }

    /// What may be published now: every ready file that no earlier file of its key must go before.
    pub(super) fn take(&mut self) -> BTreeMap<ProductId, Vec<(Number, T)>> {
        let mut taken: BTreeMap<ProductId, Vec<(Number, T)>> = BTreeMap::new();
        let mut waiting: BTreeSet<&str> = BTreeSet::new();
        for (number, file) in &mut self.files {
            let must_wait = match &file.state {
                State::Preparing | State::Publishing => true,
                State::Ready(product, _) => {
                    waiting.contains(file.key.as_str()) || self.busy.contains(product)
                }
            };
            if must_wait {
                waiting.insert(&file.key);
                continue;
            }
            if let State::Ready(product, ready) =
                std::mem::replace(&mut file.state, State::Publishing)
            {
                taken.entry(product).or_default().push((*number, ready));
            }
        }
        self.busy.extend(taken.keys().cloned());
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(name: &str) -> ProductId {
        name.parse().unwrap()
    }

    fn numbers(taken: &BTreeMap<ProductId, Vec<(Number, ())>>) -> Vec<(&str, Vec<Number>)> {
        let numbers = |files: &Vec<(Number, ())>| files.iter().map(|(n, ())| *n).collect();
        taken
            .iter()
            .map(|(p, files)| (p.as_str(), numbers(files)))
            .collect()
    }

    #[test]
    fn files_of_one_key_keep_their_order_and_others_overtake() {
        let mut queue = PublishQueue::default();
        for (number, key) in [(1, "k"), (2, "k"), (3, "other")] {
            queue.add(number, key.to_owned());
        }
        queue.ready(2, product("p"), ());
        queue.ready(3, product("p"), ());
        assert_eq!(
            numbers(&queue.take()),
            [("p", vec![3])],
            "1 is slow, 2 must wait for it"
        );
        queue.ready(1, product("p"), ());
        assert!(queue.take().is_empty(), "p is being published");
        queue.remove(3);
        queue.free(&product("p"));
        assert_eq!(
            numbers(&queue.take()),
            [("p", vec![1, 2])],
            "together, in order"
        );
    }

    #[test]
    fn an_answered_file_holds_nobody_up() {
        let mut queue = PublishQueue::default();
        queue.add(1, "k".to_owned());
        queue.add(2, "k".to_owned());
        queue.ready(2, product("p"), ());
        assert!(queue.take().is_empty());
        queue.remove(1);
        assert_eq!(numbers(&queue.take()), [("p", vec![2])]);
    }

    #[test]
    fn a_file_behind_a_busy_product_holds_its_key() {
        let mut queue = PublishQueue::default();
        for (number, key) in [(1, "a"), (2, "b"), (3, "b")] {
            queue.add(number, key.to_owned());
        }
        queue.ready(1, product("p"), ());
        assert_eq!(queue.take().len(), 1);
        queue.ready(2, product("p"), ());
        queue.ready(3, product("q"), ());
        assert!(
            queue.take().is_empty(),
            "3 comes after 2, which waits for p"
        );
    }
}
