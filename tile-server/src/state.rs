//! What every request can reach, made once at the start.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use storage::Store;
use storage::log::EventLog;

use crate::addresses::Addresses;
use crate::analyses::Analyses;
use crate::backend::{Analyse, Draw, Observe};
use crate::bodies::Bodies;
use crate::catalogue::Catalogue;
use crate::config::Settings;
use crate::cubes::Cubes;
use crate::error::ServeError;
use crate::fair_gate::FairGate;
use crate::gate::Gate;
use crate::live::{Freshness, HotTiles, News};
use crate::metrics::{Metrics, Registry};
use crate::pictures::{Limits, Pictures};
use crate::readiness::Readiness;
use crate::stream;

/// Shared by all requests; clones are handles on the same thing.
#[derive(Clone)]
pub struct AppState(Arc<Parts>);

/// The parts of a running server.
pub struct Parts {
    /// Products.
    pub catalogue: Catalogue,
    /// Products by keys of Zarr.
    pub(crate) cubes: Cubes,
    /// Drawn pictures.
    pub pictures: Pictures,
    /// Tiles that were asked for.
    pub(crate) addresses: Addresses,
    /// Series and budgets.
    pub analyses: Analyses,
    /// Geometries that are sent along.
    pub(crate) bodies: Bodies,
    /// Asked directly only whether it is ready.
    pub drawer: Arc<dyn Draw>,
    /// Finds observations, where there are any.
    pub observer: OnceLock<Arc<dyn Observe>>,
    /// Before questions to the one who finds them.
    pub(crate) observing: Gate,
    /// How the parts were when they were last asked.
    pub(crate) readiness: Readiness,
    /// The event log, once this server follows it.
    pub log: OnceLock<Arc<dyn EventLog>>,
    /// Tiles that are asked for often.
    pub hot: HotTiles,
    /// What viewers are told.
    pub news: News,
    /// Who follows a camera.
    pub(crate) streams: stream::Places,
    /// How long it takes from a notice to a picture.
    pub freshness: Freshness,
    /// Counters of this server.
    pub metrics: Metrics,
    /// Everything that `/metrics` shows.
    pub registry: Registry,
    /// Limits.
    pub settings: Settings,
}

impl AppState {
    /// Puts the parts together; nothing is read or drawn yet.
    pub fn new(
        settings: &Settings,
        store: Store,
        drawer: Arc<dyn Draw>,
        analyst: Arc<dyn Analyse>,
        registry: Registry,
    ) -> Result<Self, ServeError> {
        let metrics = Metrics::register(&registry)?;
        let at_once = settings
            .draws_at_once
            .unwrap_or_else(|| drawer.draws_at_once());
        let draws = Gate::new(at_once.get(), settings.draw_queue);
        let analyses = FairGate::new(
            settings.analyses_at_once,
            settings.analysis_queue,
            metrics.analyses_waiting.clone(),
        );
        let max_age = Duration::from_millis(settings.catalogue_age_ms);
        let limits = Limits {
            memory_bytes: settings.tile_memory_bytes,
            stored_bytes_per_day: settings.stored_bytes_per_day,
            request_limit: Duration::from_secs(settings.request_limit_s),
        };
        // Observations are asked of a database of their own.
        let observing = Gate::new(settings.analyses_at_once, settings.analysis_queue);
        Ok(Self(Arc::new(Parts {
            catalogue: Catalogue::new(store.clone(), max_age, metrics.clone()),
            cubes: Cubes::new(store.clone(), metrics.zarr_bytes.clone()),
            pictures: Pictures::new(store, Arc::clone(&drawer), draws, &limits, metrics.clone()),
            addresses: Addresses::default(),
            analyses: Analyses::new(analyst, analyses, metrics.clone()),
            bodies: Bodies::new(metrics.body_bytes.clone()),
            drawer,
            observer: OnceLock::new(),
            observing,
            readiness: Readiness::default(),
            log: OnceLock::new(),
            hot: HotTiles::default(),
            news: News::new(start_ms()),
            streams: stream::Places::new(settings.streams),
            freshness: Freshness::register(&registry)?,
            metrics,
            registry,
            settings: settings.clone(),
        })))
    }

    /// The same with somebody who finds observations.
    #[must_use]
    pub fn with_observations(self, observer: Arc<dyn Observe>) -> Self {
        // Set once, when the parts are put together; a second one would change nothing.
        self.observer.get_or_init(|| observer);
        self
    }
}

/// The time of this start, milliseconds since 1970.
fn start_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_millis() as u64)
}

impl Deref for AppState {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.0
    }
}
