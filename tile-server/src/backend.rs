//! What this server asks of others: pictures, series and budgets, as two traits that the binary fills in.
//!
//! Left out on purpose: how a picture is drawn or a budget is summed. Both traits take and give values of `contract`
//! and of this file only, so that the same server runs over a renderer in its process or one behind a network.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use contract::analysis::{
    AnalysisOptions, Correlation, CorrelationQuery, Difference, Hovmoller, HovmollerQuery,
    SeriesAnalysis, SeriesQuery,
};
use contract::budget::{BudgetAnswer, BudgetHistory, BudgetQuery};
use contract::check::Check;
use contract::encoding::Encoding;
use contract::grid::LonLatDeg;
use contract::job::RenderJob;
use contract::manifest::{Manifest, ManifestId};
use contract::observation::{Filter, Page, PlatformList, TrackPoint, TrackQuery};
use contract::product::ProductId;
use contract::region::{AskedRegion, MaskCode};
use contract::rows::{Columns, RowsForm};
use contract::series::{PointSeries, RegionSeries, RegionSeriesQuery};
use contract::statistics::{MinCoverage, StatisticsAnswer, StatisticsQuery};
use serde::Serialize;
use tokio::sync::OwnedSemaphorePermit;

/// Leave to draw one picture; the next one waiting gets it when this is dropped.
///
/// Whoever draws lets go of it as soon as what is scarce is free again, which is the device: a picture that is encoded
/// holds up nobody. The default is that of a caller who gives out no turns.
#[derive(Debug, Default)]
pub struct Turn(Option<OwnedSemaphorePermit>);

impl Turn {
    pub(crate) fn new(permit: OwnedSemaphorePermit) -> Self {
        Self(Some(permit))
    }

    /// Is it one of a bounded number?
    pub fn is_counted(&self) -> bool {
        self.0.is_some()
    }
}

/// Is a picture kept in the store?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// It was looked for and is not there.
    Yes,
    /// The store does not answer: it is given out alone.
    No,
}

/// Draws pictures, and stores them: whoever draws one is the one who writes it.
#[async_trait]
pub trait Draw: Send + Sync + 'static {
    /// The picture of a valid job as the bytes of an encoding; a job without data is a transparent picture. A PNG is
    /// kept, if it is to be; if another one is in the store under its name, that one is given: it was served before.
    async fn draw(
        &self,
        job: &RenderJob,
        keep: Keep,
        encoding: Encoding,
        turn: Turn,
    ) -> Result<Bytes, BackendError>;

    /// How many pictures it should be given to draw at the same time, where nobody says how many.
    fn draws_at_once(&self) -> NonZeroU32;

    /// Can pictures be drawn now? The text of the error is shown to operators.
    async fn ready(&self) -> Result<(), BackendError>;
}

/// A version of a product.
#[derive(Clone)]
pub struct Version {
    /// What it consists of.
    pub manifest: Arc<Manifest>,
    /// Its name, which is costly to compute.
    pub id: ManifestId,
}

/// What is asked of series.
#[derive(Clone)]
pub enum SeriesQuestion {
    /// Climatology, anomaly, trend, season, extremes of one.
    Analysis {
        /// Of which version.
        of: Version,
        /// Where and when.
        series: SeriesQuery,
        /// What.
        options: AnalysisOptions,
    },
    /// How two go together.
    Correlation {
        /// The first.
        of: Version,
        /// The second.
        with: Version,
        /// Where, when and how.
        query: CorrelationQuery,
    },
    /// The mean of one less that of the other.
    Difference {
        /// The one.
        of: (Version, SeriesQuery),
        /// The other.
        minus: (Version, SeriesQuery),
        /// Least share of a region's sea, or of a line, that a step of either must hold data over.
        min_coverage: MinCoverage,
    },
    /// Latitude or longitude against time.
    Hovmoller {
        /// Of which version.
        of: Version,
        /// Where, when and how.
        query: HovmollerQuery,
    },
}

/// What was made of series.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum MadeOfSeries {
    /// Of one.
    Analysis(SeriesAnalysis),
    /// How two go together.
    Correlation(Correlation),
    /// A difference of means.
    Difference(Difference),
    /// Latitude or longitude against time.
    Hovmoller(Hovmoller),
}

/// Computes series and budgets.
#[async_trait]
pub trait Analyse: Send + Sync + 'static {
    /// The series of the cell at a place: one value for each step of the manifest in its order.
    /// `id` is the manifest's name, which is costly to compute.
    async fn point(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
        place: LonLatDeg,
    ) -> Result<PointSeries, BackendError>;

    /// The carbon budget of a region by a version of a carbon flux or of accumulated carbon.
    async fn budget(
        &self,
        manifest: &Manifest,
        query: &BudgetQuery,
    ) -> Result<BudgetAnswer, BackendError>;

    /// The same by every version of the product that changed it.
    async fn budget_history(&self, query: &BudgetQuery) -> Result<BudgetHistory, BackendError>;

    /// The mean of a version of a product over a region, one for each step in the period.
    async fn area(
        &self,
        manifest: &Manifest,
        query: &RegionSeriesQuery,
    ) -> Result<RegionSeries, BackendError>;

    /// Statistics of a version of a product over a geometry, by bins of time.
    async fn statistics(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
        query: &StatisticsQuery,
    ) -> Result<StatisticsAnswer, BackendError>;

    /// The cells where a version of a mask has a code, as a region that is called by both.
    async fn mask_region(
        &self,
        mask: &Manifest,
        code: &MaskCode,
    ) -> Result<AskedRegion, BackendError>;

    /// What is made of series of versions of products.
    async fn made_of_series(&self, question: &SeriesQuestion)
    -> Result<MadeOfSeries, BackendError>;

    /// Columns of an answer as the bytes of a form.
    fn encoded(&self, columns: &Columns, form: RowsForm) -> Result<Vec<u8>, BackendError>;

    /// Our budgets beside published ones; none where this deployment has nothing to compare with.
    async fn check(&self) -> Result<Option<Check>, BackendError>;
}

/// Finds observations of buoys, ships, stations and profiles.
#[async_trait]
pub trait Observe: Send + Sync + 'static {
    /// Platforms with observations that a question is about, by dataset and name, and whether these are all.
    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, BackendError>;

    /// All data sets that there are observations of, by name.
    async fn datasets(&self) -> Result<Vec<ProductId>, BackendError>;

    /// Where platforms were, each in the order of time, in the order of the questions.
    async fn tracks(&self, queries: &[TrackQuery]) -> Result<Vec<Vec<TrackPoint>>, BackendError>;

    /// Observations in the order of time, and where to go on if there are more.
    async fn observations(&self, filter: &Filter) -> Result<Page, BackendError>;

    /// Can they be found now?
    async fn ready(&self) -> Result<(), BackendError>;
}

/// What a failure means for who asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Class {
    /// The question is wrong; the text says how.
    BadRequest,
    /// What is asked for does not exist; the text says what.
    NotFound,
    /// Too much to do now; the same question may succeed in a moment.
    Busy,
    /// A part that is needed does not answer; the same question may succeed later.
    Unavailable,
    /// A store of others, to which a product is attached, does not hold what it held; the text says which, and what to do.
    Upstream,
    /// Our fault; the text goes to the log, not to users.
    Internal,
}

/// A failed picture or analysis.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{text}")]
pub struct BackendError {
    /// What it means for who asked.
    pub class: Class,
    /// One line: for users, except for [`Class::Internal`], which only the log sees.
    pub text: String,
    /// What it came from.
    pub source: Option<Arc<dyn std::error::Error + Send + Sync>>,
    /// When the same call may succeed, if that is known.
    pub retry_after: Option<Duration>,
}

impl BackendError {
    /// A failure without a deeper cause.
    pub fn new(class: Class, text: impl Into<String>) -> Self {
        Self {
            class,
            text: text.into(),
            source: None,
            retry_after: None,
        }
    }

    /// The same with the time after which to ask again.
    #[must_use]
    pub fn after(self, pause: Duration) -> Self {
        Self {
            retry_after: Some(pause),
            ..self
        }
    }

    /// The same with its cause, for the log.
    #[must_use]
    pub fn because(self, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self {
            source: Some(Arc::new(source)),
            ..self
        }
    }

    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        match self.class {
            Class::Busy | Class::Unavailable => true,
            Class::BadRequest | Class::NotFound | Class::Upstream | Class::Internal => false,
        }
    }
}
