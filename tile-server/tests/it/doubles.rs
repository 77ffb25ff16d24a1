//! Doubles for the ports: they record what they are asked, and answer what a test tells them to.

use std::num::NonZeroU32;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use async_trait::async_trait;
use axum::body::Bytes;
use contract::event::Event;
use contract::job::RenderJob;
use contract::manifest::Manifest;
use contract::observation::Observation;
use contract::quantity::Quantity;
use contract::topic::{Origin, Topic};
use storage::log::{EmbeddedLog, EventLog, Follower, Message, Reader, Start};
use storage::{StorageError, Store};
use tile_server::backend::{
    Analyse, AreaRequest, AreaRow, AreaSeries, BackendError, BudgetAnswer, BudgetRequest,
    BudgetRow, Check, Class, Contributed, Draw, Keep, ObservationPage, ObservationQuestion,
    Observe, Platform, PointStep, RowCol, TrackPoint, TrackQuestion, Turn,
};
use tokio::sync::Semaphore;

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
    /// While true, pictures that are drawn are slow to be encoded: they wait for a permit of `turns` after they let go
    /// of their turn.
    pub(crate) encodes_slowly: AtomicBool,
    /// While true, what is to be stored is not.
    pub(crate) stores_nothing: AtomicBool,
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
            keeps: Mutex::default(),
            mood: Mutex::default(),
            is_slow: AtomicBool::new(false),
            turns: Semaphore::new(0),
            encodes_slowly: AtomicBool::new(false),
            stores_nothing: AtomicBool::new(false),
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
    async fn draw(&self, job: &RenderJob, keep: Keep, turn: Turn) -> Result<Bytes, BackendError> {
        self.jobs.lock().unwrap().push(job.clone());
        self.keeps.lock().unwrap().push(keep);
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
        let picture = Self::picture_of(job);
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

/// Computes nothing: a cell's value is `row + step / 100` in the stored unit, missing in column 0.
#[derive(Default)]
pub(crate) struct Analyst {
    pub(crate) budgets: Mutex<Vec<BudgetRequest>>,
    pub(crate) areas: Mutex<Vec<AreaRequest>>,
    pub(crate) check: Mutex<Option<Check>>,
    pub(crate) mood: Mutex<Mood>,
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
        cell: RowCol,
    ) -> Result<Vec<PointStep>, BackendError> {
        self.mood().apply()?;
        if matches!(self.mood(), Mood::AnswersNonsense) {
            return Ok(vec![]);
        }
        let is_sum = manifest.quantity == Quantity::AccumulatedCarbon;
        let point = |step| PointStep {
            value: (cell.col != 0).then_some(f64::from(cell.row) + f64::from(step) / 100.0),
            contributed: is_sum.then_some(Contributed {
                steps: 1,
                of_steps: step + 1,
                time_percent: 100.0 / f64::from(step + 1),
            }),
        };
        Ok((0..manifest.steps.len() as u32).map(point).collect())
    }

    async fn budget(&self, request: &BudgetRequest) -> Result<BudgetAnswer, BackendError> {
        self.mood().apply()?;
        self.budgets.lock().unwrap().push(request.clone());
        Ok(BudgetAnswer {
            region_area_m2: 5.1e14,
            ocean_area_m2: 3.6e14,
            ocean_source: ocean_source(request.ocean.as_deref()),
            gap_basis: "the mean of the band".to_owned(),
            notes: vec!["taken as written".to_owned()],
            rows: vec![BudgetRow {
                period: request.period,
                budget_tg: -176.1,
                coverage_percent: 92.5,
                area_m2: 3.4e14,
                ocean_with_data_m2: 3.3e14,
                gap_tg: Some(-12.5),
                gap_area_m2: 2.0e13,
                complete_and_incomplete_m2: (request.manifest.quantity
                    == Quantity::AccumulatedCarbon)
                    .then_some([3e14, 3e13]),
            }],
        })
    }

    /// The first step has no data.
    async fn area(&self, request: &AreaRequest) -> Result<AreaSeries, BackendError> {
        self.mood().apply()?;
        self.areas.lock().unwrap().push(request.clone());
        let steps = request.manifest.steps.iter();
        let inside = steps.filter(|step| step.period.overlaps(request.period));
        let row = |(index, step): (usize, &contract::manifest::Step)| AreaRow {
            period: step.period,
            mean: (index > 0).then_some(index as f64 / 4.0),
            area_m2: 1e12 * index as f64,
            coverage_percent: 25.0 * index as f64,
        };
        Ok(AreaSeries {
            region_area_m2: 4e12,
            ocean_area_m2: 3e12,
            ocean_source: ocean_source(request.ocean.as_deref()),
            notes: vec![],
            rows: inside.enumerate().map(row).collect(),
        })
    }

    async fn check(&self) -> Result<Option<Check>, BackendError> {
        self.mood().apply()?;
        Ok(self.check.lock().unwrap().clone())
    }
}

fn ocean_source(ocean: Option<&Manifest>) -> String {
    ocean.map_or_else(|| "a coast".to_owned(), |ocean| ocean.id().to_string())
}

/// Has observed what a test says.
#[derive(Default)]
pub(crate) struct Observer {
    pub(crate) platforms: Mutex<Vec<Platform>>,
    pub(crate) track: Mutex<Vec<TrackPoint>>,
    pub(crate) observations: Mutex<Vec<Observation>>,
    pub(crate) questions: Mutex<Vec<ObservationQuestion>>,
    pub(crate) mood: Mutex<Mood>,
}

impl Observer {
    pub(crate) fn set(&self, mood: Mood) {
        *self.mood.lock().unwrap() = mood;
    }

    pub(crate) fn last_question(&self) -> ObservationQuestion {
        self.questions.lock().unwrap().last().unwrap().clone()
    }

    fn asked(&self, question: &ObservationQuestion) -> Result<(), BackendError> {
        self.questions.lock().unwrap().push(question.clone());
        self.mood.lock().unwrap().clone().apply()
    }
}

#[async_trait]
impl Observe for Observer {
    async fn platforms(
        &self,
        question: &ObservationQuestion,
    ) -> Result<Vec<Platform>, BackendError> {
        self.asked(question)?;
        Ok(self.platforms.lock().unwrap().clone())
    }

    async fn track(&self, _question: &TrackQuestion) -> Result<Vec<TrackPoint>, BackendError> {
        Ok(self.track.lock().unwrap().clone())
    }

    /// Pages begin where `after`, a number, says.
    async fn observations(
        &self,
        question: &ObservationQuestion,
    ) -> Result<ObservationPage, BackendError> {
        self.asked(question)?;
        let all = self.observations.lock().unwrap().clone();
        let start = question
            .after
            .as_ref()
            .map_or(0, |after| after.parse().unwrap());
        let end = all.len().min(start + question.limit as usize);
        Ok(ObservationPage {
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
}

impl Default for Log {
    fn default() -> Self {
        Self {
            inner: EmbeddedLog::memory(),
            followed: AtomicUsize::new(0),
            is_away: AtomicBool::new(false),
        }
    }
}

impl Log {
    fn answers(&self) -> Result<(), StorageError> {
        if self.is_away.load(Ordering::SeqCst) {
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
