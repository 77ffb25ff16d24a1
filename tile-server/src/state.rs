//! What every request can reach, made once at the start.

use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use storage::Store;

use crate::analyses::Analyses;
use crate::backend::{Analyse, Draw};
use crate::catalogue::Catalogue;
use crate::config::Settings;
use crate::error::ServeError;
use crate::gate::Gate;
use crate::metrics::{Metrics, Registry};
use crate::pictures::Pictures;

/// Shared by all requests; clones are handles on the same thing.
#[derive(Clone)]
pub struct AppState(Arc<Parts>);

/// The parts of a running server.
pub struct Parts {
    /// Products.
    pub catalogue: Catalogue,
    /// Drawn pictures.
    pub pictures: Pictures,
    /// Series and budgets.
    pub analyses: Analyses,
    /// Asked directly only whether it is ready.
    pub drawer: Arc<dyn Draw>,
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
        let draws = Gate::new(settings.draws_at_once, settings.draw_queue);
        let analyses = Gate::new(settings.analyses_at_once, settings.analysis_queue);
        let max_age = Duration::from_millis(settings.catalogue_age_ms);
        let memory_bytes = settings.tile_memory_bytes;
        Ok(Self(Arc::new(Parts {
            catalogue: Catalogue::new(store.clone(), max_age, metrics.clone()),
            pictures: Pictures::new(
                store,
                Arc::clone(&drawer),
                draws,
                memory_bytes,
                metrics.clone(),
            ),
            analyses: Analyses::new(analyst, analyses, metrics.clone()),
            drawer,
            metrics,
            registry,
            settings: settings.clone(),
        })))
    }
}

impl Deref for AppState {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.0
    }
}
