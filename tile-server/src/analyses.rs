//! Series and budgets from the analyst, within limits; those of regions are remembered, since their question names a
//! version.

use std::sync::Arc;

use contract::budget::{BudgetAnswer, BudgetQuery};
use contract::check::Check;
use contract::digest::Digest;
use contract::grid::LonLatDeg;
use contract::series::{PointSeries, RegionSeries, RegionSeriesQuery};
use quick_cache::sync::Cache;

use crate::backend::Analyse;
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::gate::Gate;
use crate::metrics::Metrics;
use crate::single_flight::SingleFlight;

/// Budgets remembered; one of 16 years by month takes 34 KiB.
const BUDGETS: usize = 1000;
/// Series over regions remembered; one of 16 years of days takes 320 KiB.
const AREAS: usize = 100;

/// The analyses of one server.
pub struct Analyses {
    analyst: Arc<dyn Analyse>,
    gate: Gate,
    metrics: Metrics,
    budgets: Cache<Digest, Arc<BudgetAnswer>>,
    flights: SingleFlight<Arc<BudgetAnswer>>,
    areas: Cache<Digest, Arc<RegionSeries>>,
    area_flights: SingleFlight<Arc<RegionSeries>>,
}

impl Analyses {
    /// Nothing computed yet.
    pub fn new(analyst: Arc<dyn Analyse>, gate: Gate, metrics: Metrics) -> Self {
        Self {
            analyst,
            gate,
            metrics,
            budgets: Cache::new(BUDGETS),
            flights: SingleFlight::default(),
            areas: Cache::new(AREAS),
            area_flights: SingleFlight::default(),
        }
    }

    /// The series of the cell at a place.
    pub async fn point(&self, layer: &Layer, place: LonLatDeg) -> Result<PointSeries, ServerError> {
        let _pass = self
            .gate
            .enter()
            .await
            .inspect_err(|_busy| self.metrics.refused.inc())?;
        let (manifest, id) = (&layer.manifest, &layer.id);
        let answer = self.analyst.point(manifest, id, place).await?;
        let (values, steps) = (answer.series.len(), manifest.steps.len());
        if values != steps {
            return Err(ServerError::Defect {
                what: format!("the analyst gave {values} values for {steps} steps"),
            });
        }
        Ok(answer)
    }

    /// A budget of `layer`.
    pub async fn budget(
        &self,
        layer: &Layer,
        query: BudgetQuery,
    ) -> Result<Arc<BudgetAnswer>, ServerError> {
        let key = Digest::of_json(&(
            &layer.id,
            (&query.region, &query.region_name),
            (query.from, query.to, query.step),
            (query.earth, query.cells),
            query.ocean.as_ref().map(|ocean| ocean.id()),
        ));
        if let Some(answer) = self.budgets.get(&key) {
            return Ok(answer);
        }
        let (analyst, gate, metrics) = (
            Arc::clone(&self.analyst),
            self.gate.clone(),
            self.metrics.clone(),
        );
        let manifest = Arc::clone(&layer.manifest);
        let compute = || async move {
            let _pass = gate
                .enter()
                .await
                .inspect_err(|_busy| metrics.refused.inc())?;
            Ok(Arc::new(analyst.budget(&manifest, &query).await?))
        };
        let answer = self.flights.join(key, compute).await?;
        self.budgets.insert(key, Arc::clone(&answer));
        Ok(answer)
    }

    /// A series of `layer` over a region.
    pub async fn area(
        &self,
        layer: &Layer,
        query: RegionSeriesQuery,
    ) -> Result<Arc<RegionSeries>, ServerError> {
        let ocean = query.ocean.as_ref().map(|ocean| ocean.id());
        let region = (&query.region, &query.region_name);
        let asked = (region, query.from, query.to, query.earth, ocean);
        let key = Digest::of_json(&("area", &layer.id, asked));
        if let Some(series) = self.areas.get(&key) {
            return Ok(series);
        }
        let (analyst, gate, metrics) = (
            Arc::clone(&self.analyst),
            self.gate.clone(),
            self.metrics.clone(),
        );
        let manifest = Arc::clone(&layer.manifest);
        let compute = || async move {
            let _pass = gate
                .enter()
                .await
                .inspect_err(|_busy| metrics.refused.inc())?;
            Ok(Arc::new(analyst.area(&manifest, &query).await?))
        };
        let series = self.area_flights.join(key, compute).await?;
        self.areas.insert(key, Arc::clone(&series));
        Ok(series)
    }

    /// Our budgets beside published ones.
    pub async fn check(&self) -> Result<Option<Check>, ServerError> {
        Ok(self.analyst.check().await?)
    }
}
