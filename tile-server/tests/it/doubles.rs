//! Doubles for the ports: they record what they are asked, and answer what a test tells them to.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use async_trait::async_trait;
use axum::body::Bytes;
use contract::budget::{BudgetAnswer, BudgetHistory, BudgetQuery, BudgetRow, Completeness};
use contract::check::Check;
use contract::cited::Cited;
use contract::encoding::Encoding;
use contract::event::Event;
use contract::grid::LonLatDeg;
use contract::job::RenderJob;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::observation::{
    Filter, Observation, Page, Platform, PlatformList, TrackPoint, TrackQuery,
};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::{AskedRegion, MaskCode};
use contract::rows::{Columns, RowsForm};
use contract::series::{
    Cell, CellCounts, PointSeries, PointValue, RegionSeries, RegionSeriesQuery, RegionValue,
};
use contract::statistics::{
    Statistic, StatisticNote, StatisticsAnswer, StatisticsQuery, StatisticsRow,
};
use contract::topic::{Origin, Topic};
use serde_json::{Value, json};
use storage::log::{EmbeddedLog, EventLog, Follower, Message, Reader, Start};
use storage::{StorageError, Store};
use tile_server::backend::{
    Analyse, BackendError, Class, Draw, Keep, MadeOfSeries, Observe, SeriesQuestion, Turn, Version,
};
use tokio::sync::Semaphore;

use crate::posted::SQUARE;

/// How a double answers.
#[derive(Debug, Clone, Default)]
pub(crate) enum Mood {
    #[default]
    Well,
    Fails(BackendError),
    Panics,
    AnswersNonsense,
}

impl Mood {
    pub(crate) fn fails(class: Class, text: &str) -> Self {
        Self::Fails(BackendError::new(class, text))
    }

    fn apply(&self) -> Result<(), BackendError> {
        match self {
            Self::Well | Self::AnswersNonsense => Ok(()),
            Self::Fails(error) => Err(error.clone()),
            Self::Panics => panic!("a planted panic"),
        }
    }
}

/// One more as long as it is there.
struct Counted<'a>(&'a AtomicUsize);

impl<'a> Counted<'a> {
    fn one_more(count: &'a AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::SeqCst);
        Self(count)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Draws nothing: its picture is a pixel with the digest of the job beside it.
pub(crate) struct Drawer {
    store: Store,
    pub(crate) jobs: Mutex<Vec<RenderJob>>,
    /// Whether each was to be stored.
    pub(crate) keeps: Mutex<Vec<Keep>>,
    pub(crate) mood: Mutex<Mood>,
    /// While true, pictures wait for a permit of `turns` each.
    pub(crate) is_slow: AtomicBool,
    pub(crate) turns: Semaphore,
    /// Pictures that are begun, and neither given out nor given up.
    pub(crate) under_way: AtomicUsize,
    /// While true, pictures that are drawn are slow to be encoded: they wait for a permit of `turns` after they let go
    /// of their turn.
    pub(crate) encodes_slowly: AtomicBool,
    /// Every picture that was given out.
    pub(crate) given: Mutex<Vec<Bytes>>,
    /// While true, what is to be stored is not.
    pub(crate) stores_nothing: AtomicBool,
    /// Bytes that every picture is longer by.
    pub(crate) padding_bytes: AtomicUsize,
}

impl Default for Drawer {
    /// One whose store nobody looks into.
    fn default() -> Self {
        Self::over(&Store::memory())
    }
}

impl Drawer {
    /// One that keeps its pictures in a store, as all that draw do.
    pub(crate) fn over(store: &Store) -> Self {
        Self {
            store: store.clone(),
            jobs: Mutex::default(),
            given: Mutex::default(),
            keeps: Mutex::default(),
            mood: Mutex::default(),
            is_slow: AtomicBool::new(false),
            turns: Semaphore::new(0),
            under_way: AtomicUsize::new(0),
            encodes_slowly: AtomicBool::new(false),
            stores_nothing: AtomicBool::new(false),
            padding_bytes: AtomicUsize::new(0),
        }
    }

    /// Puts a picture into the store over whatever is there.
    async fn keep(&self, job: &RenderJob, picture: &Bytes) {
        if !self.stores_nothing.load(Ordering::SeqCst) {
            // A store that fails costs a second drawing.
            drop(self.store.put_over(&job.key(), picture.clone()).await);
        }
    }

    pub(crate) fn drawn_count(&self) -> usize {
        self.jobs.lock().unwrap().len()
    }

    pub(crate) fn last_job(&self) -> RenderJob {
        self.jobs.lock().unwrap().last().unwrap().clone()
    }

    pub(crate) fn set(&self, mood: Mood) {
        *self.mood.lock().unwrap() = mood;
    }

    pub(crate) fn picture_of(job: &RenderJob) -> Bytes {
        picture(&job.digest().to_string())
    }

    /// What takes its place in motion: begins as a JPEG does.
    pub(crate) fn jpeg_of(job: &RenderJob) -> Bytes {
        [&[0xff, 0xd8, 0xff], job.digest().to_string().as_bytes()]
            .concat()
            .into()
    }
}

/// One pixel with a text in it.
fn picture(text: &str) -> Bytes {
    let mut content = vec![];
    let mut encoder = png::Encoder::new(&mut content, 1, 1);
    encoder
        .add_text_chunk("Comment".to_owned(), text.to_owned())
        .unwrap();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0]).unwrap();
    writer.finish().unwrap();
    content.into()
}

#[async_trait]
impl Draw for Drawer {
    async fn draw(
        &self,
        job: &RenderJob,
        keep: Keep,
        encoding: Encoding,
        turn: Turn,
    ) -> Result<Bytes, BackendError> {
        self.jobs.lock().unwrap().push(job.clone());
        self.keeps.lock().unwrap().push(keep);
        let _drawing = Counted::one_more(&self.under_way);
        if self.is_slow.load(Ordering::SeqCst) {
            self.turns.acquire().await.unwrap().forget();
        }
        drop(turn);
        if self.encodes_slowly.load(Ordering::SeqCst) {
            self.turns.acquire().await.unwrap().forget();
        }
        let mood = self.mood.lock().unwrap().clone();
        mood.apply()?;
        if matches!(mood, Mood::AnswersNonsense) {
            return Ok(Bytes::from("no picture"));
        }
        let padding = self.padding_bytes.load(Ordering::SeqCst);
        let padded = |picture: Bytes| match padding {
            0 => picture,
            bytes => [&picture[..], &vec![0; bytes]].concat().into(),
        };
        if !encoding.is_stored() {
            return Ok(padded(Self::jpeg_of(job)));
        }
        let picture = padded(Self::picture_of(job));
        self.given.lock().unwrap().push(picture.clone());
        if keep == Keep::Yes {
            self.keep(job, &picture).await;
        }
        Ok(picture)
    }

    fn draws_at_once(&self) -> NonZeroU32 {
        NonZeroU32::new(2).unwrap()
    }

    async fn ready(&self) -> Result<(), BackendError> {
        self.mood.lock().unwrap().clone().apply()
    }
}

/// Computes nothing: a cell's value is `row + step / 100`, missing in column 0.
#[derive(Default)]
pub(crate) struct Analyst {
    pub(crate) budgets: Mutex<Vec<BudgetQuery>>,
    /// Of each budget the number of the version that it is of.
    pub(crate) versions: Mutex<Vec<u64>>,
    pub(crate) points: Mutex<Vec<LonLatDeg>>,
    pub(crate) areas: Mutex<Vec<RegionSeriesQuery>>,
    pub(crate) statistics: Mutex<Vec<StatisticsQuery>>,
    pub(crate) encoded: Mutex<Vec<RowsForm>>,
    pub(crate) made: Mutex<Vec<SeriesQuestion>>,
    pub(crate) mask_regions: Mutex<Vec<String>>,
    pub(crate) check: Mutex<Option<Check>>,
    pub(crate) mood: Mutex<Mood>,
    /// Series of places wait for one of these each, if there are any.
    pub(crate) turns: Option<Arc<Semaphore>>,
}

impl Analyst {
    pub(crate) fn set(&self, mood: Mood) {
        *self.mood.lock().unwrap() = mood;
    }

    fn mood(&self) -> Mood {
        self.mood.lock().unwrap().clone()
    }
}

#[async_trait]
impl Analyse for Analyst {
    async fn point(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
        place: LonLatDeg,
    ) -> Result<PointSeries, BackendError> {
        self.points.lock().unwrap().push(place);
        if let Some(turns) = &self.turns {
            turns.acquire().await.unwrap().forget();
        }
        self.mood().apply()?;
        let (row, col) = manifest.cell_inside(place).unwrap();
        let is_sum = manifest.quantity == Quantity::AccumulatedCarbon;
        let value = |(index, step): (u32, &Step)| PointValue {
            start: step.period.start,
            end: step.period.end,
            mid: step.period.mid(),
            value: (col != 0).then_some(f64::from(row) + f64::from(index) / 100.0),
            contributed: is_sum.then_some(CellCounts {
                steps: 1,
                of_steps: index + 1,
                time_percent: 100.0 / f64::from(index + 1),
            }),
        };
        let mut series: Vec<_> = (0..).zip(&manifest.steps).map(value).collect();
        if matches!(self.mood(), Mood::AnswersNonsense) {
            series.clear();
        }
        let center = manifest.grid.cell_center(row, col);
        Ok(PointSeries {
            cited: Cited::of(manifest, id.clone()),
            lon_deg: place.lon,
            lat_deg: place.lat,
            cell: Cell {
                row,
                col,
                lon_deg: center.lon,
                lat_deg: center.lat,
            },
            series,
        })
    }

    /// One row of all that is asked for.
    async fn budget(
        &self,
        manifest: &Manifest,
        query: &BudgetQuery,
    ) -> Result<BudgetAnswer, BackendError> {
        self.mood().apply()?;
        self.budgets.lock().unwrap().push(query.clone());
        self.versions.lock().unwrap().push(manifest.number);
        let (window, _steps) = query.steps(manifest).unwrap();
        let is_sum = manifest.quantity == Quantity::AccumulatedCarbon;
        Ok(BudgetAnswer {
            product: manifest.product.clone(),
            manifest: manifest.id(),
            title: manifest.title.clone(),
            source: manifest.source.clone(),
            synthetic: manifest.synthetic,
            region: query.region_name.clone(),
            earth: query.earth,
            cells: query.cells,
            ocean_source: ocean_source(query.ocean.as_deref()),
            unit: "Tg C".to_owned(),
            region_area_m2: 5.1e14,
            ocean_area_m2: 3.6e14,
            gap_basis: "the mean of the band".to_owned(),
            notes: vec!["taken as written".to_owned()],
            uncertainty: None,
            river: None,
            regions: vec![],
            closure: None,
            rows: vec![BudgetRow {
                uncertainty: None,
                river: None,
                start: window.start,
                end: window.end,
                budget_kg: "-176100000000.000000000".to_owned(),
                budget_tg: -176.1,
                coverage_percent: 92.5,
                area_m2: 3.4e14,
                region_area_m2: 5.1e14,
                ocean_area_m2: 3.6e14,
                ocean_with_data_m2: 3.3e14,
                gap_tg: Some(-12.5),
                gap_area_m2: 2.0e13,
                completeness: is_sum.then_some(Completeness {
                    complete_m2: 3e14,
                    incomplete_m2: 3e13,
                }),
            }],
        })
    }

    /// No version at all.
    async fn budget_history(&self, query: &BudgetQuery) -> Result<BudgetHistory, BackendError> {
        self.mood().apply()?;
        self.budgets.lock().unwrap().push(query.clone());
        Ok(BudgetHistory {
            product: query.product.clone(),
            region: query.region_name.clone(),
            unit: "Tg C".to_owned(),
            version_count: 0,
            notes: vec![],
            versions: vec![],
        })
    }

    /// A square, if it is not the code 99.
    async fn mask_region(
        &self,
        mask: &Manifest,
        code: &MaskCode,
    ) -> Result<AskedRegion, BackendError> {
        self.mood().apply()?;
        let asked = format!("{}:{code}", mask.id());
        self.mask_regions.lock().unwrap().push(asked.clone());
        if *code == MaskCode::Number(99.0) {
            let text = "no cell has this code; there are 1, 5, 12345";
            return Err(BackendError::new(Class::BadRequest, text));
        }
        let square: AskedRegion = SQUARE.parse().unwrap();
        Ok(AskedRegion {
            name: asked,
            ..square
        })
    }

    /// One row of all that is asked for; every statistic is 1.
    async fn statistics(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
        query: &StatisticsQuery,
    ) -> Result<StatisticsAnswer, BackendError> {
        self.mood().apply()?;
        self.statistics.lock().unwrap().push(query.clone());
        let (window, steps) = manifest.steps_inside(query.from, query.to).unwrap();
        let note = |statistic: Statistic| StatisticNote {
            name: statistic.to_string(),
            unit: "1".to_owned(),
            what: statistic.what(),
        };
        let names = query.statistics.iter().map(|one| one.to_string());
        Ok(StatisticsAnswer {
            cited: Cited::of(manifest, id.clone()),
            kind: query.geometry.kind().to_owned(),
            geometry: query.geometry_name.clone(),
            step: query.step,
            earth: query.earth,
            cells: query.cells,
            statistics: query.statistics.iter().map(note).collect(),
            coverage_basis: "all of it".to_owned(),
            size: 1.0,
            size_unit: "m".to_owned(),
            min_coverage_percent: query.min_coverage.percent(),
            ocean_source: None,
            notes: vec![],
            rows: vec![StatisticsRow {
                start: window.start,
                end: window.end,
                mid: window.mid(),
                values: names.map(|name| (name, Some(1.0))).collect(),
                found_at: BTreeMap::new(),
                coverage_percent: 100.0,
                step_count: steps.len() as u32,
                is_withheld: false,
            }],
        })
    }

    /// The first step has no data.
    async fn area(
        &self,
        manifest: &Manifest,
        query: &RegionSeriesQuery,
    ) -> Result<RegionSeries, BackendError> {
        self.mood().apply()?;
        self.areas.lock().unwrap().push(query.clone());
        let (_window, inside) = manifest.steps_inside(query.from, query.to).unwrap();
        let value = |(index, step): (usize, &Step)| RegionValue {
            start: step.period.start,
            end: step.period.end,
            mid: step.period.mid(),
            mean: (index > 0).then_some(index as f64 / 4.0),
            area_m2: 1e12 * index as f64,
            coverage_percent: 25.0 * index as f64,
        };
        Ok(RegionSeries {
            cited: Cited::of(manifest, manifest.id()),
            region: query.region_name.clone(),
            region_area_m2: 4e12,
            ocean_area_m2: 3e12,
            ocean_source: ocean_source(query.ocean.as_deref()),
            notes: vec![],
            earth: query.earth,
            series: inside.into_iter().enumerate().map(value).collect(),
        })
    }

    /// One row of each kind.
    async fn made_of_series(
        &self,
        question: &SeriesQuestion,
    ) -> Result<MadeOfSeries, BackendError> {
        self.mood().apply()?;
        self.made.lock().unwrap().push(question.clone());
        Ok(match question {
            SeriesQuestion::Analysis { of: version, .. } => {
                MadeOfSeries::Analysis(serde_json::from_value(analysis(version)).unwrap())
            }
            SeriesQuestion::Correlation { of: a, with: b, .. } => {
                MadeOfSeries::Correlation(serde_json::from_value(correlation(a, b)).unwrap())
            }
            SeriesQuestion::Difference {
                of: a, minus: b, ..
            } => MadeOfSeries::Difference(serde_json::from_value(difference(&a.0, &b.0)).unwrap()),
            SeriesQuestion::Hovmoller { of: version, .. } => {
                MadeOfSeries::Hovmoller(serde_json::from_value(hovmoller(version)).unwrap())
            }
        })
    }

    fn encoded(&self, columns: &Columns, form: RowsForm) -> Result<Vec<u8>, BackendError> {
        self.mood().apply()?;
        self.encoded.lock().unwrap().push(form);
        let names = columns.columns.iter().map(|own| own.name.as_str());
        let names: Vec<&str> = names.collect();
        Ok(format!("{form} of {}", names.join(",")).into_bytes())
    }

    async fn check(&self) -> Result<Option<Check>, BackendError> {
        self.mood().apply()?;
        Ok(self.check.lock().unwrap().clone())
    }
}

fn cited(version: &Version, more: Value) -> Value {
    let manifest = &version.manifest;
    let mut cited = json!({"product": manifest.product, "manifest": version.id, "title": manifest.title,
        "source": manifest.source, "synthetic": manifest.synthetic, "quantity": manifest.quantity,
        "unit": manifest.quantity.display().unit});
    let Value::Object(more) = more else {
        unreachable!("an object is given")
    };
    cited.as_object_mut().unwrap().extend(more);
    cited
}

fn analysis(of: &Version) -> Value {
    let step =
        json!({"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z", "value": 1.5});
    cited(
        of,
        json!({"region": "global", "start": "2000-01-01T00:00:00Z", "end": "2000-04-01T00:00:00Z",
        "step_count": 3, "value_count": 2, "notes": ["a note"],
        "refused": [{"part": "season", "reason": "too short"}],
        "climatology": {"bins": "month", "base": "2000/2000",
            "rows": [{"bin": "January", "mean": 1.5, "spread": null, "count": 1, "years": 1}]},
        "anomaly": {"bins": "month", "base": "2000/2000", "rows": [{"start": "2000-01-01T00:00:00Z",
            "end": "2000-02-01T00:00:00Z", "mid": "2000-01-16T12:00:00Z", "value": 1.5, "normal": 1.5,
            "anomaly": 0.0, "standardised": null}]},
        "trend": {"slope_unit": "°C per decade", "step": "month", "deseasonalised": true, "count": 60,
            "years": 5.0, "mid": "2000-02-01T00:00:00Z", "mean": 1.0,
            "least_squares": {"slope_per_decade": 0.1, "standard_error_per_decade": null,
                "lower_per_decade": null, "upper_per_decade": null, "p_value": null,
                "lag1_autocorrelation": 0.99, "effective_count": 1.0},
            "theil_sen": {"slope_per_decade": 0.1, "lower_per_decade": 0.0, "upper_per_decade": 0.2, "at_mid": 1.0},
            "mann_kendall": {"score": 3, "tau": 0.1, "variance_correction": 1.0, "z": 0.5, "p_value": 0.6},
            "values": [step]},
        "season": {"mean": 1.0, "has_trend": false, "annual": {"amplitude": 1.0, "highest_after_days": 30.0},
            "semi_annual": {"amplitude": 0.0, "highest_after_days": 0.0}, "explained_percent": 90.0,
            "residual_spread": 0.1, "count": 12},
        "extremes": {"highest": [step], "lowest": [step], "percentiles": [{"percent": 50.0, "value": 1.5}]}}),
    )
}

fn correlation(first: &Version, second: &Version) -> Value {
    let row = json!({"lag_steps": 0, "count": 3, "correlation": null, "effective_count": null, "p_value": null});
    json!({"first": cited(first, json!({})), "second": cited(second, json!({})), "region": "global",
        "step": "month", "deseasonalised": false, "start": "2000-01-01T00:00:00Z",
        "end": "2000-04-01T00:00:00Z", "notes": [], "rows": [row], "strongest_lag_steps": null})
}

fn difference(of: &Version, minus: &Version) -> Value {
    let side = |version: &Version| {
        let (start, end) = ("2000-01-01T00:00:00Z", "2000-04-01T00:00:00Z");
        cited(
            version,
            json!({"start": start, "end": end, "count": 3, "mean": 1.0, "effective_count": null}),
        )
    };
    json!({"region": "global", "unit": "°C", "of": side(of), "minus": side(minus), "difference": 0.0,
        "standard_error": null, "p_value": null, "notes": []})
}

fn hovmoller(of: &Version) -> Value {
    cited(
        of,
        json!({"along": "lat", "band_deg": 90.0, "bounds_deg": [-180.0, -90.0, 180.0, 90.0],
        "step": "month", "earth": "wgs84", "coverage_basis": "cells", "notes": ["a note"], "bands": [{"low_deg": -90.0, "high_deg": 0.0, "area_m2": 2.5e14},
            {"low_deg": 0.0, "high_deg": 90.0, "area_m2": 0.0}],
        "rows": [{"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z", "means": [1.5, null],
            "coverage_percent": [100.0, 0.0]}]}),
    )
}

fn ocean_source(ocean: Option<&Manifest>) -> String {
    ocean.map_or_else(|| "a coast".to_owned(), |ocean| ocean.id().to_string())
}

/// Has observed what a test says.
#[derive(Default)]
pub(crate) struct Observer {
    pub(crate) platforms: Mutex<Vec<Platform>>,
    pub(crate) track: Mutex<Vec<TrackPoint>>,
    /// How many tracks each question was about.
    pub(crate) fleets: Mutex<Vec<usize>>,
    pub(crate) observations: Mutex<Vec<Observation>>,
    pub(crate) questions: Mutex<Vec<Filter>>,
    pub(crate) mood: Mutex<Mood>,
    /// While true, no question is answered.
    pub(crate) is_stuck: AtomicBool,
}

impl Observer {
    pub(crate) fn set(&self, mood: Mood) {
        *self.mood.lock().unwrap() = mood;
    }

    pub(crate) fn last_question(&self) -> Filter {
        self.questions.lock().unwrap().last().unwrap().clone()
    }

    fn asked(&self, question: &Filter) -> Result<(), BackendError> {
        self.questions.lock().unwrap().push(question.clone());
        self.mood.lock().unwrap().clone().apply()
    }
}

#[async_trait]
impl Observe for Observer {
    /// Those of the data sets that are asked for, up to the limit.
    async fn platforms(&self, filter: &Filter) -> Result<PlatformList, BackendError> {
        self.asked(filter)?;
        if self.is_stuck.load(Ordering::SeqCst) {
            std::future::pending::<()>().await;
        }
        let mut platforms = self.platforms.lock().unwrap().clone();
        let is_asked = |own: &ProductId| filter.datasets.contains(own);
        platforms.retain(|own| filter.datasets.is_empty() || is_asked(&own.dataset));
        let is_complete = platforms.len() <= filter.limit as usize;
        platforms.truncate(filter.limit as usize);
        Ok(PlatformList {
            platforms,
            is_complete,
        })
    }

    async fn datasets(&self) -> Result<Vec<ProductId>, BackendError> {
        self.mood.lock().unwrap().clone().apply()?;
        let platforms = self.platforms.lock().unwrap();
        let mut datasets: Vec<_> = platforms.iter().map(|own| own.dataset.clone()).collect();
        datasets.dedup();
        Ok(datasets)
    }

    async fn tracks(&self, queries: &[TrackQuery]) -> Result<Vec<Vec<TrackPoint>>, BackendError> {
        self.fleets.lock().unwrap().push(queries.len());
        let track = self.track.lock().unwrap().clone();
        Ok(vec![track; queries.len()])
    }

    /// Pages begin where `after`, a number, says.
    async fn observations(&self, filter: &Filter) -> Result<Page, BackendError> {
        self.asked(filter)?;
        let all = self.observations.lock().unwrap().clone();
        let start = filter
            .after
            .as_ref()
            .map_or(0, |after| after.parse().unwrap());
        let end = all.len().min(start + filter.limit as usize);
        Ok(Page {
            observations: all[start..end].to_vec(),
            next: (end < all.len()).then(|| end.to_string()),
        })
    }

    async fn ready(&self) -> Result<(), BackendError> {
        self.mood.lock().unwrap().clone().apply()
    }
}

/// A log in memory that counts who follows it, and fails when told to.
pub(crate) struct Log {
    pub(crate) inner: EmbeddedLog,
    pub(crate) followed: AtomicUsize,
    pub(crate) is_away: AtomicBool,
    /// How often it was found away.
    pub(crate) missed: AtomicUsize,
}

impl Default for Log {
    fn default() -> Self {
        Self {
            inner: EmbeddedLog::memory(),
            followed: AtomicUsize::new(0),
            is_away: AtomicBool::new(false),
            missed: AtomicUsize::new(0),
        }
    }
}

impl Log {
    fn answers(&self) -> Result<(), StorageError> {
        if self.is_away.load(Ordering::SeqCst) {
            self.missed.fetch_add(1, Ordering::SeqCst);
            return Err(StorageError::log("secret-broker:9092", "it is away"));
        }
        Ok(())
    }
}

#[async_trait]
impl EventLog for Log {
    async fn append(&self, events: &[Event]) -> Result<(), StorageError> {
        self.inner.append(events).await
    }

    async fn append_message(
        &self,
        topic: Topic,
        key: &str,
        content: Bytes,
    ) -> Result<(), StorageError> {
        self.inner.append_message(topic, key, content).await
    }

    async fn join(&self, topic: Topic, group: &str) -> Result<Box<dyn Reader>, StorageError> {
        self.inner.join(topic, group).await
    }

    async fn follow(&self, topic: Topic, start: Start) -> Result<Box<dyn Follower>, StorageError> {
        self.answers()?;
        let follower = self.inner.follow(topic, start).await?;
        self.followed.fetch_add(1, Ordering::SeqCst);
        Ok(follower)
    }

    async fn message(&self, origin: Origin) -> Result<Option<Message>, StorageError> {
        self.inner.message(origin).await
    }

    async fn lag(&self, topic: Topic, group: &str) -> Result<u64, StorageError> {
        self.inner.lag(topic, group).await
    }

    async fn ready(&self) -> Result<(), StorageError> {
        self.answers()?;
        self.inner.ready().await
    }
}
