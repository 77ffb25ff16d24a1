//! The tile server's questions about observations, put to the observation store of this deployment.

use std::sync::Arc;

use async_trait::async_trait;
use contract::ContractError;
use observations::{ErrorClass, Filter, ObservationError, ObservationStore, TrackQuery};
use tile_server::backend::{
    BackendError, Class, ObservationPage, ObservationQuestion, Observe, Platform, TrackPoint,
    TrackQuestion,
};

/// An observation store as the tile server's port.
pub(crate) struct Observer(pub(crate) Arc<dyn ObservationStore>);

#[async_trait]
impl Observe for Observer {
    async fn platforms(
        &self,
        question: &ObservationQuestion,
    ) -> Result<Vec<Platform>, BackendError> {
        let found = self.0.platforms(&filter(question)?).await.map_err(failed)?;
        let platform = |p: observations::Platform| Platform {
            dataset: p.dataset,
            name: p.name,
            kind: p.kind,
            first: p.first,
            last: p.last,
            lon_deg: p.lon_deg,
            lat_deg: p.lat_deg,
            properties: p.properties,
            count: p.count,
        };
        Ok(found.into_iter().map(platform).collect())
    }

    async fn track(&self, question: &TrackQuestion) -> Result<Vec<TrackPoint>, BackendError> {
        let query = TrackQuery {
            dataset: question.dataset.clone(),
            platform: question.platform.clone(),
            from: question.from,
            to: question.to,
            limit: question.limit,
        };
        let found = self.0.track(&query).await.map_err(failed)?;
        let point = |p: observations::TrackPoint| TrackPoint {
            time: p.time,
            lon_deg: p.lon_deg,
            lat_deg: p.lat_deg,
        };
        Ok(found.into_iter().map(point).collect())
    }

    async fn observations(
        &self,
        question: &ObservationQuestion,
    ) -> Result<ObservationPage, BackendError> {
        let page = self.0.query(&filter(question)?).await.map_err(failed)?;
        Ok(ObservationPage {
            observations: page.observations,
            next: page.next.map(|token| token.to_string()),
        })
    }

    async fn ready(&self) -> Result<(), BackendError> {
        self.0.ready().await.map_err(failed)
    }
}

fn filter(question: &ObservationQuestion) -> Result<Filter, BackendError> {
    let after = question.after.as_deref().map(str::parse).transpose();
    Ok(Filter {
        region: question.region.clone(),
        from: question.from,
        to: question.to,
        properties: question.properties.clone(),
        datasets: question.datasets.clone(),
        platforms: question.platforms.clone(),
        kinds: question.kinds.clone(),
        worst: question.worst,
        limit: question.limit,
        after: after.map_err(|error: ContractError| {
            BackendError::new(Class::BadRequest, error.to_string())
        })?,
    })
}

fn failed(error: ObservationError) -> BackendError {
    let class = match error.class() {
        ErrorClass::BadRequest => Class::BadRequest,
        ErrorClass::Retryable => Class::Unavailable,
        ErrorClass::Internal => Class::Internal,
    };
    let text = match class {
        // The error names servers: the log may know them, whoever asks here need not.
        Class::Unavailable => "the observation store does not answer at the moment".to_owned(),
        _ => error.to_string(),
    };
    BackendError::new(class, text).because(error)
}
