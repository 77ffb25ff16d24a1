//! The cluster as people run it: every service a process, real Kafka, PostGIS and S3. One cluster at a time.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]

mod equality;
mod faults;
mod full_disk;
mod granules;
mod outages;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Two clusters at once would starve each other on a small machine, and times would mean nothing.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    // A test that failed says so itself; the others still run.
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}
