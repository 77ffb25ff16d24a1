//! Large pictures that several workers share: the bytes of one worker, kept once, whoever is lost.

use std::sync::Arc;

use contract::annotation::{Annotations, HeightScale};
use contract::encoding::Encoding;
use contract::job::{Mode, RenderJob};
use prometheus::Registry;
use render::Backend;
use render_worker::annotation::{self, Lifted};
use render_worker::desk::{Order, Origin, Storing};
use render_worker::fleet::FleetSettings;
use storage::Store;

use crate::here::Here;
use crate::process::WorkerProcess;
use crate::scenes::globe;
use crate::stored::{quick, slow, two_months_in};
use crate::worker::{Worker, drawn_here, fleet_over, fleet_settings, metric, until};

const TOGETHER: &str = "fluxglobe_render_fleet_put_together_total";
const TRIES: &str = "fluxglobe_render_fleet_tries_total";

/// Everything is large to it.
fn sharing(workers: &[&str]) -> FleetSettings {
    FleetSettings {
        render_parts_above: 1,
        ..fleet_settings(workers)
    }
}

/// A view with lines and a height bar over it, which cross the edges of strips; how high the bar is nobody knows who draws
/// a strip.
fn annotated(job: &RenderJob) -> RenderJob {
    let mut annotated = RenderJob {
        mode: Mode::Volume,
        view: globe(-150.0, 30.0, 2e7, 480),
        ..job.clone()
    };
    annotated.annotations = Some(Annotations {
        graticule: Some(contract::annotation::Graticule { step_deg: 10.0 }),
        height: Some(HeightScale {
            since: "2000".parse().unwrap(),
        }),
        ..Annotations::none()
    });
    annotated
}

fn drawn_by(worker: &Worker) -> u64 {
    worker.metric(
        "fluxglobe_render_worker_pictures_total",
        &[("origin", "drawn")],
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_share_a_large_picture_and_its_bytes_are_those_of_one() {
    let store = Store::memory();
    let job = annotated(&two_months_in(&store).await);
    let alone = Store::memory();
    two_months_in(&alone).await;
    let expected = drawn_here(&alone, &job).await;
    let bar = annotation::drawing(&job, &Lifted::default()).unwrap();
    assert!(bar.is_some_and(|svg| svg.contains("given off or taken up here")));
    let workers: Vec<Worker> = (0..3).map(|_| Worker::start(&store, 1, 4)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let registry = Registry::new();
    let fleet = fleet_over(&store, &sharing(&names), &registry).await;
    let order = Order::on_demand(Storing::Keep);
    let picture = fleet.draw(&job, order, "t").await.unwrap();
    assert_eq!(picture.origin, Origin::Drawn);
    assert!(picture.bytes == expected, "other bytes");
    assert_eq!(store.get(&job.key()).await.unwrap(), expected, "it is kept");
    let drawn: Vec<u64> = workers.iter().map(drawn_by).collect();
    assert_eq!(drawn, [1, 1, 1]);
    assert!(names.iter().all(|name| picture.worker.contains(name)));
    assert_eq!(metric(&registry, TOGETHER, &[]), 1);
    // As a JPEG, which nobody keeps.
    let jpeg = Encoding::jpeg(80).unwrap();
    let order = Order::on_demand(Storing::Nothing).encoded(jpeg);
    let shared = fleet.draw(&job, order, "t").await.unwrap();
    let whole = workers[0].desk.draw(&job, order).await.unwrap();
    assert!(shared.bytes == whole.bytes, "another JPEG");
    assert_eq!(metric(&registry, TOGETHER, &[]), 2);
    // Who has not looked in the store has a worker do so; another picture there is the one that is given.
    let order = Order::on_demand(Storing::LookUpAndKeep);
    let found = fleet.draw(&job, order, "t").await.unwrap();
    assert_eq!((found.origin, found.bytes), (Origin::Stored, expected));
    assert_eq!(metric(&registry, TOGETHER, &[]), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_another_picture_has_taken_the_name_of_is_given_from_the_store() {
    let store = Store::memory();
    let job = quick(&two_months_in(&store).await, 1);
    let workers: Vec<Worker> = (0..2).map(|_| Worker::start(&store, 1, 4)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let fleet = fleet_over(&store, &sharing(&names), &Registry::new()).await;
    let theirs = Here::new(store.clone(), Backend::Cpu)
        .draw(&quick(&job, 2))
        .await
        .unwrap();
    store.put_new(&job.key(), theirs.clone()).await.unwrap();
    let order = Order::on_demand(Storing::Keep);
    let given = fleet.draw(&job, order, "t").await.unwrap();
    assert_eq!((given.origin, given.bytes), (Origin::Stored, theirs));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_is_whole_that_is_small_or_that_one_worker_alone_has_a_turn_for() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let workers: Vec<Worker> = (0..2).map(|_| Worker::start(&store, 1, 4)).collect();
    let names: Vec<&str> = workers.iter().map(|w| w.name.as_str()).collect();
    let registry = Registry::new();
    let order = Order::on_demand(Storing::Keep);
    let usual = fleet_over(&store, &fleet_settings(&names), &registry).await;
    usual.draw(&quick(&job, 1), order, "t").await.unwrap();
    assert_eq!(metric(&registry, TOGETHER, &[]), 0, "it is small");
    let registry = Registry::new();
    let fleet = Arc::new(fleet_over(&store, &sharing(&names), &registry).await);
    let busy = {
        let (desk, job) = (workers[0].desk.clone(), slow(&job, 1));
        tokio::spawn(async move { desk.draw(&job, order).await })
    };
    until("it was asked again how it is", || {
        fleet.loads()[&workers[0].name] > 0
    })
    .await;
    fleet.draw(&quick(&job, 2), order, "t").await.unwrap();
    assert_eq!(metric(&registry, TOGETHER, &[]), 0);
    busy.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_killed_in_the_middle_of_its_part_has_it_drawn_by_another() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let job = slow(&two_months_in(&store).await, 1);
    let mut processes: Vec<_> = (0..2)
        .map(|_| WorkerProcess::start(folder.path()))
        .collect();
    let names: Vec<String> = processes.iter().map(|p| p.name.clone()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let registry = Registry::new();
    let fleet = fleet_over(&store, &sharing(&names), &registry).await;
    let drawing = {
        let (fleet, job) = (fleet.clone(), job.clone());
        let order = Order::on_demand(Storing::Keep);
        tokio::spawn(async move { fleet.draw(&job, order, "t").await })
    };
    until("both draw a part", || {
        fleet.loads().values().all(|pictures| *pictures > 0)
    })
    .await;
    tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    processes[0].kill();
    let picture = drawing.await.unwrap().unwrap();
    assert_eq!(picture.worker, processes[1].name);
    assert_eq!(metric(&registry, TRIES, &[("outcome", "elsewhere")]), 1);
    assert_eq!(metric(&registry, TOGETHER, &[]), 1);
    let alone = Store::memory();
    two_months_in(&alone).await;
    assert!(
        picture.bytes == drawn_here(&alone, &job).await,
        "other bytes"
    );
}
