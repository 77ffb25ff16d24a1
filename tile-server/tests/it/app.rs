//! A server under test: a memory store with a small product in it, the real router, and doubles for the two ports.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, to_bytes};
use axum::http::{HeaderMap, Request, StatusCode};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use contract::time_sample::TimeSample;
use serde_json::Value;
use storage::{Store, domain, fields, manifests};
use tile_server::metrics::Registry;
use tile_server::{AppState, Settings, router};
use tokio::sync::Semaphore;
use tower::ServiceExt as _;

use crate::doubles::{Analyst, Drawer, Observer};

/// 10-degree cells between 60 N and 60 S.
pub(crate) const GRID: Grid = Grid {
    rows: 12,
    cols: 36,
    north_deg: 60.0,
    west_deg: -180.0,
    dlat_deg: 10.0,
    dlon_deg: 10.0,
};
/// Longest wait for an answer: a server whose limits are gone would keep a test for ever.
const ANSWER_LIMIT: Duration = Duration::from_mins(2);
/// Steps of every product: January to March 2000.
pub(crate) const MONTHS: u32 = 3;

pub(crate) struct TestApp {
    pub(crate) store: Store,
    pub(crate) drawer: Arc<Drawer>,
    pub(crate) analyst: Arc<Analyst>,
    pub(crate) observer: Arc<Observer>,
    pub(crate) state: AppState,
    pub(crate) router: Router,
}

pub(crate) struct Answer {
    pub(crate) status: StatusCode,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Bytes,
}

impl Answer {
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {}", self.text()))
    }

    pub(crate) fn reason(&self) -> String {
        self.json()["error"]
            .as_str()
            .unwrap_or_else(|| panic!("no reason: {}", self.text()))
            .to_owned()
    }

    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers
            .get(name)
            .map_or("", |value| value.to_str().unwrap())
    }
}

impl TestApp {
    /// A server whose store holds a flux, what accumulated from it, and a temperature.
    pub(crate) async fn new() -> Self {
        Self::with(|_settings| {}).await
    }

    pub(crate) async fn with(change: impl FnOnce(&mut Settings)) -> Self {
        let app = Self::empty(change);
        let flux = app.land("flux", Quantity::CarbonFlux, 1).await;
        app.land_derived(
            "flux-accumulated",
            Quantity::AccumulatedCarbon,
            1,
            Some(flux),
        )
        .await;
        app.land("sst", Quantity::SeaSurfaceTemperature, 1).await;
        app
    }

    /// A server over a store without products; it reads the list of products at every request.
    pub(crate) fn empty(change: impl FnOnce(&mut Settings)) -> Self {
        Self::over(Store::memory(), change)
    }

    /// A server whose analyst is slow: each series of a place waits for one of `turns`.
    pub(crate) async fn with_turns(
        turns: Arc<Semaphore>,
        change: impl FnOnce(&mut Settings),
    ) -> Self {
        let analyst = Analyst {
            turns: Some(turns),
            ..Analyst::default()
        };
        let app = Self::asking(Arc::new(analyst), Store::memory(), change);
        app.land("flux", Quantity::CarbonFlux, 1).await;
        app
    }

    pub(crate) fn over(store: Store, change: impl FnOnce(&mut Settings)) -> Self {
        Self::asking(Arc::default(), store, change)
    }

    fn asking(analyst: Arc<Analyst>, store: Store, change: impl FnOnce(&mut Settings)) -> Self {
        let mut settings = Settings {
            catalogue_age_ms: 0,
            ..Settings::default()
        };
        change(&mut settings);
        let (drawer, analyst) = (Arc::new(Drawer::over(&store)), analyst);
        let state = AppState::new(
            &settings,
            store.clone(),
            drawer.clone(),
            analyst.clone(),
            Registry::new(),
        )
        .unwrap();
        Self {
            store,
            drawer,
            analyst,
            observer: Arc::default(),
            router: router(state.clone()),
            state,
        }
    }

    /// The same server with observations.
    pub(crate) fn observing(self) -> Self {
        let state = self.state.with_observations(self.observer.clone());
        Self {
            router: router(state.clone()),
            state,
            ..self
        }
    }

    pub(crate) async fn land(&self, product: &str, quantity: Quantity, number: u64) -> ManifestId {
        self.land_derived(product, quantity, number, None).await
    }

    /// Lands a version whose values differ from those of version 1 in the last month only.
    pub(crate) async fn land_last_month(
        &self,
        product: &str,
        quantity: Quantity,
        number: u64,
        derived_from: Option<ManifestId>,
    ) -> ManifestId {
        let scale = |month| if month == MONTHS { number } else { 1 };
        self.land_scaled(product, quantity, number, derived_from, scale)
            .await
    }

    /// Lands a version of a product the way ingest does; its values depend on its number.
    pub(crate) async fn land_derived(
        &self,
        product: &str,
        quantity: Quantity,
        number: u64,
        derived_from: Option<ManifestId>,
    ) -> ManifestId {
        self.land_scaled(product, quantity, number, derived_from, |_month| number)
            .await
    }

    async fn land_scaled(
        &self,
        product: &str,
        quantity: Quantity,
        number: u64,
        derived_from: Option<ManifestId>,
        scale: impl Fn(u32) -> u64,
    ) -> ManifestId {
        let product: ProductId = product.parse().unwrap();
        let value = |month: u32| {
            let scale = scale(month) as f32;
            let land = |cell: usize| cell.is_multiple_of(7);
            let of = move |cell: usize| {
                if land(cell) {
                    f32::NAN
                } else {
                    (month as f32) * 1e-9 * scale
                }
            };
            (0..GRID.cell_count()).map(of).collect::<Vec<f32>>()
        };
        let values: Vec<Vec<f32>> = (1..=MONTHS).map(value).collect();
        let mut steps = vec![];
        for (month, values) in (1..).zip(&values) {
            let period = Period::month(2000, month).unwrap();
            steps.push(Step {
                masked: None,
                period,
                field: fields::write(&self.store, &product, &GRID, values, period)
                    .await
                    .unwrap(),
                raw_sha256: Digest::of(format!("{product}{number}{month}").as_bytes()),
                origin: format!("month-{month}.nc"),
                valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
                contributed: None,
            });
        }
        let known: Vec<bool> = values[0].iter().map(|value| !value.is_nan()).collect();
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            number,
            title: format!("Test {product}"),
            quantity,
            synthetic: product.as_str().starts_with("synthetic"),
            source: "A test & nothing else".to_owned(),
            grid: GRID,
            steps,
            domain: domain::write(&self.store, &product, &known).await.unwrap(),
            series: vec![],
            derived_from,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        };
        manifests::commit(&self.store, &manifest).await.unwrap();
        cube::keep_up(&self.store, &manifest).await;
        manifest.id()
    }

    /// The number of the newest version of a product.
    pub(crate) async fn newest_number(&self, product: &str) -> u64 {
        let newest = manifests::latest(&self.store, &product.parse().unwrap()).await;
        newest.unwrap().unwrap().number
    }

    /// What the newest version of a product is made of at an instant.
    pub(crate) async fn time_sample(&self, product: &str, time: &str) -> TimeSample {
        let newest = manifests::latest(&self.store, &product.parse().unwrap()).await;
        let sample = newest.unwrap().unwrap().time_sample(time.parse().unwrap());
        sample.unwrap()
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        self.get_with(path, &[]).await
    }

    pub(crate) async fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        let mut request = Request::builder().uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        self.send(
            request
                .body(Body::empty())
                .unwrap_or_else(|e| panic!("{path}: {e}")),
        )
        .await
    }

    pub(crate) async fn send(&self, request: Request<Body>) -> Answer {
        let uri = request.uri().clone();
        let answered = async {
            let answer = self.router.clone().oneshot(request).await.unwrap();
            let (parts, body) = answer.into_parts();
            Answer {
                status: parts.status,
                headers: parts.headers,
                body: to_bytes(body, 64 << 20).await.unwrap(),
            }
        };
        let answer = tokio::time::timeout(ANSWER_LIMIT, answered).await;
        answer.unwrap_or_else(|_late| panic!("{uri} is not answered"))
    }

    /// The count in one line of `/metrics`, 0 if it is not there.
    pub(crate) async fn metric(&self, line: &str) -> u64 {
        let text = self.get("/metrics").await.text();
        let value = text
            .lines()
            .find_map(|l| l.strip_prefix(line)?.strip_prefix(' '));
        value.map_or(0, |value| value.parse().unwrap())
    }
}
