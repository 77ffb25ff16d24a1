//! What is made once of something for each domain that it is weighed by, and kept with it.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Domains whose results are kept: one of a product's versions, and those of products that are drawn with it.
const MOST_DOMAINS: usize = 4;

/// What is made by the first who wants it.
type Place<T> = Arc<OnceLock<Arc<T>>>;

/// Results by the domain that they are of, the newest last.
#[derive(Debug)]
pub(crate) struct ByDomain<T>(Mutex<Vec<(u64, Place<T>)>>);

impl<T> ByDomain<T> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(vec![]))
    }

    /// What was made for a domain, or is made now; who wants it meanwhile waits for it and for nothing else.
    pub(crate) fn get_or_init(&self, domain: u64, make: impl FnOnce() -> Arc<T>) -> Arc<T> {
        let place = {
            // Whoever panicked here left a list that holds.
            let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((_, place)) = known.iter().find(|(of, _)| *of == domain) {
                Arc::clone(place)
            } else {
                if known.len() == MOST_DOMAINS {
                    known.remove(0);
                }
                let place = Arc::new(OnceLock::new());
                known.push((domain, Arc::clone(&place)));
                place
            }
        };
        Arc::clone(place.get_or_init(make))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_domain_has_its_own_and_few_are_kept() {
        let made = ByDomain::new();
        for domain in 0..=MOST_DOMAINS as u64 {
            assert_eq!(*made.get_or_init(domain, || Arc::new(domain)), domain);
            assert_eq!(*made.get_or_init(domain, || Arc::new(99)), domain);
        }
        assert_eq!(*made.get_or_init(0, || Arc::new(99)), 99, "it was let go");
    }
}
