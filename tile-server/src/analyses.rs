//! Series and budgets from the analyst, within limits, and remembered: every question names a version.

mod of_series;

use std::future::Future;
use std::sync::Arc;

use bytes::Bytes;
use contract::budget::{
    AskedRiver, BudgetAnswer, BudgetErrors, BudgetHistory, BudgetParts, BudgetQuery,
};
use contract::check::Check;
use contract::digest::Digest;
use contract::grid::LonLatDeg;
use contract::region::{AskedRegion, MaskCode, Polygon, Region};
use contract::rows::{RowsForm, Tabular};
use contract::series::RegionSeriesQuery;
use contract::statistics::StatisticsQuery;
use prometheus::IntCounter;
use quick_cache::Weighter;
use quick_cache::sync::Cache;

use crate::backend::{Analyse, MadeOfSeries};
use crate::catalogue::Layer;
use crate::client::Client;
use crate::error::ServerError;
use crate::fair_gate::FairGate;
use crate::metrics::Metrics;
use crate::single_flight::SingleFlight;

/// Budgets remembered, a guess that sizes tables; one of 16 years by month takes 34 KiB.
const BUDGETS: usize = 1000;
/// Rows and regions in all of them, some 500 bytes each.
const BUDGET_ROWS: u64 = 1 << 17;
/// Histories of budgets remembered; one of 200 versions takes 60 KiB.
const HISTORIES: usize = 100;
/// Answers about time that are remembered as the bytes that they are answered with, a guess that sizes tables; one of 16 years of days
/// takes 100 KiB to 1.2 MiB.
const TEXTS: usize = 200;
/// Bytes of all of them: a hundred regions over 16 years of days.
const TEXT_BYTES: u64 = 128 << 20;
/// Regions of masks that are remembered, a guess that sizes tables; a basin of a mask of one degree takes some 10 KiB.
const MASK_REGIONS: usize = 100;
/// Bytes of all of them.
const MASK_REGION_BYTES: u64 = 32 << 20;
/// What is made of series and remembered; a Hovmöller diagram takes 8 MiB at most.
const MADE_OF_SERIES: usize = 40;

fn text_bytes(text: &Bytes) -> u64 {
    text.len() as u64 + 1
}

/// What the rectangles of a region of a mask take.
pub(crate) fn region_bytes(region: &AskedRegion) -> u64 {
    /// A rectangle: its corners, and what holds them.
    const RECTANGLE_BYTES: usize = 4 * size_of::<[f64; 2]>() + size_of::<Polygon>();
    match &region.region {
        Region::Polygons(all) => (all.len() * RECTANGLE_BYTES) as u64,
        Region::Global | Region::Box { .. } => 0,
    }
}

/// Rows of an answer, those of its regions too.
fn budget_rows(answer: &BudgetAnswer) -> u64 {
    let of_regions = answer
        .regions
        .iter()
        .map(|region| region.rows.len() as u64 + 1);
    answer.rows.len() as u64 + of_regions.sum::<u64>() + 1
}

/// All that shapes a budget of a version.
fn budget_key(layer: &Layer, query: &BudgetQuery) -> Digest {
    Digest::of_json(&(
        &layer.id,
        (&query.region, &query.region_name),
        (query.from, query.to, query.step),
        (query.earth, query.cells),
        query.ocean.as_ref().map(|ocean| ocean.id()),
        query.errors.as_ref().map(BudgetErrors::key),
        query.river.as_ref().map(AskedRiver::key),
        query.parts.as_ref().map(BudgetParts::key),
    ))
}

/// The analyses of one server.
pub struct Analyses {
    analyst: Arc<dyn Analyse>,
    gate: FairGate,
    metrics: Metrics,
    budgets: Answers<BudgetAnswer>,
    histories: Answers<BudgetHistory>,
    /// Series and statistics as they are answered, which takes longer to write than values take to read.
    texts: Answers<Bytes>,
    made_of_series: Answers<MadeOfSeries>,
    mask_regions: Answers<AskedRegion>,
}

/// Answers of one kind, by the digest of what was asked: those remembered and those under way.
struct Answers<T: Send + Sync + 'static> {
    remembered: Cache<Digest, Arc<T>, Weight<T>>,
    under_way: SingleFlight<Arc<T>>,
}

/// What an answer weighs.
struct Weight<T>(fn(&T) -> u64);

impl<T> Clone for Weight<T> {
    fn clone(&self) -> Self {
        Self(self.0)
    }
}

impl<T> Weighter<Digest, Arc<T>> for Weight<T> {
    fn weight(&self, _key: &Digest, answer: &Arc<T>) -> u64 {
        (self.0)(answer)
    }
}

impl<T: Send + Sync + 'static> Answers<T> {
    /// Remembers as many as together have at most this weight; `typical_count` sizes tables, `panics` counts those of
    /// computing one.
    fn new(typical_count: usize, most: u64, weight: fn(&T) -> u64, panics: &IntCounter) -> Self {
        Self {
            remembered: Cache::with_weighter(typical_count, most, Weight(weight)),
            under_way: SingleFlight::new(panics),
        }
    }

    /// The answer to a question: one that is remembered, or `computed` behind the gate, once for all who ask meanwhile;
    /// the turn is that of whoever asked first.
    async fn answer<E: Into<ServerError> + Send + 'static>(
        &self,
        key: Digest,
        gate: &FairGate,
        metrics: &Metrics,
        computed: impl Future<Output = Result<T, E>> + Send + 'static,
    ) -> Result<Arc<T>, ServerError> {
        if let Some(answer) = self.remembered.get(&key) {
            return Ok(answer);
        }
        let (gate, client, metrics) = (gate.clone(), Client::asking(), metrics.clone());
        let behind_the_gate = || async move {
            let _pass = gate
                .enter(client)
                .await
                .inspect_err(|_busy| metrics.refused.inc())?;
            Ok(Arc::new(computed.await.map_err(Into::into)?))
        };
        let answer = self.under_way.join(key, behind_the_gate).await?;
        self.remembered.insert(key, Arc::clone(&answer));
        Ok(answer)
    }
}

impl Analyses {
    /// Nothing computed yet.
    pub(crate) fn new(analyst: Arc<dyn Analyse>, gate: FairGate, metrics: Metrics) -> Self {
        let panics = &metrics.panics;
        let made_of_series = MADE_OF_SERIES as u64;
        let mask_bytes = |one: &AskedRegion| region_bytes(one) + 1;
        Self {
            analyst,
            gate,
            budgets: Answers::new(BUDGETS, BUDGET_ROWS, budget_rows, panics),
            histories: Answers::new(HISTORIES, HISTORIES as u64, |_one| 1, panics),
            texts: Answers::new(TEXTS, TEXT_BYTES, text_bytes, panics),
            made_of_series: Answers::new(MADE_OF_SERIES, made_of_series, |_one| 1, panics),
            mask_regions: Answers::new(MASK_REGIONS, MASK_REGION_BYTES, mask_bytes, panics),
            metrics,
        }
    }

    /// The series of the cell at a place, a [`contract::series::PointSeries`], in a form.
    pub async fn point(
        &self,
        layer: &Layer,
        place: LonLatDeg,
        form: RowsForm,
    ) -> Result<Bytes, ServerError> {
        let key = Digest::of_json(&("point", &layer.id, place, form));
        let (analyst, manifest) = (Arc::clone(&self.analyst), Arc::clone(&layer.manifest));
        let id = layer.id.clone();
        let computed = async move {
            let answer = analyst.point(&manifest, &id, place).await?;
            let (values, steps) = (answer.series.len(), manifest.steps.len());
            if values != steps {
                return Err(ServerError::Defect {
                    what: format!("the analyst gave {values} values for {steps} steps"),
                });
            }
            written(&*analyst, &answer, form)
        };
        self.text(key, computed).await
    }

    /// Bytes of an answer.
    async fn text(
        &self,
        key: Digest,
        computed: impl Future<Output = Result<Bytes, ServerError>> + Send + 'static,
    ) -> Result<Bytes, ServerError> {
        let text = self.texts.answer(key, &self.gate, &self.metrics, computed);
        Ok(Bytes::clone(&*text.await?))
    }

    /// A budget of `layer`.
    pub async fn budget(
        &self,
        layer: &Layer,
        query: BudgetQuery,
    ) -> Result<Arc<BudgetAnswer>, ServerError> {
        let key = budget_key(layer, &query);
        let (analyst, manifest) = (Arc::clone(&self.analyst), Arc::clone(&layer.manifest));
        let computed = async move { analyst.budget(&manifest, &query).await };
        self.budgets
            .answer(key, &self.gate, &self.metrics, computed)
            .await
    }

    /// A budget by the versions of the product of which `layer` is the newest.
    pub async fn budget_history(
        &self,
        layer: &Layer,
        query: BudgetQuery,
    ) -> Result<Arc<BudgetHistory>, ServerError> {
        let key = budget_key(layer, &query);
        let analyst = Arc::clone(&self.analyst);
        let computed = async move { analyst.budget_history(&query).await };
        self.histories
            .answer(key, &self.gate, &self.metrics, computed)
            .await
    }

    /// A series of `layer` over a region, a [`contract::series::RegionSeries`], in a form.
    pub async fn area(
        &self,
        layer: &Layer,
        query: RegionSeriesQuery,
        form: RowsForm,
    ) -> Result<Bytes, ServerError> {
        let ocean = query.ocean.as_ref().map(|ocean| ocean.id());
        let region = (&query.region, &query.region_name);
        let asked = (region, query.from, query.to, query.earth, ocean);
        let key = Digest::of_json(&("area", &layer.id, asked, form));
        let (analyst, manifest) = (Arc::clone(&self.analyst), Arc::clone(&layer.manifest));
        let computed = async move {
            let answer = analyst.area(&manifest, &query).await?;
            written(&*analyst, &answer, form)
        };
        self.text(key, computed).await
    }

    /// Statistics of `layer` over a geometry, a [`contract::statistics::StatisticsAnswer`], in a form.
    pub async fn statistics(
        &self,
        layer: &Layer,
        query: StatisticsQuery,
        form: RowsForm,
    ) -> Result<Bytes, ServerError> {
        let key = Digest::of_json(&(
            "statistics",
            &layer.id,
            (&query.geometry, &query.geometry_name),
            (&query.statistics, query.step, query.min_coverage),
            (query.from, query.to),
            (query.earth, query.cells),
            query.ocean.as_ref().map(|ocean| ocean.id()),
            form,
        ));
        let (analyst, manifest) = (Arc::clone(&self.analyst), Arc::clone(&layer.manifest));
        let id = layer.id.clone();
        let computed = async move {
            let answer = analyst.statistics(&manifest, &id, &query).await?;
            written(&*analyst, &answer, form)
        };
        self.text(key, computed).await
    }

    /// An answer in a form.
    pub(crate) fn written(
        &self,
        answer: &dyn Tabular,
        form: RowsForm,
    ) -> Result<Bytes, ServerError> {
        written(&*self.analyst, answer, form)
    }

    /// The cells where a mask has a code.
    pub async fn mask_region(
        &self,
        mask: &Layer,
        code: MaskCode,
    ) -> Result<Arc<AskedRegion>, ServerError> {
        let key = Digest::of_json(&("mask region", &mask.id, code.to_string()));
        let (analyst, manifest) = (Arc::clone(&self.analyst), Arc::clone(&mask.manifest));
        let computed = async move { analyst.mask_region(&manifest, &code).await };
        self.mask_regions
            .answer(key, &self.gate, &self.metrics, computed)
            .await
    }

    /// Our budgets beside published ones.
    pub async fn check(&self) -> Result<Option<Check>, ServerError> {
        Ok(self.analyst.check().await?)
    }
}

/// An answer in a form.
fn written(
    analyst: &dyn Analyse,
    answer: &dyn Tabular,
    form: RowsForm,
) -> Result<Bytes, ServerError> {
    let content = match form {
        RowsForm::Json => answer.json().map_err(|e| ServerError::Defect {
            what: format!("an answer that is no JSON: {e}"),
        })?,
        RowsForm::Csv | RowsForm::Arrow => analyst.encoded(&answer.columns(), form)?,
    };
    Ok(Bytes::from(content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_is_remembered_is_bounded_by_its_bytes() {
        let registry = crate::metrics::Registry::new();
        let metrics = Metrics::register(&registry).unwrap();
        let gate = FairGate::new(1, 1, metrics.analyses_waiting.clone());
        let answers: Answers<Bytes> = Answers::new(4, 1000, text_bytes, &metrics.panics);
        for number in 0..50_u8 {
            let computed = async move { Ok::<_, ServerError>(Bytes::from(vec![number; 300])) };
            let key = Digest::of(&[number]);
            let text = answers
                .answer(key, &gate, &metrics, computed)
                .await
                .unwrap();
            assert_eq!(text[0], number);
            let held = answers.remembered.weight();
            assert!(held <= 1000, "{held}");
        }
        assert!(answers.remembered.weight() >= 301, "nothing is remembered");
    }
}
