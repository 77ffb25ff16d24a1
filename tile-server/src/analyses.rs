//! Series and budgets from the analyst, within limits; those of regions are remembered, since their question names a
//! version.

use std::sync::Arc;

use contract::digest::Digest;
use quick_cache::sync::Cache;

use crate::backend::{
    Analyse, AreaRequest, AreaSeries, BudgetAnswer, BudgetRequest, Check, PointStep, RowCol,
};
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::gate::Gate;
use crate::metrics::Metrics;
use crate::single_flight::SingleFlight;

/// Budgets remembered; one of 16 years by month takes 8 KiB.
const BUDGETS: usize = 1000;
/// Series over regions remembered; one of 16 years of days takes 280 KiB.
const AREAS: usize = 100;

/// The analyses of one server.
pub struct Analyses {
    analyst: Arc<dyn Analyse>,
    gate: Gate,
    metrics: Metrics,
    budgets: Cache<Digest, Arc<BudgetAnswer>>,
    flights: SingleFlight<Arc<BudgetAnswer>>,
    areas: Cache<Digest, Arc<AreaSeries>>,
    area_flights: SingleFlight<Arc<AreaSeries>>,
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

    /// The values of a cell, one for each step, stored unit.
    pub async fn point(&self, layer: &Layer, cell: RowCol) -> Result<Vec<PointStep>, ServerError> {
        let _pass = self
            .gate
            .enter()
            .await
            .inspect_err(|_busy| self.metrics.refused.inc())?;
        let values = self.analyst.point(&layer.manifest, cell).await?;
        let steps = layer.manifest.steps.len();
        if values.len() != steps {
            return Err(ServerError::Defect {
                what: format!("the analyst gave {} values for {steps} steps", values.len()),
            });
        }
        Ok(values)
    }

    /// The budget of a request about `layer`.
    pub async fn budget(
        &self,
        layer: &Layer,
        request: BudgetRequest,
    ) -> Result<Arc<BudgetAnswer>, ServerError> {
        let key = Digest::of_json(&(
            &layer.id,
            &request.region,
            request.period,
            request.step,
            (request.earth, request.cells),
            request.ocean.as_ref().map(|ocean| ocean.id()),
        ));
        if let Some(answer) = self.budgets.get(&key) {
            return Ok(answer);
        }
        let (analyst, gate, metrics) = (
            Arc::clone(&self.analyst),
            self.gate.clone(),
            self.metrics.clone(),
        );
        let compute = || async move {
            let _pass = gate
                .enter()
                .await
                .inspect_err(|_busy| metrics.refused.inc())?;
            Ok(Arc::new(analyst.budget(&request).await?))
        };
        let answer = self.flights.join(key, compute).await?;
        self.budgets.insert(key, Arc::clone(&answer));
        Ok(answer)
    }

    /// The series over a region of a request about `layer`.
    pub async fn area(
        &self,
        layer: &Layer,
        request: AreaRequest,
    ) -> Result<Arc<AreaSeries>, ServerError> {
        let ocean = request.ocean.as_ref().map(|ocean| ocean.id());
        let asked = (&request.region, request.period, request.earth, ocean);
        let key = Digest::of_json(&("area", &layer.id, asked));
        if let Some(series) = self.areas.get(&key) {
            return Ok(series);
        }
        let (analyst, gate, metrics) = (
            Arc::clone(&self.analyst),
            self.gate.clone(),
            self.metrics.clone(),
        );
        let compute = || async move {
            let _pass = gate
                .enter()
                .await
                .inspect_err(|_busy| metrics.refused.inc())?;
            Ok(Arc::new(analyst.area(&request).await?))
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
