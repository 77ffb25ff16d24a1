//! What this server asks of others: pictures, series and budgets, as two traits that the binary fills in.
//!
//! Left out on purpose: how a picture is drawn or a budget is summed. Both traits take and give values of `contract`
//! and of this file only, so that the same server runs over a renderer in its process or one behind a network.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use contract::earth::Earth;
use contract::job::RenderJob;
use contract::manifest::Manifest;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::product::ProductId;
use contract::region::{Cells, Region};
use contract::time::{Period, TimeMs};
use serde::{Deserialize, Serialize};
use tokio::sync::OwnedSemaphorePermit;
use utoipa::ToSchema;

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
    /// The picture of a valid job as the bytes of a PNG with alpha; a job without data is a transparent picture. If
    /// another one is in the store under its name, that one is given: it was served before.
    async fn draw(&self, job: &RenderJob, keep: Keep, turn: Turn) -> Result<Bytes, BackendError>;

    /// How many pictures it should be given to draw at the same time, where nobody says how many.
    fn draws_at_once(&self) -> NonZeroU32;

    /// Can pictures be drawn now? The text of the error is shown to operators.
    async fn ready(&self) -> Result<(), BackendError>;
}

/// Computes series and budgets.
#[async_trait]
pub trait Analyse: Send + Sync + 'static {
    /// The values of one cell, one for each step of the manifest in its order.
    async fn point(
        &self,
        manifest: &Manifest,
        cell: RowCol,
    ) -> Result<Vec<PointStep>, BackendError>;

    /// The carbon budget of a region, one row for each step of time.
    async fn budget(&self, request: &BudgetRequest) -> Result<BudgetAnswer, BackendError>;

    /// The mean of a product over a region, one row for each step in the period.
    async fn area(&self, request: &AreaRequest) -> Result<AreaSeries, BackendError>;

    /// Our budgets beside published ones; none where this deployment has nothing to compare with.
    async fn check(&self) -> Result<Option<Check>, BackendError>;
}

/// Finds observations of buoys, ships, stations and profiles.
#[async_trait]
pub trait Observe: Send + Sync + 'static {
    /// Platforms with observations that a question is about, by dataset and name.
    async fn platforms(
        &self,
        question: &ObservationQuestion,
    ) -> Result<Vec<Platform>, BackendError>;

    /// Where a platform was, in the order of time.
    async fn track(&self, question: &TrackQuestion) -> Result<Vec<TrackPoint>, BackendError>;

    /// Observations in the order of time, and where to go on if there are more.
    async fn observations(
        &self,
        question: &ObservationQuestion,
    ) -> Result<ObservationPage, BackendError>;

    /// Can they be found now?
    async fn ready(&self) -> Result<(), BackendError>;
}

/// Which observations are asked for; an empty list does not restrict.
#[derive(Debug, Clone)]
pub struct ObservationQuestion {
    /// Where.
    pub region: Region,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after them.
    pub to: Option<TimeMs>,
    /// Data sets.
    pub datasets: Vec<ProductId>,
    /// Names of platforms.
    pub platforms: Vec<String>,
    /// Kinds of platforms.
    pub kinds: Vec<PlatformKind>,
    /// What was measured.
    pub properties: Vec<String>,
    /// The least trusted ones that are still wanted.
    pub worst: Quality,
    /// Most observations of one answer.
    pub limit: u32,
    /// Where the answer before ended.
    pub after: Option<String>,
}

/// Whose track is asked for.
#[derive(Debug, Clone)]
pub struct TrackQuestion {
    /// Data set.
    pub dataset: ProductId,
    /// Name of the platform.
    pub platform: String,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after it.
    pub to: Option<TimeMs>,
    /// Most places of the answer.
    pub limit: u32,
}

/// A platform and what there is of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Platform {
    /// Data set.
    pub dataset: ProductId,
    /// Name in it.
    pub name: String,
    /// What it is.
    pub kind: PlatformKind,
    /// First observation.
    pub first: TimeMs,
    /// Last observation.
    pub last: TimeMs,
    /// Last longitude, degrees east.
    pub lon_deg: f64,
    /// Last latitude, degrees north.
    pub lat_deg: f64,
    /// What was measured.
    pub properties: Vec<String>,
    /// Observations.
    pub count: u64,
}

/// A place on a track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackPoint {
    /// When.
    pub time: TimeMs,
    /// Longitude, degrees east.
    pub lon_deg: f64,
    /// Latitude, degrees north.
    pub lat_deg: f64,
}

/// Some observations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObservationPage {
    /// In the order of time.
    pub observations: Vec<Observation>,
    /// What to ask with for those after them.
    pub next: Option<String>,
}

/// A cell of a manifest's grid, inside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub struct RowCol {
    /// Row, 0 is the northernmost.
    pub row: u32,
    /// Column, eastwards.
    pub col: u32,
}

/// One step of a cell's series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointStep {
    /// Stored unit; none where there is no data.
    pub value: Option<f64>,
    /// What a sum of accumulated carbon holds; none for other values, and where nobody can tell.
    pub contributed: Option<Contributed>,
}

/// What a sum of accumulated carbon holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Contributed {
    /// Steps that had data.
    pub steps: u32,
    /// Steps since accumulation started.
    pub of_steps: u32,
    /// Share of the time since then that had data, percent; below 100 the sum is not complete.
    pub time_percent: f64,
}

/// How a budget's period is cut into rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum BudgetStep {
    /// Calendar months.
    Month,
    /// Calendar years.
    Year,
    /// One row for all of it.
    Total,
}

impl std::str::FromStr for BudgetStep {
    type Err = contract::ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "month" => Ok(Self::Month),
            "year" => Ok(Self::Year),
            "total" => Ok(Self::Total),
            _ => Err(contract::ContractError::invalid(
                "step",
                s,
                "month, year or total",
            )),
        }
    }
}

/// A budget that is asked for.
#[derive(Debug, Clone)]
pub struct BudgetRequest {
    /// A manifest of a carbon flux or of accumulated carbon.
    pub manifest: Arc<Manifest>,
    /// Where.
    pub region: Region,
    /// When; overlaps the manifest's extent and does not reach past it.
    pub period: Period,
    /// Rows.
    pub step: BudgetStep,
    /// Figure of the earth for cell areas.
    pub earth: Earth,
    /// How cells on the coast count.
    pub cells: Cells,
    /// A manifest that says how much of every cell is sea or land; Natural Earth if none.
    pub ocean: Option<Arc<Manifest>>,
}

/// A budget.
#[derive(Debug, Clone, PartialEq)]
pub struct BudgetAnswer {
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What says which part of a cell is sea.
    pub ocean_source: String,
    /// What estimates of gaps are made of.
    pub gap_basis: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// One row for each step of time.
    pub rows: Vec<BudgetRow>,
}

/// The budget of one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetRow {
    /// What it is summed over.
    pub period: Period,
    /// Carbon given off by the sea, Tg, positive out of the sea.
    pub budget_tg: f64,
    /// Share of the region's sea with data, averaged over the period, percent.
    pub coverage_percent: f64,
    /// Area that counted, averaged over the period, m²: with whole cells also land on the coast.
    pub area_m2: f64,
    /// Area of the sea with data, averaged over the period, m².
    pub ocean_with_data_m2: f64,
    /// What the sea without data would add, an estimate that is no part of the budget, Tg.
    pub gap_tg: Option<f64>,
    /// Area of the sea without data that the estimate stands for, m².
    pub gap_area_m2: f64,
    /// Of accumulated carbon: area of cells with data in all of the period, and in some of it only, m².
    pub complete_and_incomplete_m2: Option<[f64; 2]>,
}

/// A series over a region that is asked for.
#[derive(Debug, Clone)]
pub struct AreaRequest {
    /// A manifest of any quantity.
    pub manifest: Arc<Manifest>,
    /// Where.
    pub region: Region,
    /// When; overlaps the manifest's extent and does not reach past it.
    pub period: Period,
    /// Figure of the earth for cell areas.
    pub earth: Earth,
    /// A manifest that says how much of every cell is sea or land; Natural Earth if none.
    pub ocean: Option<Arc<Manifest>>,
}

/// A series over a region.
#[derive(Debug, Clone, PartialEq)]
pub struct AreaSeries {
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What says which part of a cell is sea.
    pub ocean_source: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// Rows in the order of time.
    pub rows: Vec<AreaRow>,
}

/// The mean of one step over a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AreaRow {
    /// What the step covers.
    pub period: Period,
    /// Mean over the cells with data, each by its area, in the unit people read; none where no cell has any.
    pub mean: Option<f64>,
    /// Area with data, m².
    pub area_m2: f64,
    /// Share of the region's sea with data, percent.
    pub coverage_percent: f64,
}

/// Our numbers beside a paper's and another program's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Check {
    /// Comparisons in the order they are shown.
    pub rows: Vec<CheckRow>,
    /// Where the paper's numbers come from.
    pub note: String,
    /// Where the other program's numbers come from.
    pub method: String,
}

/// One number of ours beside the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CheckRow {
    /// Region, for people.
    pub what: String,
    /// Period, for people.
    pub period: String,
    /// Unit of all of them.
    pub unit: String,
    /// The paper's; none where it prints no such number.
    #[schema(required)]
    pub paper: Option<Paper>,
    /// Another program's, from the same grid.
    pub independent: f64,
    /// Ours.
    pub ours: f64,
    /// Ours less the other program's.
    pub difference: f64,
    /// Is that no more than rounding explains?
    pub agrees: bool,
}

/// A number as a paper prints it, and what it says of ours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Paper {
    /// As printed.
    pub value: f64,
    /// Its uncertainty, where the paper states one.
    #[schema(required)]
    pub uncertainty: Option<f64>,
    /// Decimals that are printed.
    pub decimals: usize,
    /// Ours less the paper's.
    pub difference: f64,
    /// `within` or `outside` the paper's own uncertainty, or `no uncertainty stated`.
    pub verdict: String,
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
            Class::BadRequest | Class::NotFound | Class::Internal => false,
        }
    }
}
