//! What a server does when something lands: it shows it, orders the hot tiles that it touches, and tells viewers.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use contract::digest::Digest;
use contract::event::{Body, Event};
use contract::job::{Mode, RenderJob};
use contract::manifest::ManifestId;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use contract::topic::Topic;
use service::Stop;
use storage::log::{EventLog as _, contents};
use storage::{StorageError, manifests};
use tokio::task::JoinHandle;

use crate::app::TestApp;
use crate::doubles::Log;
use crate::events::Viewer;

/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(20);
/// Topics that a server follows.
const TOPICS: usize = 3;

/// What is told of a file that landed.
fn landing(manifest: ManifestId) -> Body {
    let (path, sha256) = ("a.nc".to_owned(), Digest::of(b"a"));
    Body::granule_landed(path, sha256, manifest, &[], true)
}

struct Live {
    app: TestApp,
    log: Arc<Log>,
    stop: Stop,
    running: JoinHandle<Result<(), StorageError>>,
}

impl Live {
    /// A server that by itself would not look for new versions within the time of a test.
    async fn new() -> Self {
        let live = Self::over(Arc::new(Log::default())).await;
        live.follows().await;
        live
    }

    async fn over(log: Arc<Log>) -> Self {
        let app = TestApp::with(|settings| settings.catalogue_age_ms = 3_600_000).await;
        Self::of(app, log)
    }

    fn of(app: TestApp, log: Arc<Log>) -> Self {
        let stop = Stop::new();
        let running = tokio::spawn(app.state.live(log.clone()).run(stop.clone()));
        Self {
            app,
            log,
            stop,
            running,
        }
    }

    async fn follows(&self) {
        self.until(async || self.log.followed.load(Ordering::SeqCst) == TOPICS)
            .await;
    }

    /// Its server has looked at what there is, and then found the log away.
    async fn misses_its_log(&self) {
        self.until(async || self.log.missed.load(Ordering::SeqCst) > 0)
            .await;
    }

    /// Its server has looked for the log more often.
    async fn misses_its_log_again(&self) {
        let before = self.log.missed.load(Ordering::SeqCst);
        // The one look may have begun before this.
        self.until(async || self.log.missed.load(Ordering::SeqCst) > before + 1)
            .await;
    }

    async fn until(&self, is_so: impl AsyncFn() -> bool) {
        let started = Instant::now();
        while !is_so().await {
            assert!(started.elapsed() < LIMIT, "it did not come to that");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    async fn say(&self, body: Body) {
        let mut event = Event::new("trace-1", body);
        event.noticed = Some(noticed());
        self.log.append(&[event]).await.unwrap();
    }

    async fn landed(&self, manifest: &ManifestId) {
        self.say(landing(manifest.clone())).await;
    }

    async fn orders(&self) -> Vec<(Event, RenderJob)> {
        let messages = contents(self.log.as_ref(), Topic::RenderJob).await.unwrap();
        let order = |event: Event| match event.body.clone() {
            Body::RenderJob { job } => (event, *job),
            other => panic!("{other:?}"),
        };
        messages
            .iter()
            .map(|message| order(message.event().unwrap()))
            .collect()
    }

    async fn fresh(&self, path: &str) -> u64 {
        let name = "fluxglobe_tile_server_notice_to_tile_seconds_count";
        self.app
            .metric(&format!(r#"{name}{{path="{path}"}}"#))
            .await
    }
}

fn noticed() -> TimeMs {
    "2020-01-01".parse().unwrap()
}

#[tokio::test]
async fn a_landed_version_is_shown_at_once_and_viewers_are_told() {
    let live = Live::new().await;
    let mut viewer = Viewer::new(&live.app, None).await;
    let new = live
        .app
        .land_last_month("sst", Quantity::SeaSurfaceTemperature, 2, None)
        .await;
    let address = "/api/products/sst/point?lon=15&lat=-5";
    let old = live.app.get(address).await.json()["manifest"].clone();
    assert_ne!(old, new.to_string(), "nobody has said anything yet");
    live.landed(&new).await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], new.to_string());
    assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
    assert_eq!(told.data["touched"].as_array().unwrap().len(), 1);
    let shown = live.app.get(address).await.json()["manifest"].clone();
    assert_eq!(shown, new.to_string());
    live.stop.now();
    live.running.await.unwrap().unwrap();
}

#[tokio::test]
async fn exactly_the_hot_tiles_that_it_touches_are_ordered() {
    let live = Live::new().await;
    for path in [
        "sst/volume/0/0/0.png?time=2000-03-20",
        "sst/volume/1/1/0.png?time=2000-03-20&size=512",
        "sst/map/1/0/0.png?time=2000-02-20",
        "sst/volume/0/0/0.png?time=2000-01-10",
        "flux/volume/0/0/0.png?time=2000-03-20",
        "sst/points/0/0/0.png",
    ] {
        live.app.get(&format!("/tiles/{path}")).await;
    }
    let new = live
        .app
        .land_last_month("sst", Quantity::SeaSurfaceTemperature, 2, None)
        .await;
    live.landed(&new).await;
    live.until(async || !live.orders().await.is_empty()).await;
    let orders = live.orders().await;
    let mut asked: Vec<_> = orders
        .iter()
        .map(|(_, job)| (job.mode, &job.value))
        .collect();
    asked.sort_by_key(|(mode, _)| *mode);
    let (march, february, newest) = (
        live.app.time_sample("sst", "2000-03-20").await,
        live.app.time_sample("sst", "2000-02-20").await,
        live.app.time_sample("sst", "2000-03-16T12:00:00Z").await,
    );
    assert_eq!(
        asked,
        [
            (Mode::Map, &february),
            (Mode::Points, &newest),
            (Mode::Volume, &march),
            (Mode::Volume, &march)
        ],
        "and of the new version"
    );
    for (event, _) in &orders {
        assert_eq!(event.trace, "trace-1");
        assert_eq!(event.noticed, Some(noticed()));
    }
    // What a viewer asks for afterwards is exactly what was ordered.
    live.app
        .get("/tiles/sst/volume/0/0/0.png?time=2000-03-20")
        .await;
    let drawn = live.app.drawer.last_job();
    assert!(orders.iter().any(|(_, job)| *job == drawn));
}

#[tokio::test]
async fn pictures_of_a_flux_wait_for_what_lifts_their_particles() {
    let live = Live::new().await;
    let mut viewer = Viewer::new(&live.app, None).await;
    live.app
        .get("/tiles/flux/volume/0/0/0.png?time=2000-03-20")
        .await;
    let flux = live
        .app
        .land_last_month("flux", Quantity::CarbonFlux, 2, None)
        .await;
    live.landed(&flux).await;
    assert_eq!(viewer.next().await.unwrap().data["product"], "flux");
    assert!(live.orders().await.is_empty());
    let (product, quantity) = ("flux-accumulated", Quantity::AccumulatedCarbon);
    let lift = live
        .app
        .land_last_month(product, quantity, 2, Some(flux.clone()))
        .await;
    live.say(Body::ProductDerived {
        manifest: lift,
        derived_from: flux.clone(),
    })
    .await;
    assert_eq!(viewer.next().await.unwrap().data["product"], product);
    let again = viewer.next().await.unwrap();
    assert_eq!(
        again.data["manifest"],
        flux.to_string(),
        "it looks different now"
    );
    live.until(async || !live.orders().await.is_empty()).await;
    let orders = live.orders().await;
    assert_eq!(orders.len(), 1);
    let time = "2000-03-20";
    assert_eq!(orders[0].1.value, live.app.time_sample("flux", time).await);
    let lifting = live.app.time_sample(product, time).await;
    assert_eq!(orders[0].1.accumulated, Some(lifting));
}

#[tokio::test]
async fn the_time_from_notice_to_tile_is_measured_once_each_way() {
    let live = Live::new().await;
    let tile = "/tiles/sst/volume/0/0/0.png?time=2000-03-20";
    live.app.get(tile).await;
    assert_eq!(live.fresh("asked").await, 0, "it follows from no notice");
    let mut viewer = Viewer::new(&live.app, None).await;
    let new = live
        .app
        .land_last_month("sst", Quantity::SeaSurfaceTemperature, 2, None)
        .await;
    live.landed(&new).await;
    viewer.next().await.unwrap();
    live.until(async || !live.orders().await.is_empty()).await;
    live.app.get("/tiles/sst/map/0/0/0.png").await;
    assert_eq!(live.fresh("asked").await, 0, "a map is no volume tile");
    for _ in 0..2 {
        live.app.get(tile).await;
    }
    assert_eq!(live.fresh("asked").await, 1);
    let key = live.orders().await[0].1.key();
    for failure in [Some("no".to_owned()), None, None] {
        live.say(Body::RenderDone {
            key: key.clone(),
            duration_ms: 1,
            failure,
        })
        .await;
    }
    live.until(async || live.fresh("hot").await > 0).await;
    assert_eq!(live.fresh("hot").await, 1);
}

#[tokio::test]
async fn messages_that_are_no_events_change_nothing() {
    let live = Live::new().await;
    let mut viewer = Viewer::new(&live.app, None).await;
    live.log
        .append_message(Topic::GranuleLanded, "k", "no event".into())
        .await
        .unwrap();
    live.landed(&"nothing@7-00000000".parse().unwrap()).await;
    let new = live
        .app
        .land("sst", Quantity::SeaSurfaceTemperature, 2)
        .await;
    live.landed(&new).await;
    live.landed(&new).await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], new.to_string(), "told first");
    assert!(!live.running.is_finished());
}

#[tokio::test]
async fn a_log_that_is_away_is_waited_for_and_what_landed_meanwhile_is_told() {
    let log = Arc::new(Log::default());
    log.is_away.store(true, Ordering::SeqCst);
    let live = Live::over(log).await;
    let mut viewer = Viewer::new(&live.app, None).await;
    live.misses_its_log().await;
    let new = live
        .app
        .land_last_month("sst", Quantity::SeaSurfaceTemperature, 2, None)
        .await;
    live.log.is_away.store(false, Ordering::SeqCst);
    live.follows().await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], new.to_string());
    assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
}

#[tokio::test]
async fn the_first_product_of_an_empty_store_is_told_of_though_the_log_was_away_when_it_landed() {
    let log = Arc::new(Log::default());
    log.is_away.store(true, Ordering::SeqCst);
    let live = Live::of(TestApp::empty(|_settings| {}), log);
    let mut viewer = Viewer::new(&live.app, None).await;
    live.misses_its_log().await;
    let (product, quantity) = ("sst", Quantity::SeaSurfaceTemperature);
    let first = live.app.land(product, quantity, 1).await;
    // Somebody sees it in the list while the log is still looked for: it is no less news to those who do not look.
    live.until(async || {
        let listed = live.app.get("/api/products").await.json();
        listed["products"][0]["product"] == product
    })
    .await;
    live.misses_its_log_again().await;
    live.log.is_away.store(false, Ordering::SeqCst);
    live.follows().await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], first.to_string());
    let all = serde_json::json!([{"start": "2000-01-01T00:00:00Z", "end": "2000-04-01T00:00:00Z"}]);
    assert_eq!(told.data["touched"], all, "all that there is");
    // Its event comes when the log is back, and is no news.
    live.landed(&first).await;
    let second = live.app.land_last_month(product, quantity, 2, None).await;
    live.landed(&second).await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], second.to_string());
    assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
    live.stop.now();
    live.running.await.unwrap().unwrap();
}

#[tokio::test]
async fn what_lifts_a_flux_since_the_log_was_away_is_news_of_it_and_is_drawn_when_it_is_heard_of() {
    let log = Arc::new(Log::default());
    log.is_away.store(true, Ordering::SeqCst);
    let live = Live::over(log).await;
    let (app, time) = (&live.app, "2000-03-20");
    let mut viewer = Viewer::new(app, None).await;
    app.get(&format!("/tiles/flux/volume/0/0/0.png?time={time}"))
        .await;
    live.misses_its_log().await;
    let flux = manifests::latest(&app.store, &"flux".parse().unwrap()).await;
    let flux = flux.unwrap().unwrap().id();
    let (product, quantity) = ("flux-accumulated", Quantity::AccumulatedCarbon);
    let lift = app
        .land_last_month(product, quantity, 2, Some(flux.clone()))
        .await;
    live.log.is_away.store(false, Ordering::SeqCst);
    let mut names = vec![];
    for _ in 0..2 {
        let told = viewer.next().await.unwrap();
        names.push(told.data["manifest"].as_str().unwrap().to_owned());
        assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
    }
    names.sort();
    assert_eq!(
        names,
        [lift.to_string(), flux.to_string()],
        "it is lifted by something else now"
    );
    // It was appended after the server began to follow, and before it looked at what there is.
    let derived = Body::ProductDerived {
        manifest: lift,
        derived_from: flux,
    };
    live.say(derived.clone()).await;
    live.until(async || !live.orders().await.is_empty()).await;
    let lifting = app.time_sample(product, time).await;
    assert_eq!(live.orders().await[0].1.accumulated, Some(lifting));
    // Heard again, it is drawn no more; and nothing of this is told twice.
    live.say(derived).await;
    let sst = app
        .land_last_month("sst", Quantity::SeaSurfaceTemperature, 2, None)
        .await;
    live.landed(&sst).await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], sst.to_string());
    assert_eq!(live.orders().await.len(), 1);
}

#[tokio::test]
async fn without_a_log_what_another_process_lands_is_told_all_the_same() {
    let app = TestApp::new().await;
    let watch = app.state.watch().every(Duration::from_millis(20));
    let watching = tokio::spawn(watch.run());
    let mut viewer = Viewer::new(&app, None).await;
    // What is there already is no news, however often it is looked at.
    tokio::time::sleep(Duration::from_millis(200)).await;
    let (quantity, carbon) = (Quantity::CarbonFlux, Quantity::AccumulatedCarbon);
    let flux = app.land_last_month("flux", quantity, 2, None).await;
    let told = viewer.next().await.unwrap();
    assert_eq!(told.data["manifest"], flux.to_string());
    assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
    let lift = app
        .land_last_month("flux-accumulated", carbon, 2, Some(flux.clone()))
        .await;
    let mut names = vec![];
    for _ in 0..2 {
        let told = viewer.next().await.unwrap();
        names.push(told.data["manifest"].as_str().unwrap().to_owned());
        assert_eq!(told.data["touched"][0]["start"], "2000-02-01T00:00:00Z");
    }
    names.sort();
    assert_eq!(
        names,
        [lift.to_string(), flux.to_string()],
        "it is lifted by something else now"
    );
    app.state.news.close();
    watching.await.unwrap();
}

#[tokio::test]
async fn a_new_northward_part_is_news_of_the_flow_whose_hot_tiles_are_ordered() {
    a_northward_part_is_news_of_the_flow(|northward, _flux| landing(northward)).await;
}

#[tokio::test]
async fn a_northward_part_that_was_computed_is_news_of_the_flow_too() {
    a_northward_part_is_news_of_the_flow(|northward, flux| Body::ProductDerived {
        manifest: northward,
        derived_from: flux,
    })
    .await;
}

/// `told` is how the event log tells of a version of a northward part; another version is at hand.
async fn a_northward_part_is_news_of_the_flow(told: impl Fn(ManifestId, ManifestId) -> Body) {
    let live = Live::new().await;
    for part in ["sea-east", "sea-north"] {
        let id = live.app.land(part, Quantity::Current, 1).await;
        live.landed(&id).await;
    }
    let tile = "/tiles/sea-east/flow/0/0/0.png?time=2000-03-20";
    live.until(async || live.app.get(tile).await.status == 200)
        .await;
    let mut viewer = Viewer::new(&live.app, None).await;
    let new = live
        .app
        .land_last_month("sea-north", Quantity::Current, 2, None)
        .await;
    let flux = manifests::latest(&live.app.store, &"flux".parse().unwrap()).await;
    live.say(told(new.clone(), flux.unwrap().unwrap().id()))
        .await;
    while viewer.next().await.unwrap().data["manifest"] != new.to_string() {}
    let told = viewer.next().await.unwrap().data;
    let manifest = told["manifest"].as_str().unwrap();
    assert!(manifest.starts_with("sea-east@1-"), "{manifest}");
    assert_eq!(told["touched"][0]["start"], "2000-02-01T00:00:00Z");
    let wanted = live.app.time_sample("sea-north", "2000-03-20").await;
    let is_wanted = |(_, job): &(Event, RenderJob)| {
        let flow = job.flow.as_ref();
        flow.is_some_and(|flow| flow.northward == wanted)
    };
    live.until(async || live.orders().await.iter().any(is_wanted))
        .await;
    live.stop.now();
    live.running.await.unwrap().unwrap();
}
