//! Things by key that are kept while there is room, the least recently used first to go.

use std::collections::BTreeMap;

/// What was used lately.
pub(crate) struct Recent<K, V> {
    by_key: BTreeMap<K, (V, u64)>,
    uses: u64,
}

impl<K, V> Default for Recent<K, V> {
    fn default() -> Self {
        Self {
            by_key: BTreeMap::new(),
            uses: 0,
        }
    }
}

impl<K: Ord + Clone, V: Clone> Recent<K, V> {
    /// The thing of a key, which is now the last used.
    pub(crate) fn get(&mut self, key: &K) -> Option<V> {
        self.uses += 1;
        let (value, last_use) = self.by_key.get_mut(key)?;
        *last_use = self.uses;
        Some(value.clone())
    }

    /// Keeps a thing and drops the oldest ones as long as together they weigh more than `most`; the last one stays.
    pub(crate) fn keep(&mut self, key: K, value: V, most: u64, weight: impl Fn(&V) -> u64) {
        self.uses += 1;
        self.by_key.insert(key, (value, self.uses));
        let mut sum = self.sum(&weight);
        while sum > most && self.by_key.len() > 1 {
            let oldest = self.by_key.iter().min_by_key(|(_, held)| held.1);
            let Some(oldest) = oldest.map(|(key, _)| key.clone()) else {
                return;
            };
            if let Some((dropped, _)) = self.by_key.remove(&oldest) {
                sum -= weight(&dropped);
            }
        }
    }

    /// What all of them weigh.
    pub(crate) fn sum(&self, weight: impl Fn(&V) -> u64) -> u64 {
        self.by_key.values().map(|(value, _)| weight(value)).sum()
    }

    /// Keys in their order.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &K> {
        self.by_key.keys()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_longest_ago_goes_first_and_the_last_one_stays() {
        let mut recent = Recent::default();
        for key in ["a", "b", "c"] {
            recent.keep(key, 4, 12, |weight| *weight);
        }
        assert_eq!(recent.get(&"a"), Some(4));
        recent.keep("d", 4, 12, |weight| *weight);
        assert_eq!(recent.keys().copied().collect::<Vec<_>>(), ["a", "c", "d"]);
        recent.keep("large", 100, 12, |weight| *weight);
        assert_eq!(recent.keys().copied().collect::<Vec<_>>(), ["large"]);
        assert_eq!(recent.sum(|weight| *weight), 100);
    }
}
