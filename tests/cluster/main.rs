//! The cluster as people run it: every service a process, real Kafka, PostGIS and S3. One cluster at a time.

#![expect(clippy::unwrap_used, reason = "a test ends where it cannot go on")]

mod equality;
mod faults;
mod full_disk;
mod granules;
mod outages;
mod refusals;
mod restarts;
mod round_trips;
mod statistics;
mod streams;
mod watched;

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// Two clusters at once would starve each other on a small machine, and times would mean nothing.
static ROOM: RwLock<()> = RwLock::new(());

/// For a test with a whole cluster.
fn alone() -> RwLockWriteGuard<'static, ()> {
    // A test that failed says so itself; the others still run.
    ROOM.write().unwrap_or_else(PoisonError::into_inner)
}

/// For tests of one or two services, which may run beside each other.
fn together() -> RwLockReadGuard<'static, ()> {
    ROOM.read().unwrap_or_else(PoisonError::into_inner)
}
