//! One worker over gRPC: each job drawn once, bounded queues, deadlines, callers who go, versions that differ.

use std::sync::Arc;
use std::time::Duration;

use contract::job::{Mode, RenderJob};
use render::Backend;
use render_worker::desk::{Order, Origin};
use render_worker::fleet::FleetError;
use render_worker::wire::Version;
use render_worker::wire::proto::{DrawRequest, Part, StatusRequest};
use storage::Store;
use tonic::{Code, Request};

use crate::here::Here;
use crate::stored::{quick, slow, two_months_in};
use crate::worker::{
    LIMIT, USUAL, Worker, ask, drawn_here, fleet, fleet_settings, fleet_with, settings,
};

fn request(job: &RenderJob) -> DrawRequest {
    DrawRequest {
        jpeg_quality: 0,
        version: Some(Version::own().into()),
        job_json: serde_json::to_string(job).unwrap(),
        trace: "test".into(),
        storing: 0,
        part: None,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_is_the_same_bytes_by_grpc_as_in_process() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let mut backends = vec![Backend::Cpu];
    if crate::device::is_wanted("bytes by gRPC") {
        backends.push(Backend::Gpu);
    }
    for backend in backends {
        // Each backend its own copy, so that none finds what the other drew.
        let own = Store::memory();
        assert_eq!(two_months_in(&own).await, job);
        let worker = Worker::start_with(&own, &settings(2, 8), backend.clone(), Version::own());
        let fleet = fleet(&[&worker.name]).await;
        let local = Here::new(store.clone(), backend);
        for mode in Mode::SCALAR {
            let job = RenderJob {
                mode,
                ..job.clone()
            };
            let here = local.draw(&job).await.unwrap();
            let there = fleet
                .draw(&job, Order::on_demand(USUAL), "t")
                .await
                .unwrap();
            assert_eq!(there.origin, Origin::Drawn);
            assert_eq!(there.bytes, here, "{mode}");
            assert_eq!(own.get(&job.key()).await.unwrap(), here, "it is kept");
            let again = fleet
                .draw(&job, Order::on_demand(USUAL), "t")
                .await
                .unwrap();
            assert_eq!((again.origin, again.bytes), (Origin::Stored, here));
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn thirty_two_equal_calls_are_one_drawing() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 1);
    let fleet = Arc::new(fleet(&[&worker.name]).await);
    // The only place to draw at is taken, so that all calls meet before anything is drawn.
    let first = ask(&fleet, &slow(&job, 1));
    worker
        .until("the first is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let wanted = quick(&job, 1);
    let calls: Vec<_> = (0..32).map(|_| ask(&fleet, &wanted)).collect();
    let under_way = [("operation", "call")];
    let in_flight = "fluxglobe_render_worker_in_flight";
    worker
        .until("all calls are there", |w| {
            w.metric(in_flight, &under_way) == 33
        })
        .await;
    assert_eq!(
        worker.desk.condition().waiting_on_demand,
        1,
        "one job waits"
    );
    let here = drawn_here(&store, &wanted).await;
    for call in calls {
        assert_eq!(call.await.unwrap().unwrap().bytes, here);
    }
    first.await.unwrap().unwrap();
    let pictures = |origin| {
        worker.metric(
            "fluxglobe_render_worker_pictures_total",
            &[("origin", origin)],
        )
    };
    assert_eq!((pictures("drawn"), pictures("stored")), (2, 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_worker_says_when_to_ask_again_and_draws_what_it_took() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 1);
    let fleet = Arc::new(fleet(&[&worker.name]).await);
    let drawing = ask(&fleet, &slow(&job, 1));
    worker
        .until("one is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let waiting = ask(&fleet, &quick(&job, 1));
    worker
        .until("one waits", |w| w.desk.condition().waiting_on_demand == 1)
        .await;
    let refused = fleet
        .draw(&quick(&job, 2), Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    let FleetError::Busy { retry_after } = refused else {
        panic!("not busy: {refused}");
    };
    assert!(retry_after >= Duration::from_millis(100), "{retry_after:?}");
    drawing.await.unwrap().unwrap();
    waiting.await.unwrap().unwrap();
    fleet
        .draw(&quick(&job, 2), Order::on_demand(USUAL), "t")
        .await
        .unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_time_is_up_is_never_begun() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let fleet = Arc::new(fleet(&[&worker.name]).await);
    let drawing = ask(&fleet, &slow(&job, 1));
    worker
        .until("one is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let late = quick(&job, 1);
    let mut hurried = Request::new(request(&late));
    hurried.set_timeout(Duration::from_millis(50));
    let refused = worker.client().await.draw(hurried).await.unwrap_err();
    assert!(
        matches!(refused.code(), Code::DeadlineExceeded | Code::Cancelled),
        "{refused}"
    );
    assert!(!drawing.is_finished(), "the place was taken all the time");
    worker
        .until("its place is given up", |w| {
            w.desk.condition().waiting_on_demand == 0
        })
        .await;
    drawing.await.unwrap().unwrap();
    worker
        .until("all is done", |w| w.desk.condition().in_flight == 0)
        .await;
    assert!(!store.exists(&late.key()).await.unwrap());
    assert_eq!(
        worker.metric("fluxglobe_render_worker_pictures_total", &[]),
        1
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_that_all_have_given_up_is_not_drawn_to_its_end() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let fleet = Arc::new(fleet(&[&worker.name]).await);
    // Sixteen parts, between which it is asked whether anybody waits.
    let mut large = RenderJob {
        mode: Mode::Map,
        ..slow(&job, 1)
    };
    if let contract::job::View::Globe {
        width_px,
        height_px,
        ..
    } = &mut large.view
    {
        (*width_px, *height_px) = (4096, 4096);
    }
    let (one, other) = (ask(&fleet, &large), ask(&fleet, &large));
    let calls = [("operation", "call")];
    let begun = [("operation", "draw")];
    let in_flight = "fluxglobe_render_worker_in_flight";
    worker
        .until("it is drawn for both", |w| {
            w.metric(in_flight, &calls) == 2 && w.metric(in_flight, &begun) == 1
        })
        .await;
    let waiting = ask(&fleet, &quick(&job, 1));
    worker
        .until("another waits", |w| {
            w.desk.condition().waiting_on_demand == 1
        })
        .await;
    one.abort();
    worker
        .until("one has gone", |w| w.metric(in_flight, &calls) == 2)
        .await;
    assert_eq!(
        worker.metric(in_flight, &begun),
        1,
        "the other still waits for it"
    );
    waiting.abort();
    worker
        .until("a waiting one has gone", |w| {
            w.desk.condition().waiting_on_demand == 0
        })
        .await;
    other.abort();
    worker
        .until("nothing is drawn", |w| w.desk.condition().in_flight == 0)
        .await;
    let ended = "fluxglobe_render_worker_requests_total";
    let dropped = [("operation", "draw"), ("outcome", "dropped")];
    assert_eq!(worker.metric(ended, &dropped), 1);
    assert!(!store.exists(&large.key()).await.unwrap());
    assert!(!store.exists(&quick(&job, 1).key()).await.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn versions_that_differ_are_told_on_both_sides_before_anything_is_drawn() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let older = Version {
        program: "0.0.0-older".into(),
        renderer: 0,
    };
    let worker = Worker::start_with(&store, &settings(1, 4), Backend::Cpu, older);
    let refused = worker.client().await.draw(request(&job)).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    assert!(refused.message().contains("0.0.0-older"), "{refused}");
    let fleet = fleet(&[&worker.name]).await;
    let not_ready = fleet.ready().await.unwrap_err().to_string();
    assert!(not_ready.contains("0.0.0-older"), "{not_ready}");
    let refused = fleet
        .draw(&job, Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(
        matches!(&refused, FleetError::Unavailable(text) if text.contains("0.0.0-older")),
        "{refused}"
    );
    assert_eq!(
        worker.metric("fluxglobe_render_worker_pictures_total", &[]),
        0
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stopping_worker_sends_others_away_and_finishes_what_it_took() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let fleet = Arc::new(fleet(&[&worker.name]).await);
    let drawing = ask(&fleet, &slow(&job, 1));
    worker
        .until("one is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let waiting = ask(&fleet, &quick(&job, 1));
    worker
        .until("one waits", |w| w.desk.condition().waiting_on_demand == 1)
        .await;
    worker.stop.now();
    worker
        .until("it stops", |w| w.desk.condition().stopping)
        .await;
    let refused = fleet
        .draw(&quick(&job, 2), Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(matches!(refused, FleetError::Unavailable(_)), "{refused}");
    assert!(!drawing.is_finished());
    drawing.await.unwrap().unwrap();
    waiting.await.unwrap().unwrap();
    tokio::time::timeout(LIMIT, worker.running)
        .await
        .unwrap()
        .unwrap()
        .unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_part_of_a_picture_is_refused() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let mut client = worker.client().await;
    let part = |left, width| Part {
        left,
        top: 0,
        width,
        height: 1,
    };
    for (job, part, text) in [
        (job.clone(), part(0, 16), "map tiles are drawn whole"),
        (quick(&job, 1), part(60, 5), "64 x 64 pixels lies in it"),
        (quick(&job, 1), part(0, 0), "64 x 64 pixels lies in it"),
    ] {
        let part = Some(part);
        let asked = DrawRequest {
            part,
            ..request(&job)
        };
        let refused = client.draw(asked).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument);
        assert!(refused.message().contains(text), "{}", refused.message());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_job_is_refused_with_a_reason_and_without_work() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let mut client = worker.client().await;
    let good = request(&job);
    let mut beyond = job.clone();
    beyond.style.slices = 100_000;
    let mut unknown = job.clone();
    unknown.value.domain = "domain/nothing/0".parse().unwrap();
    let long = "x".repeat(200_000);
    let cases = [
        (
            DrawRequest {
                job_json: "{".into(),
                ..good.clone()
            },
            Code::InvalidArgument,
            "cannot be read",
        ),
        (request(&beyond), Code::InvalidArgument, "slices"),
        (request(&unknown), Code::NotFound, "nothing"),
        (
            DrawRequest {
                trace: "a\nb".into(),
                ..good.clone()
            },
            Code::InvalidArgument,
            "trace",
        ),
        (
            DrawRequest {
                trace: "t".repeat(129),
                ..good.clone()
            },
            Code::InvalidArgument,
            "trace",
        ),
        (
            DrawRequest {
                job_json: long,
                ..good.clone()
            },
            Code::OutOfRange,
            "limit",
        ),
        (
            DrawRequest {
                version: None,
                ..good.clone()
            },
            Code::FailedPrecondition,
            "no version",
        ),
    ];
    for (bad, code, text) in cases {
        let refused = client.draw(bad).await.unwrap_err();
        assert_eq!(refused.code(), code, "{refused}");
        assert!(refused.message().contains(text), "{refused}");
    }
    assert_eq!(
        worker.metric("fluxglobe_render_worker_pictures_total", &[]),
        0
    );
    client.draw(good).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_status_tells_what_is_resident_and_the_metrics_what_was_read() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    let mut client = worker.client().await;
    for number in 0..3 {
        client.draw(request(&quick(&job, number))).await.unwrap();
    }
    let status = client.status(StatusRequest {}).await.unwrap().into_inner();
    assert_eq!(status.resident_products, ["flux", "flux-accumulated"]);
    assert_eq!(
        (status.queue_length, status.in_flight, status.stopping),
        (0, 0, false)
    );
    assert_eq!(status.adapter, "CPU twins");
    let adapter = [("name", "CPU twins"), ("backend", "none"), ("type", "cpu")];
    assert_eq!(worker.metric("fluxglobe_render_adapter_info", &adapter), 1);
    assert_eq!(status.version, Some(Version::own().into()));
    let reads = |outcome| {
        worker.metric(
            "fluxglobe_render_worker_frame_reads_total",
            &[("outcome", outcome)],
        )
    };
    // Two fields of the flux and one that carbon grows to from nothing, then twice from memory.
    assert_eq!((reads("miss"), reads("hit")), (3, 6));
    assert!(
        worker.metric(
            "fluxglobe_render_worker_resident_bytes",
            &[("place", "memory")]
        ) > 0
    );
    assert!(worker.desk.ready().await.unwrap().contains("CPU twins"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_asks_one_worker_for_no_more_than_it_may() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 64);
    let mut settings = fleet_settings(&[&worker.name]);
    settings.render_in_flight = 1;
    let fleet = Arc::new(fleet_with(&settings, &prometheus::Registry::new()).await);
    let drawing = ask(&fleet, &slow(&job, 1));
    worker
        .until("one is drawn", |w| w.desk.condition().in_flight == 1)
        .await;
    let refused = fleet
        .draw(&quick(&job, 1), Order::on_demand(USUAL), "t")
        .await
        .unwrap_err();
    assert!(matches!(refused, FleetError::Busy { .. }), "{refused}");
    assert_eq!(
        worker.desk.condition().waiting_on_demand,
        0,
        "it was not asked"
    );
    drawing.await.unwrap().unwrap();
}
