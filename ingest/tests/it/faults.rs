//! Faults between stages: nothing is lost, nothing lands twice, and each test asserts that its fault fired.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use contract::event::Event;
use ingest::{Batch, IngestService, Outcome, Quiet};
use storage::log::{EmbeddedLog, EventLog};
use storage::{StorageError, Store};

use crate::fixture::{Place, SmallFile, settings};

/// Two months and the next two.
fn write_files(place: &Place) -> Vec<std::path::PathBuf> {
    SmallFile::new().write_classic(&place.path("a.nc"));
    SmallFile {
        time_unit: Some("days since 2001-03-01"),
        ..SmallFile::new()
    }
    .write_classic(&place.path("b.nc"));
    vec![place.path("a.nc"), place.path("b.nc")]
}

fn objects(folder: &std::path::Path) -> Vec<String> {
    let mut names = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                names.push(path.display().to_string());
            }
        }
    }
    names.sort();
    names
}

/// The store cannot take the manifest after frames and series are durable: a file stands where its folder belongs.
#[tokio::test]
async fn a_crash_between_put_and_commit_loses_nothing_and_doubles_nothing() {
    let place = Place::new();
    let files = write_files(&place);
    let folder = place.path("store");
    let store = Store::open(folder.to_str().unwrap()).unwrap();
    let blocked = folder.join("manifests");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(&blocked, "in the way").unwrap();
    let batch = || Batch {
        files: files.clone(),
        ..Batch::default()
    };
    let failed = ingest::land_files(&store, &place.log, &settings(), batch(), &Quiet).await;
    assert!(failed.is_err(), "the fault fired");
    assert!(
        place
            .log
            .read("granule.landed", 0, 10)
            .await
            .unwrap()
            .is_empty(),
        "no event before its objects"
    );
    std::fs::remove_file(&blocked).unwrap();
    let before = objects(&folder);

    let outcomes = ingest::land_files(&store, &place.log, &settings(), batch(), &Quiet)
        .await
        .unwrap();
    assert!(
        outcomes
            .iter()
            .all(|o| matches!(o, Outcome::Landed { revised: false, .. })),
        "{outcomes:?}"
    );
    let manifest = storage::manifests::latest(&store, &"fgco2".parse().unwrap())
        .await
        .unwrap()
        .unwrap();
    assert_eq!((manifest.number, manifest.steps.len()), (1, 4));
    let after = objects(&folder);
    assert!(before.iter().all(|name| after.contains(name)));
    assert_eq!(
        after.iter().filter(|n| n.contains("/frames/")).count(),
        4,
        "{after:?}"
    );
    assert_eq!(after.iter().filter(|n| n.contains("/raw/")).count(), 2);
}

/// A log whose first appends of landed events fail.
struct FailingLog {
    inner: EmbeddedLog,
    failures_left: AtomicU32,
}

#[async_trait::async_trait]
impl EventLog for FailingLog {
    async fn append(&self, event: &Event) -> Result<u64, StorageError> {
        let is_landed = event.body.topic() == "granule.landed";
        if is_landed
            && self
                .failures_left
                .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1))
                .is_ok()
        {
            let source = std::io::Error::other("planted");
            return Err(StorageError::Log {
                path: "test".into(),
                source,
            });
        }
        self.inner.append(event).await
    }

    async fn read(
        &self,
        topic: &str,
        from: u64,
        max: usize,
    ) -> Result<Vec<(u64, Event)>, StorageError> {
        self.inner.read(topic, from, max).await
    }

    async fn committed(&self, topic: &str, group: &str) -> Result<u64, StorageError> {
        self.inner.committed(topic, group).await
    }

    async fn commit(&self, topic: &str, group: &str, next: u64) -> Result<(), StorageError> {
        self.inner.commit(topic, group, next).await
    }
}

/// The manifest is published but the event is lost: the notice is read again, the file is found, the event told.
#[tokio::test]
async fn a_lost_event_is_told_again_and_the_file_lands_once() {
    let place = Place::new();
    let files = write_files(&place);
    let log = Arc::new(FailingLog {
        inner: EmbeddedLog::memory(),
        failures_left: AtomicU32::new(1),
    });
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    );
    service.notify(&files, None, None).await.unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(
        log.failures_left.load(Ordering::SeqCst),
        0,
        "the fault fired"
    );
    assert!(
        outcomes
            .iter()
            .all(|o| matches!(o, Outcome::AlreadyLanded { .. })),
        "{outcomes:?}"
    );
    assert_eq!(log.read("granule.landed", 0, 10).await.unwrap().len(), 2);
    assert_eq!(log.committed("granule.notice", "ingest").await.unwrap(), 2);
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (1, 4));
}

/// Two writers land different files of one product at the same time: one loses the race for the number and builds on
/// the other's manifest.
#[tokio::test]
async fn writers_that_race_for_a_number_both_land() {
    let place = Place::new();
    let files = write_files(&place);
    let land = |file: std::path::PathBuf| {
        let (store, log) = (place.store.clone(), &place.log);
        async move {
            let batch = Batch {
                files: vec![file],
                ..Batch::default()
            };
            ingest::land_files(&store, log, &settings(), batch, &Quiet)
                .await
                .unwrap()
        }
    };
    let (a, b) = tokio::join!(land(files[0].clone()), land(files[1].clone()));
    assert!(matches!(a[0], Outcome::Landed { .. }) && matches!(b[0], Outcome::Landed { .. }));
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (2, 4));
}
