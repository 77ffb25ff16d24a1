//! The one trait of both homes of observations.

use async_trait::async_trait;
use contract::observation::{Filter, Observation, Page, PlatformList, TrackPoint, TrackQuery};
use contract::product::ProductId;
use serde::{Deserialize, Serialize};

use crate::error::ObservationError;

/// What became of the observations of one call; of several of one name only the last is counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Names that were not there before.
    pub new: u64,
    /// Names that said something else before.
    pub replaced: u64,
    /// Names that said the same before; nothing was written for them.
    pub same: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.new += other.new;
        self.replaced += other.replaced;
        self.same += other.same;
    }
}

/// Where observations are kept.
#[async_trait]
pub trait ObservationStore: Send + Sync {
    /// Stores observations; one of a name that is there replaces it. Durable when this returns. After an error some may
    /// be stored and some not: the same call again makes it whole.
    ///
    /// # Errors
    /// An observation that breaks a limit (then none is stored), or a store that does not answer.
    async fn upsert(&self, observations: &[Observation]) -> Result<Counts, ObservationError>;

    /// Observations by time, dataset, platform, property and depth, a page at a time.
    async fn query(&self, filter: &Filter) -> Result<Page, ObservationError>;

    /// The platforms of the observations that a filter wants, by dataset and name, at most its limit, and whether these are
    /// all; `after` is not looked at.
    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, ObservationError>;

    /// All datasets that there are observations of, by name.
    async fn datasets(&self) -> Result<Vec<ProductId>, ObservationError>;

    /// The way of a platform in the order of time, one place for each time, thinned to the limit.
    async fn track(&self, query: &TrackQuery) -> Result<Vec<TrackPoint>, ObservationError>;

    /// The ways of several platforms, each as [`Self::track`] has it, in the order of the questions. A home in files reads each file
    /// once for those that stand side by side and are of one dataset and span of time, where their ways can be held together.
    async fn tracks(
        &self,
        queries: &[TrackQuery],
    ) -> Result<Vec<Vec<TrackPoint>>, ObservationError>;

    /// Can observations be stored and asked for now? Answers within two seconds.
    async fn ready(&self) -> Result<(), ObservationError>;
}
