//! Several workers: each product stays on one, and pictures are drawn elsewhere when one is full, slow, lost or away.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::job::RenderJob;
use prometheus::Registry;
use render_worker::desk::Order;
use render_worker::fleet::{FleetError, Health, ranked};
use render_worker::wire::proto::StatusRequest;
use render_worker::wire::proto::renderer_client::RendererClient;
use storage::Store;

use crate::process::WorkerProcess;
use crate::stored::{at, quick, slow, two_months, two_months_in};
use crate::worker::{
    LIMIT, USUAL, Worker, ask, drawn_here, fleet, fleet_settings, fleet_with, metric, until,
};

const TRIES: &str = "fluxglobe_render_fleet_tries_total";

/// The store of a folder, which several processes share.
async fn shared_store() -> (tempfile::TempDir, Store, RenderJob) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let job = two_months_in(&store).await;
    (folder, store, job)
}

/// The worker that is asked for a picture first: the one of the field that it begins with.
fn first_asked<'a>(job: &RenderJob, names: &[&'a str]) -> &'a str {
    let field = job.value.before.as_ref().unwrap();
    names[ranked(field.as_str(), names)[0]]
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_between_the_same_fields_are_drawn_on_one_worker() {
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let workers: Vec<Worker> = (0..3).map(|_| Worker::start(&store, 1, 64)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let fleet = fleet(&names).await;
    let mut by_interval: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (interval, times) in [
        ("first month", ["2000-01-02", "2000-01-03"]),
        ("between", ["2000-01-16T12:00:00Z", "2000-02-10"]),
        ("last month", ["2000-02-25", "2000-02-26"]),
    ] {
        for (number, time) in (0..).zip(times) {
            let job = quick(&at(&flux, &carbon, time), number);
            let first = first_asked(&job, &names);
            let picture = fleet
                .draw(&job, Order::on_demand(USUAL), "t")
                .await
                .unwrap();
            assert_eq!(picture.worker, first, "{interval}");
            by_interval
                .entry(interval)
                .or_default()
                .insert(picture.worker);
        }
    }
    assert!(
        by_interval.values().all(|workers| workers.len() == 1),
        "{by_interval:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_killed_in_the_middle_of_a_tile_has_it_drawn_elsewhere_with_equal_bytes() {
    let (folder, store, job) = shared_store().await;
    let mut processes: Vec<_> = (0..2)
        .map(|_| WorkerProcess::start(folder.path()))
        .collect();
    let names: Vec<String> = processes.iter().map(|p| p.name.clone()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let registry = Registry::new();
    let fleet = Arc::new(fleet_with(&fleet_settings(&names), &registry).await);
    let job = slow(&job, 1);
    let first = first_asked(&job, &names).to_owned();
    let call = ask(&fleet, &job);
    let mut client = RendererClient::connect(format!("http://{first}"))
        .await
        .unwrap();
    let begun = Instant::now();
    while client
        .status(StatusRequest {})
        .await
        .unwrap()
        .into_inner()
        .in_flight
        == 0
    {
        assert!(begun.elapsed() < LIMIT, "the tile was never begun");
    }
    assert!(
        !store.exists(&job.key()).await.unwrap(),
        "it is in the middle of the tile"
    );
    let victim = processes.iter_mut().find(|p| p.name == first).unwrap();
    victim.kill();
    let killed = Instant::now();
    let picture = call.await.unwrap().unwrap();
    println!(
        "drawn elsewhere {} ms after the kill",
        killed.elapsed().as_millis()
    );
    assert_ne!(picture.worker, first);
    assert_eq!(
        metric(&registry, TRIES, &[("outcome", "elsewhere")]),
        1,
        "the fault fired"
    );
    let alone = Store::memory();
    two_months_in(&alone).await;
    assert_eq!(picture.bytes, drawn_here(&alone, &job).await);
    // The next picture does not ask the lost one first.
    let tries = metric(&registry, TRIES, &[]);
    fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap();
    assert_eq!(metric(&registry, TRIES, &[]), tries + 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_worker_is_not_waited_for() {
    let (folder, _store, job) = shared_store().await;
    let processes: Vec<_> = (0..2)
        .map(|_| WorkerProcess::start(folder.path()))
        .collect();
    let names: Vec<&str> = processes.iter().map(|p| p.name.as_str()).collect();
    let registry = Registry::new();
    let mut settings = fleet_settings(&names);
    settings.render_hedge_ms = 300;
    let fleet = fleet_with(&settings, &registry).await;
    let job = quick(&job, 1);
    let first = first_asked(&job, &names);
    processes.iter().find(|p| p.name == first).unwrap().freeze();
    let picture = fleet
        .draw(&job, Order::on_demand(USUAL), "t")
        .await
        .unwrap();
    assert_ne!(picture.worker, first);
    assert_eq!(
        metric(&registry, TRIES, &[("outcome", "hedged")]),
        1,
        "the fault fired"
    );
    until("the frozen one is known to be away", || {
        matches!(fleet.health()[first], Health::Down(_))
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_worker_is_passed_over() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let workers: Vec<Worker> = (0..2).map(|_| Worker::start(&store, 1, 0)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let registry = Registry::new();
    let fleet = Arc::new(fleet_with(&fleet_settings(&names), &registry).await);
    let first = first_asked(&job, &names);
    let full = workers.iter().find(|w| w.name == first).unwrap();
    let drawing = ask(&fleet, &slow(&job, 1));
    full.until("it is full", |w| w.desk.condition().in_flight == 1)
        .await;
    let picture = fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap();
    assert_ne!(picture.worker, first);
    assert_eq!(metric(&registry, TRIES, &[("outcome", "busy")]), 1);
    drawing.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn an_instant_that_many_want_is_drawn_by_all_workers() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let workers: Vec<Worker> = (0..3).map(|_| Worker::start(&store, 1, 64)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let fleet = Arc::new(fleet(&names).await);
    // One at a time stays where its fields are.
    let mut drawn: BTreeMap<String, usize> = BTreeMap::new();
    for number in 0..3 {
        let picture = fleet
            .draw(&quick(&job, number), Order::on_demand(USUAL), "t")
            .await
            .unwrap();
        *drawn.entry(picture.worker).or_default() += 1;
    }
    assert_eq!(drawn, [(first_asked(&job, &names).to_owned(), 3)].into());
    let calls: Vec<_> = (1..=12)
        .map(|number| ask(&fleet, &slow(&job, number)))
        .collect();
    drawn.clear();
    for call in calls {
        *drawn
            .entry(call.await.unwrap().unwrap().worker)
            .or_default() += 1;
    }
    assert!(
        drawn.len() == 3 && drawn.values().all(|&of_one| of_one >= 3),
        "{drawn:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_may_come_later_than_those_who_ask() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    // A port that was free a moment ago.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let mut worker_settings = crate::worker::settings(1, 8);
    worker_settings.render_listen = port.local_addr().unwrap();
    drop(port);
    let name = worker_settings.render_listen.to_string();
    let fleet = fleet(&[&name]).await;
    assert!(matches!(
        fleet.ready().await,
        Err(FleetError::Unavailable(_))
    ));
    let refused = fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(matches!(refused, FleetError::Unavailable(_)), "{refused}");
    let own = render_worker::wire::Version::own();
    let backend = render::Backend::Cpu;
    let _worker = Worker::start_with(&store, &worker_settings, backend, own);
    until("it is found", || fleet.health()[&name] == Health::Up).await;
    assert_eq!(fleet.ready().await.unwrap(), "1 of 1 render workers");
    fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_brings_the_workers_at_its_addresses() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 8);
    let (_, port) = worker.name.rsplit_once(':').unwrap();
    let named = format!("dns:localhost:{port}");
    let fleet = fleet(&[&named]).await;
    until("one address answers", || {
        fleet.health().values().any(|health| *health == Health::Up)
    })
    .await;
    let picture = fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap();
    assert_eq!(picture.worker, worker.name);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_cannot_be_looked_up_holds_up_no_other() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 8);
    let (_, port) = worker.name.rsplit_once(':').unwrap();
    let named = format!("dns:localhost:{port}");
    let (named, nowhere) = (named.as_str(), "dns:nowhere.invalid:1");
    for names in [[nowhere, named], [named, nowhere]] {
        let fleet = fleet(&names).await;
        until("one address answers", || {
            fleet.health().values().any(|health| *health == Health::Up)
        })
        .await;
        let picture = fleet
            .draw(&job, Order::on_demand(USUAL), "t")
            .await
            .unwrap();
        assert_eq!(picture.worker, worker.name, "{names:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_answer_within_the_time_is_an_error_within_the_time() {
    let (folder, _store, job) = shared_store().await;
    let process = WorkerProcess::start(folder.path());
    let mut settings = fleet_settings(&[&process.name]);
    settings.render_deadline_ms = 400;
    let fleet = fleet_with(&settings, &Registry::new()).await;
    process.freeze();
    let begun = Instant::now();
    let late = fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    let took = begun.elapsed();
    let limit = Duration::from_millis(400);
    assert_eq!(late, FleetError::Late { deadline: limit });
    assert!(took >= limit && took < limit * 10, "{took:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_no_worker_would_draw_is_asked_of_none() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 8);
    let registry = Registry::new();
    let fleet = fleet_with(&fleet_settings(&[&worker.name]), &registry).await;
    let mut beyond = job.clone();
    beyond.style.slices = 0;
    let refused = fleet
        .draw(&beyond, Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(matches!(refused, FleetError::BadRequest(_)), "{refused}");
    let mut unknown = job;
    unknown.value.domain = "domain/nothing/0".parse().unwrap();
    assert_eq!(metric(&registry, TRIES, &[]), 0);
    let refused = fleet
        .draw(&unknown, Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(matches!(refused, FleetError::NotFound(_)), "{refused}");
}
