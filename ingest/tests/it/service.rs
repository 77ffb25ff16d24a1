//! The service follows notices: events after objects, each once, offsets with their events.

use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::event::{Body, Event, RejectReason};
use contract::topic::{Origin, Topic};
use ingest::{IngestService, Outcome, Progress, Quiet, Settings, Stage};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile, events, settings};

fn service(store: &Store, log: &Arc<EmbeddedLog>) -> IngestService {
    IngestService::new(
        store.clone(),
        Arc::clone(log) as Arc<dyn EventLog>,
        settings(),
    )
}

/// Runs the service until a topic holds so many events, and then a moment more: what would come too often comes too.
pub(crate) async fn run_until(
    service: &IngestService,
    log: &dyn EventLog,
    topic: Topic,
    count: usize,
) -> Vec<Event> {
    let stop = async {
        let start = Instant::now();
        while events(log, topic).await.len() < count {
            let late = start.elapsed() > Duration::from_secs(30);
            assert!(!late, "{:?}", events(log, topic).await);
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    service.run(&Quiet, stop).await.unwrap();
    events(log, topic).await
}

#[tokio::test]
async fn notices_are_followed_once_and_in_order() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    std::fs::write(place.path("b.nc"), "no").unwrap();
    let service = service(&place.store, &log);
    service
        .notify(&[place.path("a.nc"), place.path("b.nc")], None, None)
        .await
        .unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(
        outcomes
            .iter()
            .map(Outcome::is_rejected)
            .collect::<Vec<_>>(),
        [false, true]
    );
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    assert!(service.drain(&Quiet).await.unwrap().is_empty());
    let landed = events(log.as_ref(), Topic::GranuleLanded).await;
    let notices = events(log.as_ref(), Topic::GranuleNotice).await;
    assert_eq!(landed.len(), 1);
    assert_eq!(landed[0].trace, notices[0].trace);
    let first = Origin {
        topic: Topic::GranuleNotice,
        partition: 0,
        offset: 0,
    };
    let came = log.message(first).await.unwrap().unwrap().time;
    assert!(came.is_some() && landed[0].noticed == came);
    assert_ne!(notices[0].trace, notices[1].trace);
}

#[tokio::test]
async fn a_notice_names_profile_and_product() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    let product = "my-flux".parse().unwrap();
    service
        .notify(&[place.path("a.nc")], None, Some(&product))
        .await
        .unwrap();
    service
        .notify(&[place.path("a.nc")], Some("no-such-profile"), None)
        .await
        .unwrap();
    service
        .notify(&[place.path("a.nc")], None, Some(&product))
        .await
        .unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(outcomes[0].manifest().unwrap().product, product);
    assert!(
        matches!(&outcomes[1], Outcome::Rejected { reason: RejectReason::NoVariable, detail, .. } if detail.contains("takahashi09-flux"))
    );
    assert!(
        matches!(outcomes[2], Outcome::AlreadyLanded { .. }),
        "{}",
        outcomes[2]
    );
    let refused = events(log.as_ref(), Topic::GranuleRejected).await;
    let Body::GranuleRejected {
        origin, attempt, ..
    } = &refused[0].body
    else {
        panic!("{refused:?}")
    };
    assert_eq!(origin.unwrap().to_string(), "granule.notice/0/1");
    assert_eq!(*attempt, 1);
}

#[tokio::test]
async fn a_duplicate_is_finished_in_silence() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    for _ in 0..3 {
        service
            .notify(&[place.path("a.nc")], None, None)
            .await
            .unwrap();
        service.drain(&Quiet).await.unwrap();
    }
    assert_eq!(events(log.as_ref(), Topic::GranuleLanded).await.len(), 1);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    assert_eq!(place.newest("fgco2").await.number, 1);
}

#[tokio::test]
async fn poison_is_refused_with_its_place_and_blocks_nothing() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    let poison = [
        "no JSON",
        r#"{"schema":99,"trace":"t","body":{}}"#,
        r#"{"version":"9.0","collection":"c","identifier":"i"}"#,
        "",
    ];
    for text in poison {
        let content = bytes::Bytes::from_static(text.as_bytes());
        log.append_message(Topic::GranuleNotice, "k", content)
            .await
            .unwrap();
    }
    service
        .notify(&[place.path("a.nc")], None, None)
        .await
        .unwrap();
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1).await;
    assert_eq!(landed.len(), 1);
    let refused = events(log.as_ref(), Topic::GranuleRejected).await;
    assert_eq!(refused.len(), poison.len());
    for (offset, event) in (0..).zip(&refused) {
        let Body::GranuleRejected { reason, origin, .. } = &event.body else {
            panic!("{event:?}")
        };
        assert_eq!(*reason, RejectReason::Message);
        assert_eq!(
            origin.unwrap().offset,
            offset,
            "which message, in their order"
        );
    }
}

/// Tells when a stage is reached, and how many files are between fetch and commit.
struct Seen(tokio::sync::watch::Sender<bool>);

impl Progress for Seen {
    fn stage(&self, _file: &std::path::Path, stage: Stage, _step: usize, _steps: usize) {
        if stage == Stage::Inspect {
            self.0.send_replace(true);
        }
    }
    fn done(&self, _outcome: &Outcome) {}
}

#[tokio::test]
async fn work_that_was_begun_is_finished_before_the_service_stops() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    service
        .notify(&[place.path("a.nc")], None, None)
        .await
        .unwrap();
    let (sender, mut seen) = tokio::sync::watch::channel(false);
    let stop = async move {
        seen.wait_for(|seen| *seen).await.unwrap();
    };
    service.run(&Seen(sender), stop).await.unwrap();
    assert_eq!(events(log.as_ref(), Topic::GranuleLanded).await.len(), 1);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
}

#[tokio::test]
async fn work_that_takes_too_long_comes_again() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let mut slow = settings();
    slow.decoder.program = "/bin/sh".into();
    slow.decoder.arguments = vec!["-c".into(), "sleep 60".into()];
    let stuck = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        slow,
    )
    .with_bounds(4, Duration::from_millis(200));
    stuck
        .notify(&[place.path("a.nc")], None, None)
        .await
        .unwrap();
    let start = Instant::now();
    let stop = tokio::time::sleep(Duration::from_millis(300));
    stuck.run(&Quiet, stop).await.unwrap();
    // The work would take a minute.
    assert!(start.elapsed() < Duration::from_secs(50));
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 1);
    let landed = run_until(
        &service(&place.store, &log),
        log.as_ref(),
        Topic::GranuleLanded,
        1,
    )
    .await;
    assert_eq!(landed.len(), 1);
}

/// Settings whose reader waits with files of some names until a gate is there.
fn slow_reader(names: &str, gate: &std::path::Path) -> Settings {
    let reader = env!("CARGO_BIN_EXE_decode-file");
    let wait = format!("while ! [ -e {} ]; do sleep 0.02; done", gate.display());
    // `$0` is the first word after the script: the first of the reader's arguments, its file.
    let script = format!("case \"$0\" in {names}) {wait};; esac; exec {reader} \"$0\" \"$@\"");
    let mut settings = settings();
    settings.decoder.program = "/bin/sh".into();
    settings.decoder.arguments = vec!["-c".into(), script.into()];
    settings
}

/// The offset waits for a slow file, and nobody else does.
#[tokio::test]
async fn others_land_while_one_file_is_slow_and_the_offset_waits_for_it() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("slow.nc"));
    SmallFile::new()
        .first_month()
        .write_hdf5(&place.path("b.h5"));
    let gate = place.path("gate");
    let settings = slow_reader("*slow*", &gate);
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings,
    );
    let (slow, quick) = ("slow".parse().unwrap(), "quick".parse().unwrap());
    service
        .notify(&[place.path("slow.nc")], None, Some(&slow))
        .await
        .unwrap();
    service
        .notify(&[place.path("b.h5")], None, Some(&quick))
        .await
        .unwrap();
    let stop = async {
        let start = Instant::now();
        let is_there = async || {
            let newest = storage::manifests::latest(&place.store, &quick)
                .await
                .unwrap();
            newest.is_some()
        };
        while !is_there().await {
            assert!(start.elapsed() < Duration::from_secs(30));
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
        assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 2);
        assert!(events(log.as_ref(), Topic::GranuleLanded).await.is_empty());
        std::fs::write(&gate, "").unwrap();
    };
    service.run(&Quiet, stop).await.unwrap();
    let landed = events(log.as_ref(), Topic::GranuleLanded).await;
    let products: Vec<String> = landed.iter().map(|e| e.body.order_key()).collect();
    assert_eq!(products, ["slow", "quick"], "in the order of their notices");
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
}

/// The first of four is slow to read: the others wait for it.
#[tokio::test]
async fn revisions_of_one_product_land_in_the_order_of_their_notices() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    let product = "p".parse().unwrap();
    let gate = place.path("gate");
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        slow_reader("*0.nc", &gate),
    );
    for revision in 0..4u8 {
        let mut file = SmallFile::new();
        file.values[5] = f32::from(revision);
        let path = place.path(&format!("{revision}.nc"));
        if revision % 2 == 0 {
            file.write_hdf5(&path);
        } else {
            file.write_classic(&path);
        }
        service.notify(&[path], None, Some(&product)).await.unwrap();
    }
    let open = async {
        tokio::time::sleep(Duration::from_millis(500)).await;
        assert!(
            storage::manifests::products(&place.store)
                .await
                .unwrap()
                .is_empty()
        );
        std::fs::write(&gate, "").unwrap();
    };
    let run = run_until(&service, log.as_ref(), Topic::GranuleLanded, 4);
    let (landed, ()) = tokio::join!(run, open);
    assert_eq!(landed.len(), 4);
    let manifest = place.newest("p").await;
    assert_eq!(manifest.number, 4, "each revision can be cited");
    assert_eq!(manifest.steps[0].origin, "3.nc");
}

#[tokio::test]
async fn readiness_names_each_part() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    let report = service(&place.store, &log).ready().await;
    assert!(report.ready, "{report:?}");
    let names: Vec<_> = report.checks.iter().map(|part| part.name).collect();
    assert_eq!(names, ["object store", "event log", "spool", "work"]);
}
