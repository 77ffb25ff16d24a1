//! Faults between stages: nothing is lost, nothing lands twice, and each test asserts that its fault fired.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use contract::event::Event;
use contract::topic::{Origin, Topic};
use ingest::{IngestService, Outcome, Quiet};
use storage::log::{EmbeddedLog, EventLog, Finished, Follower, Message, Reader, Start};
use storage::{StorageError, Store};

use crate::fixture::{Place, SmallFile, events, settings};
use crate::guarded::{guarded, notice};
use crate::service::run_until;
use crate::web_server::{Answer, WebServer};

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

/// The store cannot take the manifest after fields are durable: a file stands where its folder belongs.
#[tokio::test]
async fn a_crash_between_put_and_commit_loses_nothing_and_doubles_nothing() {
    let place = Place::new();
    let files = write_files(&place);
    let folder = place.path("store");
    let store = Store::open(folder.to_str().unwrap()).unwrap();
    let blocked = folder.join("manifests");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(&blocked, "in the way").unwrap();
    let log: Arc<dyn EventLog> = Arc::new(place.log.clone());
    let service = IngestService::new(store.clone(), log, settings());
    service.notify(&files, None, None).await.unwrap();
    let failed = service.drain(&Quiet).await;
    assert!(failed.is_err(), "the fault fired");
    assert!(
        events(&place.log, Topic::GranuleLanded).await.is_empty(),
        "no event before its objects"
    );
    std::fs::remove_file(&blocked).unwrap();
    let before = objects(&folder);

    let outcomes = service.drain(&Quiet).await.unwrap();
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

/// A log whose first calls of each kind fail.
struct FailingLog {
    inner: EmbeddedLog,
    left: Arc<Failures>,
}

/// How many calls are still to fail.
#[derive(Default)]
struct Failures {
    joins: AtomicU32,
    reads: AtomicU32,
    finishes: AtomicU32,
}

fn planted(left: &AtomicU32) -> Result<(), StorageError> {
    match left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1)) {
        Ok(_) => Err(StorageError::log("test", std::io::Error::other("planted"))),
        Err(_none_left) => Ok(()),
    }
}

impl FailingLog {
    fn new(joins: u32, reads: u32, finishes: u32) -> Arc<Self> {
        Arc::new(Self {
            inner: EmbeddedLog::memory(),
            left: Arc::new(Failures {
                joins: joins.into(),
                reads: reads.into(),
                finishes: finishes.into(),
            }),
        })
    }

    fn have_fired(&self) -> bool {
        let Failures {
            joins,
            reads,
            finishes,
        } = self.left.as_ref();
        [joins, reads, finishes]
            .iter()
            .all(|left| left.load(Ordering::SeqCst) == 0)
    }
}

struct FailingReader {
    inner: Box<dyn Reader>,
    left: Arc<Failures>,
}

#[async_trait]
impl Reader for FailingReader {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        let found = self.inner.next(max, wait).await?;
        planted(&self.left.reads)?;
        Ok(found)
    }

    async fn finish(&mut self, done: Vec<Finished>) -> Result<(), StorageError> {
        planted(&self.left.finishes)?;
        self.inner.finish(done).await
    }

    async fn leave(self: Box<Self>) -> Result<(), StorageError> {
        self.inner.leave().await
    }
}

#[async_trait]
impl EventLog for FailingLog {
    async fn append(&self, events: &[Event]) -> Result<(), StorageError> {
        self.inner.append(events).await
    }

    async fn append_message(
        &self,
        topic: Topic,
        key: &str,
        content: Bytes,
    ) -> Result<(), StorageError> {
        self.inner.append_message(topic, key, content).await
    }

    async fn join(&self, topic: Topic, group: &str) -> Result<Box<dyn Reader>, StorageError> {
        planted(&self.left.joins)?;
        Ok(Box::new(FailingReader {
            inner: self.inner.join(topic, group).await?,
            left: Arc::clone(&self.left),
        }))
    }

    async fn follow(&self, topic: Topic, start: Start) -> Result<Box<dyn Follower>, StorageError> {
        self.inner.follow(topic, start).await
    }

    async fn message(&self, origin: Origin) -> Result<Option<Message>, StorageError> {
        self.inner.message(origin).await
    }

    async fn lag(&self, topic: Topic, group: &str) -> Result<u64, StorageError> {
        self.inner.lag(topic, group).await
    }

    async fn ready(&self) -> Result<(), StorageError> {
        self.inner.ready().await
    }
}

/// The manifest is published but finishing fails: the notice comes again, the file is found, the event told once.
#[tokio::test]
async fn a_lost_event_is_told_again_and_the_file_lands_once() {
    let place = Place::new();
    let files = write_files(&place);
    let log = FailingLog::new(0, 0, 1);
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    );
    service.notify(&files, None, None).await.unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert!(log.have_fired());
    assert!(
        outcomes
            .iter()
            .all(|o| matches!(o, Outcome::AlreadyLanded { .. })),
        "{outcomes:?}"
    );
    assert_eq!(events(log.as_ref(), Topic::GranuleLanded).await.len(), 2);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (1, 4));
}

/// The log fails in every way, again and again; each notice has one event all the same.
#[tokio::test]
async fn a_log_that_fails_is_joined_again_and_each_notice_has_one_event() {
    let place = Place::new();
    let mut files = write_files(&place);
    std::fs::write(place.path("bad.nc"), "no").unwrap();
    files.push(place.path("bad.nc"));
    let log = FailingLog::new(2, 2, 3);
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    );
    service.notify(&files, None, None).await.unwrap();
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 2).await;
    assert!(log.have_fired());
    assert_eq!(landed.len(), 2);
    assert_eq!(events(log.as_ref(), Topic::GranuleRejected).await.len(), 1);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    assert_eq!(place.newest("fgco2").await.steps.len(), 4);
}

/// A notice whose file was published by a process that died, and a second notice of the same file that comes first.
#[tokio::test]
async fn of_two_notices_of_a_file_one_tells_even_if_its_process_dies() {
    let place = Place::new();
    let files = write_files(&place);
    let log = FailingLog::new(0, 0, 1);
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    );
    service.notify(&files[..1], None, None).await.unwrap();
    service.notify(&files[..1], None, None).await.unwrap();
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1).await;
    assert!(log.have_fired());
    assert_eq!(landed.len(), 1, "{landed:?}");
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
}

/// Waits until a service says that it is held up, then mends what holds it up.
async fn mended_when_told(service: &IngestService, mend: impl FnOnce()) {
    let start = Instant::now();
    while service.ready().await.ready {
        assert!(
            start.elapsed() < Duration::from_secs(30),
            "the fault did not fire"
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    mend();
}

#[tokio::test]
async fn a_store_that_is_away_is_waited_for_and_nothing_is_refused() {
    let place = Place::new();
    let files = write_files(&place);
    let folder = place.path("store");
    let store = Store::open(folder.to_str().unwrap()).unwrap();
    let blocked = folder.join("frames");
    std::fs::write(&blocked, "in the way").unwrap();
    let log = Arc::new(EmbeddedLog::memory());
    let service = IngestService::new(store, Arc::clone(&log) as Arc<dyn EventLog>, settings());
    service.notify(&files, None, None).await.unwrap();
    let mend = mended_when_told(&service, || std::fs::remove_file(&blocked).unwrap());
    let run = run_until(&service, log.as_ref(), Topic::GranuleLanded, 2);
    let (landed, ()) = tokio::join!(run, mend);
    assert_eq!(landed.len(), 2);
    assert!(
        events(log.as_ref(), Topic::GranuleRejected)
            .await
            .is_empty()
    );
    assert!(service.ready().await.ready);
}

#[tokio::test]
async fn a_spool_that_cannot_be_written_is_waited_for() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    let content = std::fs::read(place.path("a.h5")).unwrap();
    let answers = move |_: &str| Answer::Whole("200 OK", vec![], content.clone());
    let server = WebServer::start(Box::new(answers)).await;
    let settings = guarded(&place, &["--allow-host", &server.address.to_string()]).unwrap();
    let mut folders = std::fs::read_dir(place.path("spool")).unwrap();
    let own = folders
        .find_map(|e| e.ok().map(|e| e.path()).filter(|p| p.is_dir()))
        .unwrap();
    std::fs::remove_dir(&own).unwrap();
    let log = Arc::new(EmbeddedLog::memory());
    log.append(&[notice(&server.url("/a.h5"), None, None)])
        .await
        .unwrap();
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings,
    );
    let mend = mended_when_told(&service, || std::fs::create_dir(&own).unwrap());
    let run = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1);
    let (landed, ()) = tokio::join!(run, mend);
    assert_eq!(landed.len(), 1);
    assert!(
        events(log.as_ref(), Topic::GranuleRejected)
            .await
            .is_empty()
    );
}

/// What is stored of one product is damaged: its notices are refused, those of others land.
#[tokio::test]
async fn a_damaged_product_does_not_hold_up_the_others() {
    let place = Place::new();
    let files = write_files(&place);
    let key = "manifests/broken/0000000001.json".parse().unwrap();
    place
        .store
        .put_new(&key, Bytes::from("no JSON"))
        .await
        .unwrap();
    let log = Arc::new(EmbeddedLog::memory());
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    );
    service
        .notify(&files[..1], None, Some(&"broken".parse().unwrap()))
        .await
        .unwrap();
    service.notify(&files[1..], None, None).await.unwrap();
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1).await;
    assert_eq!(landed.len(), 1);
    let refused = events(log.as_ref(), Topic::GranuleRejected).await;
    assert!(refused[0].to_json().contains("damaged"), "{refused:?}");
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
}

/// Twelve writers land a month each of one product at the same time: those that lose the race for a number build on the
/// winner's manifest.
#[tokio::test]
async fn writers_that_race_for_a_number_all_land() {
    const MONTHS: [&str; 12] = [
        "days since 2001-01-01",
        "days since 2001-02-01",
        "days since 2001-03-01",
        "days since 2001-04-01",
        "days since 2001-05-01",
        "days since 2001-06-01",
        "days since 2001-07-01",
        "days since 2001-08-01",
        "days since 2001-09-01",
        "days since 2001-10-01",
        "days since 2001-11-01",
        "days since 2001-12-01",
    ];
    let place = Place::new();
    let land = async |unit: &'static str| {
        let path = place.path(&format!("{unit}.nc"));
        let mut file = SmallFile::new().first_month();
        file.time_unit = Some(unit);
        file.write_classic(&path);
        // Each with a log of its own, as processes without anything in common but the store have.
        let writer = Place {
            store: place.store.clone(),
            ..Place::new()
        };
        writer.land(&[path]).await.remove(0)
    };
    let outcomes = futures::future::join_all(MONTHS.map(land)).await;
    assert!(
        outcomes
            .iter()
            .all(|o| matches!(o, Outcome::Landed { revised: false, .. })),
        "{outcomes:?}"
    );
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (12, 12));
}
