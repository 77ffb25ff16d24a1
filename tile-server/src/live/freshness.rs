//! How long it takes from a notice to a picture of what it brought.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use contract::key::ObjectKey;
use contract::manifest::ManifestId;
use contract::time::TimeMs;
use prometheus::{HistogramOpts, HistogramVec, Registry};

/// From a fast machine that waits for nothing to a backlog of an hour, seconds.
const BOUNDS_S: [f64; 12] = [
    0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 900.0, 3600.0,
];
/// Versions and pictures waited for; the oldest names go first.
const MOST: usize = 10_000;

/// What is waited for, and the histogram of how long it took.
#[derive(Debug)]
pub struct Freshness {
    waiting: Mutex<Waiting>,
    seconds: HistogramVec,
}

#[derive(Debug, Default)]
struct Waiting {
    /// First picture of a version that anybody asks for.
    asked: BTreeMap<String, TimeMs>,
    /// Pictures that were ordered.
    ordered: BTreeMap<ObjectKey, TimeMs>,
}

impl Freshness {
    /// Registers the histogram.
    pub fn register(registry: &Registry) -> Result<Self, prometheus::Error> {
        let options = HistogramOpts::new(
            "fluxglobe_tile_server_notice_to_tile_seconds",
            "Time from the notice of a granule to a volume tile of what it brought.",
        );
        let seconds = HistogramVec::new(options.buckets(BOUNDS_S.to_vec()), &["path"])?;
        registry.register(Box::new(seconds.clone()))?;
        Ok(Self {
            waiting: Mutex::default(),
            seconds,
        })
    }

    /// A version is there that follows from a notice.
    pub fn expect_version(&self, manifest: &ManifestId, noticed: TimeMs) {
        let mut waiting = self.lock();
        waiting.asked.insert(manifest.to_string(), noticed);
        if waiting.asked.len() > MOST {
            waiting.asked.pop_first();
        }
    }

    /// A picture was ordered that follows from a notice.
    pub fn expect_picture(&self, key: ObjectKey, noticed: TimeMs) {
        let mut waiting = self.lock();
        waiting.ordered.insert(key, noticed);
        if waiting.ordered.len() > MOST {
            waiting.ordered.pop_first();
        }
    }

    /// A volume tile of a version was served.
    pub fn served(&self, manifest: &ManifestId) {
        let mut waiting = self.lock();
        if waiting.asked.is_empty() {
            return;
        }
        let noticed = waiting.asked.remove(&manifest.to_string());
        drop(waiting);
        self.observe("asked", noticed);
    }

    /// An ordered picture is there.
    pub fn drawn(&self, key: &ObjectKey) {
        let noticed = self.lock().ordered.remove(key);
        self.observe("hot", noticed);
    }

    fn observe(&self, path: &str, noticed: Option<TimeMs>) {
        let Some(noticed) = noticed else { return };
        let now_ms = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_millis() as i64);
        let seconds = (now_ms - noticed.ms()).max(0) as f64 / 1000.0;
        self.seconds.with_label_values(&[path]).observe(seconds);
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // Changed by single insertions and removals.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_version_and_each_picture_counts_once() {
        let freshness = Freshness::register(&Registry::new()).unwrap();
        let manifest: ManifestId = "p@1-00000000".parse().unwrap();
        let key: ObjectKey = "tiles/aa/x.png".parse().unwrap();
        let noticed = "2020-01-01".parse().unwrap();
        freshness.expect_version(&manifest, noticed);
        freshness.expect_picture(key.clone(), noticed);
        for _ in 0..2 {
            freshness.served(&manifest);
            freshness.drawn(&key);
        }
        for path in ["asked", "hot"] {
            let histogram = freshness.seconds.with_label_values(&[path]);
            assert_eq!(histogram.get_sample_count(), 1, "{path}");
            assert!(histogram.get_sample_sum() > 1e8, "{path}");
        }
    }
}
