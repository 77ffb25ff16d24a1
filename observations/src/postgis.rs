//! Observations in PostGIS: a table with a natural key, asked in the order of that key.

mod pool;
mod question;
mod row;
mod upsert;

use async_trait::async_trait;
use contract::observation::{
    Filter, Observation, Page, Platform, PlatformList, TrackPoint, TrackQuery,
};
use contract::product::ProductId;
use tokio_postgres::types::ToSql;

use crate::error::ObservationError;
use crate::filter::{self, CheckedFilter};
use crate::settings::DatabaseSettings;
use crate::store::{Counts, ObservationStore};
use crate::{batch, platform, track};
use pool::Connections;
use question::Question;

/// Observations in a PostGIS database; clones share its connections.
#[derive(Clone)]
pub struct PostgisStore {
    connections: Connections,
}

impl PostgisStore {
    /// A store that connects, and brings the tables to this version, with its first call.
    pub fn new(settings: &DatabaseSettings) -> Result<Self, ObservationError> {
        Ok(Self {
            connections: Connections::new(settings)?,
        })
    }

    async fn rows(
        &self,
        action: &'static str,
        question: &Question<'_>,
    ) -> Result<Vec<tokio_postgres::Row>, ObservationError> {
        let parameters: Vec<&(dyn ToSql + Sync)> = question.parameters();
        let client = self.connections.client().await?;
        let asked = client.query(question.sql(), &parameters);
        let answer = self.connections.within(asked).await;
        self.connections.settle(action, client, answer)
    }
}

#[async_trait]
impl ObservationStore for PostgisStore {
    async fn upsert(&self, observations: &[Observation]) -> Result<Counts, ObservationError> {
        let batch = batch::prepare(observations)?;
        let mut counts = Counts::default();
        for part in batch.chunks(upsert::ROWS) {
            counts += upsert::run(&self.connections, part).await?;
        }
        Ok(counts)
    }

    async fn query(&self, filter: &Filter) -> Result<Page, ObservationError> {
        let checked = CheckedFilter::new(filter)?;
        let question = question::observations(&checked);
        let rows = self.rows("reading observations", &question).await?;
        let observations = rows
            .iter()
            .map(row::observation)
            .collect::<Result<_, _>>()?;
        Ok(filter::page(observations, filter.limit))
    }

    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, ObservationError> {
        let checked = CheckedFilter::new(filter)?;
        let question = question::platforms(&checked);
        let rows = self.rows("reading platforms", &question).await?;
        let platforms: Vec<Platform> = rows.iter().map(row::platform).collect::<Result<_, _>>()?;
        Ok(platform::list(platforms.into_iter(), filter.limit))
    }

    async fn datasets(&self) -> Result<Vec<ProductId>, ObservationError> {
        let rows = self.rows("reading datasets", &question::datasets()).await?;
        rows.iter().map(row::dataset).collect()
    }

    async fn track(&self, query: &TrackQuery) -> Result<Vec<TrackPoint>, ObservationError> {
        track::check(query)?;
        let question = question::track(query);
        let rows = self.rows("reading a track", &question).await?;
        rows.iter().map(row::track_point).collect()
    }

    /// An index leads to the rows of each platform.
    async fn tracks(
        &self,
        queries: &[TrackQuery],
    ) -> Result<Vec<Vec<TrackPoint>>, ObservationError> {
        let mut tracks = Vec::with_capacity(queries.len());
        for query in queries {
            tracks.push(self.track(query).await?);
        }
        Ok(tracks)
    }

    async fn ready(&self) -> Result<(), ObservationError> {
        self.connections.ready().await
    }
}
