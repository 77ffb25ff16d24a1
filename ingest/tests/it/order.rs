//! Files in the order of their notices: one that was offered earlier never replaces one that was offered later, however
//! often and wherever its notice is read again.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use bytes::Bytes;
use contract::event::{Body, Event};
use contract::time::Period;
use contract::topic::{Origin, Topic};
use ingest::{IngestService, Outcome, Quiet};
use storage::StorageError;
use storage::log::{EmbeddedLog, EventLog, Finished, Follower, Message, Reader, Start};

use crate::fixture::{Place, SmallFile, events, settings};
use crate::guarded::{guarded, notice};
use crate::web_server::{Answer, WebServer};

/// Values of an edition of a file: another one in every cell with data.
fn edition(number: u8) -> SmallFile {
    let mut file = SmallFile::new();
    let with_data = file.values.iter_mut().filter(|value| **value > 0.0);
    with_data.for_each(|value| *value += f32::from(number));
    file
}

/// A place with the first edition for January and February, and the second.
fn editions() -> (Place, [PathBuf; 2]) {
    let place = Place::new();
    let files = [place.path("first.nc"), place.path("second.nc")];
    edition(1).write_classic(&files[0]);
    edition(2).write_classic(&files[1]);
    (place, files)
}

/// The notice of a file, given in some second of a day.
fn given(file: &std::path::Path, second: u32) -> Event {
    let mut event = notice(file.to_str().unwrap(), None, None);
    event.trace = format!("{}-{second}", file.file_name().unwrap().to_str().unwrap());
    event.noticed = Some(format!("2020-01-01T00:00:{second:02}Z").parse().unwrap());
    event
}

/// Notices through a log of their own, as another process reads them.
async fn through(place: &Place, notices: &[Event]) -> (Vec<Outcome>, Vec<Event>) {
    let log = Arc::new(EmbeddedLog::memory());
    log.append(notices).await.unwrap();
    let service = IngestService::new(place.store.clone(), Arc::clone(&log) as _, settings());
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    (outcomes, events(log.as_ref(), Topic::GranuleLanded).await)
}

/// Which file each step is of.
async fn files_of(place: &Place) -> Vec<String> {
    let manifest = place.newest("fgco2").await;
    manifest.steps.into_iter().map(|step| step.origin).collect()
}

fn is_superseded(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Superseded { .. })
}

/// The process that published the first edition dies before it tells; another one lands the second; then the notice of
/// the first comes again.
#[tokio::test]
async fn a_notice_that_comes_again_after_a_kill_reverts_nothing_and_tells_what_is_due() {
    let (place, [first, second]) = editions();
    let (_, told) = through(&place, &[given(&first, 1)]).await;
    let landed = told[0].body.clone();
    through(&place, &[given(&second, 2)]).await;
    let before = place.newest("fgco2").await;

    let (outcomes, told) = through(&place, &[given(&first, 1)]).await;
    assert!(is_superseded(&outcomes[0]), "{}", outcomes[0]);
    assert_eq!(place.newest("fgco2").await, before);
    let told: Vec<&Body> = told.iter().map(|event| &event.body).collect();
    assert_eq!(told, [&landed], "the version that held it");
}

/// The process that published a file dies before the cube follows; then the notice comes again.
#[tokio::test]
async fn a_notice_that_comes_again_after_a_kill_brings_the_cube_up() {
    let (place, [first, _]) = editions();
    through(&place, &[given(&first, 1)]).await;
    let newest = place.newest("fgco2").await;
    for key in place.store.list("cubes").await.unwrap() {
        place.store.remove(&key).await.unwrap();
    }
    through(&place, &[given(&first, 1)]).await;
    assert_eq!(place.newest("fgco2").await, newest);
    crate::cubes::holds(&place.store, &newest).await;
}

#[tokio::test]
async fn a_message_that_is_sent_twice_reverts_nothing_and_is_finished_in_silence() {
    let (place, [first, second]) = editions();
    let notices = [given(&first, 1), given(&second, 2), given(&first, 1)];
    let (outcomes, told) = through(&place, &notices).await;
    assert!(is_superseded(&outcomes[2]), "{}", outcomes[2]);
    assert_eq!(told.len(), 2, "{told:?}");
    assert_eq!(files_of(&place).await, ["second.nc", "second.nc"]);
}

/// Two partitions have no order: the older file may be read second.
#[tokio::test]
async fn an_older_file_that_was_slow_does_not_land_over_a_newer_one() {
    let (place, [first, second]) = editions();
    let (outcomes, told) = through(&place, &[given(&second, 2), given(&first, 1)]).await;
    assert!(is_superseded(&outcomes[1]), "{}", outcomes[1]);
    assert_eq!(told.len(), 1, "it never was in the product: {told:?}");
    assert_eq!(place.newest("fgco2").await.number, 1);
    let line = outcomes[1].to_string();
    assert!(line.contains("send a new notice"), "{line}");
}

#[tokio::test]
async fn an_older_file_lands_where_no_newer_one_is_and_says_so() {
    let (place, [first, second]) = editions();
    edition(2).first_month().write_classic(&second);
    let (outcomes, told) = through(&place, &[given(&second, 2), given(&first, 1)]).await;
    let february = Period::month(2001, 2).unwrap();
    assert!(
        matches!(&outcomes[1], Outcome::Landed { periods, revised: false, .. } if *periods == [february]),
        "{:?}",
        outcomes[1]
    );
    assert!(
        matches!(&told[1].body, Body::GranuleLanded { periods, .. } if *periods == [february]),
        "{told:?}"
    );
    assert_eq!(files_of(&place).await, ["second.nc", "first.nc"]);
    let orders = place.newest("fgco2").await.notice_orders();
    let seconds = orders.iter().map(|order| order.unwrap().given.to_string());
    assert_eq!(
        seconds.collect::<Vec<_>>(),
        ["2020-01-01T00:00:02Z", "2020-01-01T00:00:01Z"]
    );
}

#[tokio::test]
async fn a_new_notice_of_an_old_file_puts_it_back_on_purpose() {
    let (place, [first, second]) = editions();
    let notices = [given(&first, 1), given(&second, 2), given(&first, 3)];
    let (outcomes, told) = through(&place, &notices).await;
    assert!(matches!(outcomes[2], Outcome::Landed { revised: true, .. }));
    assert_eq!(told.len(), 3);
    assert_eq!(files_of(&place).await, ["first.nc", "first.nc"]);
    // What was put back is as new as its last notice.
    let (outcomes, _) = through(&place, &[given(&second, 2)]).await;
    assert!(is_superseded(&outcomes[0]), "{}", outcomes[0]);
}

/// A folder that holds a file and its revision is given again every night.
#[tokio::test]
async fn editions_that_are_given_again_together_stay_as_they_are() {
    let (place, [first, second]) = editions();
    through(&place, &[given(&first, 1), given(&second, 2)]).await;
    let before = place.newest("fgco2").await;
    for night in 1..4 {
        let notices = [given(&first, 10 * night), given(&second, 10 * night + 1)];
        let (outcomes, _) = through(&place, &notices).await;
        assert!(is_superseded(&outcomes[0]), "{night}: {}", outcomes[0]);
        let is_there = matches!(outcomes[1], Outcome::AlreadyLanded { .. });
        assert!(is_there, "{night}: {}", outcomes[1]);
        assert_eq!(place.newest("fgco2").await, before, "{night}");
    }
    // What the older one brings beside the revision lands, and the revision is as new then as its last notice.
    let (place, [first, second]) = editions();
    edition(2).first_month().write_classic(&second);
    through(&place, &[given(&second, 2)]).await;
    through(&place, &[given(&first, 10), given(&second, 11)]).await;
    assert_eq!(files_of(&place).await, ["second.nc", "first.nc"]);
    let (outcomes, _) = through(&place, &[given(&first, 10)]).await;
    let is_there = matches!(outcomes[0], Outcome::Superseded { .. });
    assert!(is_there, "{}", outcomes[0]);
    assert_eq!(files_of(&place).await, ["second.nc", "first.nc"]);
}

/// A sender whose clock is ahead is believed no further than its message's own time.
#[tokio::test]
async fn a_notice_is_never_newer_than_its_message() {
    let (place, [first, second]) = editions();
    let mut ahead = given(&first, 1);
    ahead.noticed = Some("2990-01-01".parse().unwrap());
    through(&place, &[ahead]).await;
    let mut silent = given(&second, 2);
    silent.noticed = None;
    let (outcomes, _) = through(&place, &[silent]).await;
    assert!(
        matches!(outcomes[0], Outcome::Landed { revised: true, .. }),
        "{}",
        outcomes[0]
    );
}

/// A log whose reader is told once that its messages belong to another member now.
struct Rebalanced {
    inner: EmbeddedLog,
    take_away: Arc<AtomicBool>,
}

struct RebalancedReader {
    inner: Box<dyn Reader>,
    held: Vec<Origin>,
    take_away: Arc<AtomicBool>,
}

#[async_trait]
impl Reader for RebalancedReader {
    async fn next(&mut self, max: usize, wait: Duration) -> Result<Vec<Message>, StorageError> {
        let messages = self.inner.next(max, wait).await?;
        self.held.extend(messages.iter().map(|m| m.origin));
        Ok(messages)
    }

    async fn finish(&mut self, done: Vec<Finished>) -> Result<(), StorageError> {
        self.inner.finish(done).await
    }

    fn lost(&mut self) -> Vec<Origin> {
        if self.take_away.swap(false, Ordering::SeqCst) {
            std::mem::take(&mut self.held)
        } else {
            vec![]
        }
    }

    async fn leave(self: Box<Self>) -> Result<(), StorageError> {
        self.inner.leave().await
    }
}

#[async_trait]
impl EventLog for Rebalanced {
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
        Ok(Box::new(RebalancedReader {
            inner: self.inner.join(topic, group).await?,
            held: vec![],
            take_away: Arc::clone(&self.take_away),
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

async fn until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_mins(1), "no {what}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// The source of a file is away; its partition goes to another member, and then the source comes back.
#[tokio::test]
async fn a_member_that_lost_a_partition_ends_its_jobs() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    let content = std::fs::read(place.path("a.h5")).unwrap();
    let is_back = Arc::new(AtomicBool::new(false));
    let back = Arc::clone(&is_back);
    let server = WebServer::start(Box::new(move |_| {
        if back.load(Ordering::SeqCst) {
            Answer::Whole("200 OK", vec![], content.clone())
        } else {
            Answer::Whole("503 Service Unavailable", vec![], vec![])
        }
    }))
    .await;
    let settings = guarded(&place, &["--allow-host", &server.address.to_string()]).unwrap();
    let take_away = Arc::new(AtomicBool::new(false));
    let log = Arc::new(Rebalanced {
        inner: EmbeddedLog::memory(),
        take_away: Arc::clone(&take_away),
    });
    let url = server.url("/a.h5");
    log.append(&[notice(&url, None, None)]).await.unwrap();
    let service = IngestService::new(place.store.clone(), Arc::clone(&log) as _, settings);
    let stop = async {
        until("question", || !server.asked().is_empty()).await;
        take_away.store(true, Ordering::SeqCst);
        until("loss", || !take_away.load(Ordering::SeqCst)).await;
        is_back.store(true, Ordering::SeqCst);
    };
    service.run(&Quiet, stop).await.unwrap();
    let products = storage::manifests::products(&place.store).await.unwrap();
    assert_eq!(products, [], "the other member lands it");
    assert!(events(log.as_ref(), Topic::GranuleLanded).await.is_empty());
}
