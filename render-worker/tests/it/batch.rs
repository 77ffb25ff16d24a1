//! Jobs from the log: each drawn, stored and told of once, after those that somebody waits for, whatever goes wrong.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use contract::event::{Body, Event, RejectReason};
use contract::job::RenderJob;
use contract::topic::Topic;
use render_worker::batch::{BatchService, GROUP};
use render_worker::desk::{Class, Order};
use service::Stop;
use storage::log::{EmbeddedLog, EventLog as _, contents};
use storage::{StorageError, Store};
use tokio::task::JoinHandle;

use crate::stored::{quick, slow, two_months_in};
use crate::worker::{LIMIT, USUAL, Worker};

fn wanted(job: &RenderJob, trace: &str) -> Event {
    Event::new(
        trace,
        Body::RenderJob {
            job: job.clone().into(),
        },
    )
}

async fn events(log: &EmbeddedLog, topic: Topic) -> Vec<Event> {
    let messages = contents(log, topic).await.unwrap();
    messages.iter().map(|m| m.event().unwrap()).collect()
}

struct Batch {
    stop: Stop,
    running: JoinHandle<Result<(), StorageError>>,
}

impl Batch {
    fn start(worker: &Worker, log: &EmbeddedLog) -> Self {
        let stop = Stop::new();
        let service = BatchService::new(worker.desk.clone(), Arc::new(log.clone()), LIMIT);
        let running = tokio::spawn(service.run(stop.clone()));
        Self { stop, running }
    }

    async fn end(self) {
        self.stop.now();
        tokio::time::timeout(LIMIT, self.running)
            .await
            .unwrap()
            .unwrap()
            .unwrap();
    }
}

async fn until_lag(log: &EmbeddedLog, most: u64) {
    let waiting = async {
        while log.lag(Topic::RenderJob, GROUP).await.unwrap() > most {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    tokio::time::timeout(LIMIT, waiting)
        .await
        .expect("the batch goes on");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_job_is_stored_and_told_of_once_and_failures_say_why() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 2, 8);
    let log = EmbeddedLog::memory();
    let mut noticed = wanted(&quick(&job, 1), "one");
    noticed.noticed = Some("2020-01-01".parse().unwrap());
    let mut unknown = quick(&job, 3);
    unknown.value.domain = "domain/nothing/0".parse().unwrap();
    let other = Event::new(
        "other",
        Body::GranuleNotice {
            path: "a.nc".into(),
            profile: None,
            product: None,
            variable: None,
            indexes: vec![],
            sha256: None,
            size_bytes: None,
            attempt: 1,
        },
    );
    log.append(&[noticed.clone(), wanted(&unknown, "three")])
        .await
        .unwrap();
    for poison in ["no JSON", &other.to_json(), r#"{"schema":99}"#] {
        let content = Bytes::copy_from_slice(poison.as_bytes());
        log.append_message(Topic::RenderJob, "k", content)
            .await
            .unwrap();
    }
    log.append(&[wanted(&quick(&job, 2), "two")]).await.unwrap();
    let batch = Batch::start(&worker, &log);
    until_lag(&log, 0).await;
    batch.end().await;
    let done = events(&log, Topic::RenderDone).await;
    let of = |trace: &str| {
        let mut found = done.iter().filter(|event| event.trace == trace);
        let (first, second) = (found.next().unwrap(), found.next());
        assert_eq!(second, None, "{trace} is told of once");
        let Body::RenderDone { key, failure, .. } = &first.body else {
            panic!("{first:?}");
        };
        (first.noticed, key.clone(), failure.clone())
    };
    assert_eq!(of("one"), (noticed.noticed, quick(&job, 1).key(), None));
    assert_eq!(of("two"), (None, quick(&job, 2).key(), None));
    let (_, _, failure) = of("three");
    assert!(failure.unwrap().contains("nothing"));
    assert_eq!(done.len(), 3);
    for number in [1, 2] {
        assert!(store.exists(&quick(&job, number).key()).await.unwrap());
    }
    let rejected = events(&log, Topic::GranuleRejected).await;
    let offsets: Vec<_> = rejected
        .iter()
        .map(|event| match &event.body {
            Body::GranuleRejected {
                reason: RejectReason::Message,
                origin,
                ..
            } => origin.unwrap().offset,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(offsets, [2, 3, 4]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_that_is_lost_in_the_middle_leaves_every_job_told_of_once() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let log = EmbeddedLog::memory();
    let jobs: Vec<RenderJob> = (0..40).map(|number| quick(&job, number)).collect();
    let all: Vec<Event> = jobs.iter().map(|job| wanted(job, "t")).collect();
    log.append(&all).await.unwrap();
    let mut lost = 0;
    for most in [32, 24, 16] {
        let worker = Worker::start(&store, 2, 8);
        let batch = Batch::start(&worker, &log);
        until_lag(&log, most).await;
        // Not asked to stop: gone, with whatever it had under way.
        batch.running.abort();
        lost += usize::from(log.lag(Topic::RenderJob, GROUP).await.unwrap() > 0);
    }
    assert_eq!(lost, 3, "the fault fired");
    let worker = Worker::start(&store, 2, 8);
    let batch = Batch::start(&worker, &log);
    until_lag(&log, 0).await;
    batch.end().await;
    let mut keys: Vec<_> = events(&log, Topic::RenderDone)
        .await
        .into_iter()
        .map(|event| match event.body {
            Body::RenderDone {
                key, failure: None, ..
            } => key,
            other => panic!("{other:?}"),
        })
        .collect();
    keys.sort();
    let mut expected: Vec<_> = jobs.iter().map(RenderJob::key).collect();
    expected.sort();
    assert_eq!(keys, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_waits_for_a_picture_comes_before_the_batch() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 8);
    let draw = |job: RenderJob, class| {
        let (desk, storing) = (worker.desk.clone(), USUAL);
        let order = Order {
            class,
            ..Order::on_demand(storing)
        };
        tokio::spawn(async move { desk.draw(&job, order).await.unwrap() })
    };
    let first = draw(slow(&job, 1), Class::Batch);
    worker
        .until("the first is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let second = draw(slow(&job, 2), Class::Batch);
    worker
        .until("the second waits", |w| {
            w.desk.condition().waiting_batch == 1
        })
        .await;
    let joined = draw(slow(&job, 3), Class::Batch);
    worker
        .until("the third waits", |w| w.desk.condition().waiting_batch == 2)
        .await;
    let urgent = draw(quick(&job, 1), Class::OnDemand);
    worker
        .until("somebody waits", |w| {
            w.desk.condition().waiting_on_demand == 1
        })
        .await;
    // A batch job that somebody begins to wait for is a batch job no longer.
    let joining = draw(slow(&job, 3), Class::OnDemand);
    worker
        .until("it is promoted", |w| {
            w.desk.condition().waiting_on_demand == 2
        })
        .await;
    assert_eq!(worker.desk.condition().waiting_batch, 1);
    first.await.unwrap();
    urgent.await.unwrap();
    joining.await.unwrap();
    joined.await.unwrap();
    assert!(
        !second.is_finished(),
        "the batch job came before those who wait"
    );
    second.await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_takes_nothing_for_a_while_loses_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 8);
    // A file where the folder of the pictures should be.
    let blocked = folder.path().join("tiles");
    std::fs::write(&blocked, "in the way").unwrap();
    let log = EmbeddedLog::memory();
    log.append(&[wanted(&quick(&job, 1), "t")]).await.unwrap();
    let batch = Batch::start(&worker, &log);
    let not_kept = [("origin", "not_kept")];
    worker
        .until("the fault fires", |w| {
            w.metric("fluxglobe_render_worker_pictures_total", &not_kept) > 0
        })
        .await;
    assert!(
        events(&log, Topic::RenderDone).await.is_empty(),
        "not told of before it is stored"
    );
    std::fs::remove_file(&blocked).unwrap();
    until_lag(&log, 0).await;
    batch.end().await;
    assert_eq!(events(&log, Topic::RenderDone).await.len(), 1);
    assert!(store.exists(&quick(&job, 1).key()).await.unwrap());
}
