//! The service between the log and a home: every message stored once, bad ones told of, a home that is away waited for.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use contract::event::{Body, Event, RejectReason};
use contract::observation::Observation;
use contract::topic::Topic;
use observations::{FileStore, Filter, ObservationService, ObservationStore};
use service::Red;
use storage::Store;
use storage::log::{EmbeddedLog, EventLog, contents};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::interruptions::Switch;
use crate::sample::observation;

const GROUP: &str = "observations";

struct Running {
    stop: oneshot::Sender<()>,
    task: JoinHandle<()>,
}

impl Running {
    fn start(log: &Arc<dyn EventLog>, store: Arc<dyn ObservationStore>) -> Self {
        let service = ObservationService::new(Arc::clone(log), store, Red::unseen());
        let (stop, stopped) = oneshot::channel::<()>();
        let task = tokio::spawn(async move {
            service
                .run(async {
                    stopped.await.unwrap_or_default();
                })
                .await
                .unwrap();
        });
        Self { stop, task }
    }

    async fn stop(self) {
        self.stop.send(()).unwrap();
        tokio::time::timeout(Duration::from_secs(15), self.task)
            .await
            .unwrap()
            .unwrap();
    }
}

fn log() -> (tempfile::TempDir, Arc<dyn EventLog>) {
    let folder = tempfile::tempdir().unwrap();
    let log = EmbeddedLog::open(folder.path()).unwrap();
    (folder, Arc::new(log))
}

fn event(trace: &str, observations: Vec<Observation>) -> Event {
    Event::new(trace, Body::Observations { observations })
}

async fn until_read(log: &Arc<dyn EventLog>) {
    let all = async {
        while log.lag(Topic::Observation, GROUP).await.unwrap() > 0 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_mins(1), all)
        .await
        .expect("messages are left over");
}

#[tokio::test(flavor = "multi_thread")]
async fn good_messages_are_stored_and_bad_ones_told_of() {
    let (_folder, log) = log();
    let store = FileStore::new(Store::memory());
    log.append(&[event(
        "first",
        vec![observation("a", 0, 1.0), observation("a", 1, 2.0)],
    )])
    .await
    .unwrap();
    let hostile: [&[u8]; 3] = [
        b"no json",
        br#"{"schema":9,"trace":"t","body":{"kind":"observation","observations":[]}}"#,
        br#"{"schema":1,"trace":"t","body":{"kind":"observation","observations":[{"dataset":"buoys"}]}}"#,
    ];
    for content in hostile {
        log.append_message(Topic::Observation, "k", Bytes::from_static(content))
            .await
            .unwrap();
    }
    let other = Event::new(
        "misled",
        Body::RenderDone {
            key: "tiles/a.png".parse().unwrap(),
            duration_ms: 1,
            failure: None,
        },
    );
    log.append_message(Topic::Observation, "k", Bytes::from(other.to_json()))
        .await
        .unwrap();
    log.append(&[event(
        "last",
        vec![observation("a", 0, 9.0), observation("b", 0, 3.0)],
    )])
    .await
    .unwrap();
    let running = Running::start(&log, Arc::new(store.clone()));
    until_read(&log).await;
    running.stop().await;
    let found = store.query(&Filter::default()).await.unwrap().observations;
    let values: Vec<_> = found.iter().map(|o| o.value).collect();
    assert_eq!(values, [9.0, 3.0, 2.0], "the last one of a name stays");
    let rejected = contents(log.as_ref(), Topic::GranuleRejected)
        .await
        .unwrap();
    let offsets: Vec<_> = rejected
        .iter()
        .map(|message| match message.event().unwrap().body {
            Body::GranuleRejected {
                reason,
                origin: Some(origin),
                attempt: 1,
                ..
            } => {
                assert_eq!(reason, RejectReason::Message);
                origin.offset
            }
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(offsets, [1, 2, 3, 4]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_away_for_a_while_loses_nothing() {
    let switch = Switch::new().await;
    let store: Arc<dyn ObservationStore> = Arc::new(switch.store());
    let (_folder, log) = log();
    let running = Running::start(&log, Arc::clone(&store));
    for minute in 0..60 {
        if minute == 10 {
            switch.cut();
        }
        if minute == 50 {
            switch.refuses(2).await;
            assert!(
                log.lag(Topic::Observation, GROUP).await.unwrap() > 0,
                "the cut did not happen"
            );
            switch.mend();
        }
        let rows = vec![observation("a", minute, minute as f64)];
        log.append(&[event(&format!("t{minute}"), rows)])
            .await
            .unwrap();
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    until_read(&log).await;
    running.stop().await;
    let found = store.query(&Filter::default()).await.unwrap().observations;
    let values: Vec<_> = found.iter().map(|o| o.value).collect();
    assert_eq!(values, (0..60).map(f64::from).collect::<Vec<_>>());
    let rejected = contents(log.as_ref(), Topic::GranuleRejected)
        .await
        .unwrap();
    assert!(rejected.is_empty());
    drop(store);
    switch.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_while_the_database_is_away_hands_the_messages_back() {
    let switch = Switch::new().await;
    switch.cut();
    let store: Arc<dyn ObservationStore> = Arc::new(switch.store());
    let (_folder, log) = log();
    log.append(&[event("t", vec![observation("a", 0, 1.0)])])
        .await
        .unwrap();
    let running = Running::start(&log, Arc::clone(&store));
    // It has the message, and nowhere to put it.
    switch.refuses(1).await;
    running.stop().await;
    assert_eq!(log.lag(Topic::Observation, GROUP).await.unwrap(), 1);
    switch.mend();
    let running = Running::start(&log, Arc::clone(&store));
    until_read(&log).await;
    running.stop().await;
    assert_eq!(
        store
            .query(&Filter::default())
            .await
            .unwrap()
            .observations
            .len(),
        1
    );
    switch.close().await;
}
