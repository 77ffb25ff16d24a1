//! The tile server's two ports, filled with the renderer and the engines of this process.

mod observer;

use std::error::Error;
use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, PoisonError};

use async_trait::async_trait;
use bytes::Bytes;
use compute::{ComputeError, Engine, ErrorClass};
use contract::analysis::SeriesQuery;
use contract::budget::{BudgetAnswer, BudgetHistory, BudgetQuery};
use contract::check::Check;
use contract::encoding::Encoding;
use contract::geometry::Geometry;
use contract::grid::LonLatDeg;
use contract::job::RenderJob;
use contract::manifest::{Manifest, ManifestId};
use contract::region::{AskedRegion, MaskCode};
use contract::rows::{Columns, RowsForm};
use contract::series::{PointSeries, RegionSeries, RegionSeriesQuery};
use contract::statistics::{StatisticsAnswer, StatisticsQuery};
use export::answer::AnswerFormat;
use render_worker::Desk;
use render_worker::desk::{DeskError, Order, Storing};
use render_worker::fleet::{Fleet, FleetError};
use storage::attached::Failure;
use tile_server::backend::{
    Analyse, BackendError, Class, Draw, Keep, MadeOfSeries, SeriesQuestion, Turn, Version,
};

pub(crate) use observer::Observer;

/// Pictures asked of render workers at the same time. Each worker has a queue of its own, and is joined by others when
/// 16 wait in it: one server alone must be able to fill that.
const FLEET_DRAWS_AT_ONCE: NonZeroU32 = NonZeroU32::new(32).expect("32 is not 0");

/// Pictures from the desk in this process, which is the one that a render worker has.
pub(crate) struct Drawer {
    desk: Desk,
    /// Why the last picture failed, if its device or thread was lost; cleared by the next one that succeeds.
    trouble: Mutex<Option<String>>,
}

impl Drawer {
    pub(crate) fn new(desk: Desk) -> Self {
        Self {
            desk,
            trouble: Mutex::default(),
        }
    }

    fn trouble(&self) -> MutexGuard<'_, Option<String>> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Series of places from DataFusion in this process, those of regions and budgets from the cluster where there is one.
pub(crate) struct Analyst {
    local: Engine,
    regions: Engine,
    /// Our budgets beside published ones, if the demo compared them.
    check: Option<Check>,
}

impl Analyst {
    /// Whoever may ask over HTTP may think of any number of regions: nothing of them is stored.
    pub(crate) fn new(local: Engine, regions: &Engine, check: Option<Check>) -> Self {
        Self {
            local,
            regions: regions.storing_no_weights(),
            check,
        }
    }

    /// Who reads a series.
    fn reader(&self, series: &SeriesQuery) -> &Engine {
        match series {
            SeriesQuery::Cell { .. } => &self.local,
            SeriesQuery::Region(_) | SeriesQuery::Line(_) => &self.regions,
        }
    }
}

fn parts(version: &Version) -> compute::analysis::Version<'_> {
    (&version.manifest, &version.id)
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
        let order = Order::on_demand(storing(keep)).encoded(encoding);
        let drawn = self.desk.draw_in_turn(job, order, turn).await;
        *self.trouble() = match &drawn {
            Err(DeskError::Render(error)) if error.is_retryable() => Some(error.to_string()),
            // A queue that is full is no trouble.
            _ => None,
        };
        drawn.map(|drawn| drawn.bytes).map_err(desk_failed)
    }

    fn draws_at_once(&self) -> NonZeroU32 {
        let suited = u32::try_from(self.desk.draws_at_once().get()).unwrap_or(u32::MAX);
        NonZeroU32::new(suited).unwrap_or(NonZeroU32::MIN)
    }

    async fn ready(&self) -> Result<(), BackendError> {
        match self.trouble().clone() {
            Some(text) => Err(BackendError::new(Class::Unavailable, text)),
            None => Ok(()),
        }
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
        let answer = compute::point::point_series_of(&self.local, manifest, id.clone(), place);
        answer.await.map_err(compute_failed)
    }

    async fn budget(
        &self,
        manifest: &Manifest,
        query: &BudgetQuery,
    ) -> Result<BudgetAnswer, BackendError> {
        let answer = compute::budget::budget_of(&self.regions, query, manifest);
        answer.await.map_err(compute_failed)
    }

    async fn budget_history(&self, query: &BudgetQuery) -> Result<BudgetHistory, BackendError> {
        let answer = compute::budget::history(&self.regions, query);
        answer.await.map_err(compute_failed)
    }

    async fn area(
        &self,
        manifest: &Manifest,
        query: &RegionSeriesQuery,
    ) -> Result<RegionSeries, BackendError> {
        let answer = compute::stats::region_series_of(&self.regions, query, manifest);
        answer.await.map_err(compute_failed)
    }

    async fn statistics(
        &self,
        manifest: &Manifest,
        id: &ManifestId,
        query: &StatisticsQuery,
    ) -> Result<StatisticsAnswer, BackendError> {
        // A place is a few blocks: asking a cluster would take longer than reading them.
        let engine = match query.geometry {
            Geometry::Point { .. } => &self.local,
            Geometry::Line(_) | Geometry::Region(_) => &self.regions,
        };
        let answer = compute::reduce::statistics_of(engine, query, manifest, id.clone());
        answer.await.map_err(compute_failed)
    }

    async fn mask_region(
        &self,
        mask: &Manifest,
        code: &MaskCode,
    ) -> Result<AskedRegion, BackendError> {
        let region = compute::region::mask::region(self.local.store(), mask, code);
        region.await.map_err(compute_failed)
    }

    async fn made_of_series(
        &self,
        question: &SeriesQuestion,
    ) -> Result<MadeOfSeries, BackendError> {
        use compute::analysis::{analyse, correlation, difference, hovmoller};
        let made = match question {
            SeriesQuestion::Analysis {
                of,
                series,
                options,
            } => analyse(self.reader(series), parts(of), series, options)
                .await
                .map(MadeOfSeries::Analysis),
            SeriesQuestion::Correlation { of, with, query } => {
                correlation(self.reader(&query.series), parts(of), parts(with), query)
                    .await
                    .map(MadeOfSeries::Correlation)
            }
            SeriesQuestion::Difference {
                of,
                minus,
                min_coverage,
            } => {
                let (a, b) = ((parts(&of.0), &of.1), (parts(&minus.0), &minus.1));
                difference(self.reader(&of.1), a, b, *min_coverage)
                    .await
                    .map(MadeOfSeries::Difference)
            }
            SeriesQuestion::Hovmoller { of, query } => hovmoller(&self.regions, parts(of), query)
                .await
                .map(MadeOfSeries::Hovmoller),
        };
        made.map_err(compute_failed)
    }

    fn encoded(&self, columns: &Columns, form: RowsForm) -> Result<Vec<u8>, BackendError> {
        let format = match form {
            RowsForm::Json => AnswerFormat::Json,
            RowsForm::Csv => AnswerFormat::Csv,
            RowsForm::Arrow => AnswerFormat::Arrow,
        };
        let content = export::answer::encoded(columns, format);
        content.map_err(|error| BackendError::new(Class::Internal, error.to_string()))
    }

    async fn check(&self) -> Result<Option<Check>, BackendError> {
        Ok(self.check.clone())
    }
}

/// Pictures from render workers elsewhere.
pub(crate) struct FleetDrawer(pub(crate) Fleet);

#[async_trait]
impl Draw for FleetDrawer {
    async fn draw(
        &self,
        job: &RenderJob,
        keep: Keep,
        encoding: Encoding,
        turn: Turn,
    ) -> Result<Bytes, BackendError> {
        let order = Order::on_demand(storing(keep)).encoded(encoding);
        let trace = job.digest().short();
        let picture = self.0.draw(job, order, &trace).await;
        drop(turn);
        picture
            .map(|picture| picture.bytes)
            .map_err(|error| fleet_failed(&error))
    }

    fn draws_at_once(&self) -> NonZeroU32 {
        FLEET_DRAWS_AT_ONCE
    }

    async fn ready(&self) -> Result<(), BackendError> {
        self.0
            .ready()
            .await
            .map(|_workers| ())
            .map_err(|error| fleet_failed(&error))
    }
}

fn fleet_failed(error: &FleetError) -> BackendError {
    let class = match error {
        FleetError::BadRequest(_) => Class::BadRequest,
        FleetError::NotFound(_) => Class::NotFound,
        FleetError::Busy { .. } => Class::Busy,
        FleetError::Unavailable(_) | FleetError::Late { .. } => Class::Unavailable,
        FleetError::Setup(_) | FleetError::Failed(_) => Class::Internal,
    };
    let failed = BackendError::new(class, error.to_string());
    match error.retry_after() {
        Some(pause) => failed.after(pause),
        None => failed,
    }
}

/// What of a failure is to be told that came from a store of others, where that lasts: it is neither the asker's fault nor ours.
fn upstream(error: &(dyn Error + 'static)) -> Option<BackendError> {
    let failure = Failure::behind(error).filter(|failure| !failure.is_retryable())?;
    let text = failure.for_strangers(&failure.to_string());
    Some(BackendError::new(Class::Upstream, text))
}

/// The text of a failure for who asks over HTTP; the log has all of it.
fn for_strangers(error: &(dyn Error + 'static)) -> String {
    let text = error.to_string();
    match Failure::behind(error) {
        Some(failure) => failure.for_strangers(&text),
        None => text,
    }
}

fn compute_failed(error: ComputeError) -> BackendError {
    if let Some(told) = upstream(&error) {
        return told.because(error);
    }
    let class = match error.class() {
        ErrorClass::NotFound => Class::NotFound,
        ErrorClass::BadRequest => Class::BadRequest,
        ErrorClass::Retryable => Class::Unavailable,
        ErrorClass::Internal => Class::Internal,
    };
    BackendError::new(class, for_strangers(&error)).because(error)
}

fn desk_failed(error: DeskError) -> BackendError {
    if let Some(told) = upstream(&error) {
        return told.because(error);
    }
    let text = for_strangers(&error);
    let class = match &error {
        DeskError::Full { retry_after, .. } => {
            return BackendError::new(Class::Busy, text).after(*retry_after);
        }
        DeskError::Stopping => Class::Unavailable,
        DeskError::Render(error) if error.is_bad_request() => Class::BadRequest,
        DeskError::Render(error) if error.is_not_found() => Class::NotFound,
        DeskError::Render(error) if error.is_retryable() => Class::Unavailable,
        DeskError::Render(_) => Class::Internal,
    };
    BackendError::new(class, text).because(error)
}

/// Whoever asks has looked in the store.
fn storing(keep: Keep) -> Storing {
    match keep {
        Keep::Yes => Storing::Keep,
        Keep::No => Storing::Nothing,
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;
    use std::sync::Arc;

    use contract::analysis::{Along, HovmollerWishes};
    use contract::digest::Digest;
    use contract::earth::Earth;
    use contract::grid::Grid;
    use contract::manifest::{MANIFEST_SCHEMA, Step};
    use contract::product::ProductId;
    use contract::quantity::Quantity;
    use contract::region::Cells;
    use contract::time::Period;
    use storage::attached::Cause;
    use storage::{Store, domain, fields, manifests};

    use super::*;

    const GRID: Grid = Grid {
        rows: 36,
        cols: 72,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 5.0,
        dlon_deg: 5.0,
    };

    async fn land(store: &Store, name: &str, quantity: Quantity, value: f32) -> Arc<Manifest> {
        let product: ProductId = name.parse().unwrap();
        let period = Period::month(2000, 1).unwrap();
        let values = vec![value; GRID.cell_count()];
        let field = fields::write(store, &product, &GRID, &values, period).await;
        let cells = vec![true; GRID.cell_count()];
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: name.to_owned(),
            quantity,
            synthetic: true,
            source: "made by a test".to_owned(),
            grid: GRID,
            steps: vec![Step {
                masked: None,
                period,
                field: field.unwrap(),
                raw_sha256: Digest::of(name.as_bytes()),
                origin: "made".to_owned(),
                valid_cells: GRID.cell_count() as u64,
                contributed: None,
            }],
            domain: domain::write(store, &product, &cells).await.unwrap(),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        };
        manifests::commit(store, &manifest).await.unwrap();
        Arc::new(manifest)
    }

    fn total(region: &str, cells: Cells, ocean: Option<Arc<Manifest>>) -> BudgetQuery {
        let product = "flux".parse().unwrap();
        BudgetQuery {
            cells,
            ocean,
            ..BudgetQuery::new(product, region.parse().unwrap())
        }
    }

    #[test]
    fn what_others_changed_is_told_and_what_we_broke_is_not() {
        let failure = |is_retryable| Failure {
            place: "array \"fco2\" of https://data.example/fco2.zarr".to_owned(),
            reason: "its values are others than were attached".to_owned(),
            cause: if is_retryable {
                Cause::Away
            } else {
                Cause::Content
            },
            folder: None,
        };
        let stored = |source: Box<dyn Error + Send + Sync>| storage::StorageError::Object {
            key: "fields/fco2".to_owned(),
            source: object_store::Error::Generic {
                store: "attached",
                source,
            },
        };
        let told = |failed: BackendError| (failed.class, failed.text);
        let lasting = || stored(failure(false).into());
        let upstream = (Class::Upstream, failure(false).to_string());
        assert_eq!(told(compute_failed(lasting().into())), upstream);
        let cube = cube::CubeError::Storage(lasting());
        assert_eq!(told(compute_failed(cube.into())), upstream);
        let drawing = render_worker::DrawError::Store {
            what: "fields",
            product: "fco2".to_owned(),
            source: Box::new(lasting()),
        };
        assert_eq!(told(desk_failed(drawing.into())), upstream);
        // What may pass is asked for again, and what is not theirs is ours.
        let passing = compute_failed(stored(failure(true).into()).into());
        assert_eq!(passing.class, Class::Unavailable);
        let own = storage::StorageError::Damaged {
            object: "fields/fco2".to_owned(),
            reason: "a bit".to_owned(),
        };
        assert_eq!(compute_failed(own.into()).class, Class::Internal);
    }

    #[test]
    fn a_folder_of_this_machine_is_told_to_the_log_alone() {
        for cause in [Cause::Content, Cause::Away] {
            let failure = Failure {
                place: "step 2000-01, /srv/theirs.zarr array \"fco2\"".to_owned(),
                reason: "there is no such folder".to_owned(),
                cause,
                folder: Some("/srv/theirs.zarr".to_owned()),
            };
            let stored = storage::StorageError::Object {
                key: "fields/fco2".to_owned(),
                source: object_store::Error::Generic {
                    store: "attached",
                    source: failure.into(),
                },
            };
            let told = compute_failed(stored.into());
            assert!(!told.text.contains("/srv"), "{}", told.text);
            assert!(
                told.text.contains("a folder of the server array"),
                "{}",
                told.text
            );
            let logged = told.source.unwrap().to_string();
            assert!(logged.contains("/srv/theirs.zarr"), "{logged}");
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn whatever_is_asked_over_http_the_store_stays_as_it_is() {
        let store = Store::memory();
        let flux = land(&store, "flux", Quantity::CarbonFlux, 1e-9).await;
        let land = land(&store, "mask", Quantity::LandAreaFraction, 0.25).await;
        let regions = Engine::in_process(store.clone(), NonZeroUsize::MIN);
        let analyst = Analyst::new(Engine::local(store.clone()), &regions, None);
        let before = store.list("").await.unwrap();
        for i in 1..20 {
            let region = format!("{i},-{i},{}.5,{i}.5", i + 30);
            for ocean in [None, Some(Arc::clone(&land))] {
                let query = total(&region, Cells::OceanShare, ocean);
                analyst.budget(&flux, &query).await.unwrap();
            }
            let query = RegionSeriesQuery {
                earth: Earth::Sphere,
                ocean: Some(Arc::clone(&land)),
                ..RegionSeriesQuery::new(flux.product.clone(), region.parse().unwrap())
            };
            analyst.area(&flux, &query).await.unwrap();
            let triangle = format!("POLYGON(({i} 0,{}.5 0,{i} 30,{i} 0))", i + 30);
            let wishes = HovmollerWishes {
                region: triangle.parse().ok(),
                ..HovmollerWishes::default()
            };
            let bands = SeriesQuestion::Hovmoller {
                of: Version {
                    manifest: Arc::clone(&flux),
                    id: flux.id(),
                },
                query: wishes.query(flux.product.clone(), Along::Lat),
            };
            analyst.made_of_series(&bands).await.unwrap();
        }
        assert_eq!(store.list("").await.unwrap(), before);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn how_cells_count_and_what_is_sea_reach_the_sums() {
        let store = Store::memory();
        let flux = land(&store, "flux", Quantity::CarbonFlux, 1e-9).await;
        let mask = land(&store, "mask", Quantity::LandAreaFraction, 0.25).await;
        let regions = Engine::in_process(store.clone(), NonZeroUsize::MIN);
        let analyst = Analyst::new(Engine::local(store), &regions, None);
        // Half of South America.
        let region = "-75,-30,-50,0";
        let of = async |cells, ocean| {
            let query = total(region, cells, ocean);
            analyst.budget(&flux, &query).await.unwrap()
        };
        let whole = of(Cells::Whole, None).await;
        let share = of(Cells::OceanShare, None).await;
        assert!(share.rows[0].budget_tg < 0.5 * whole.rows[0].budget_tg);
        let masked = of(Cells::OceanShare, Some(Arc::clone(&mask))).await;
        let ratio = masked.rows[0].budget_tg / whole.rows[0].budget_tg;
        assert!((ratio - 0.75).abs() < 1e-9, "{ratio}");
        assert!((masked.ocean_area_m2 / whole.region_area_m2 - 0.75).abs() < 1e-9);
        assert!(
            masked.ocean_source.starts_with("mask@1-"),
            "{}",
            masked.ocean_source
        );
        // The other way round: what is no mask is told, as the asker's fault.
        let by_flux = total(region, Cells::Whole, Some(Arc::clone(&flux)));
        let refused = analyst.budget(&mask, &by_flux).await.unwrap_err();
        assert_eq!(refused.class, Class::BadRequest);
        let refused = analyst.budget(&flux, &by_flux).await.unwrap_err();
        assert_eq!(refused.class, Class::BadRequest);
        assert!(
            refused.text.contains("flux cannot say what is sea"),
            "{refused}"
        );
    }
}
