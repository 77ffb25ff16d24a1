//! What is made of series, within limits and remembered: every question names the versions that it is about.

use std::sync::Arc;

use contract::analysis::SeriesQuery;
use contract::digest::Digest;
use serde_json::{Value, json};

use super::Analyses;
use crate::backend::{MadeOfSeries, SeriesQuestion};
use crate::error::ServerError;

impl Analyses {
    /// The answer to a question about series.
    pub async fn made_of_series(
        &self,
        question: SeriesQuestion,
    ) -> Result<Arc<MadeOfSeries>, ServerError> {
        let key = Digest::of_json(&("made of series", asked(&question)));
        let analyst = Arc::clone(&self.analyst);
        let computed = async move { analyst.made_of_series(&question).await };
        self.made_of_series
            .answer(key, &self.gate, &self.metrics, computed)
            .await
    }
}

/// All that shapes an answer.
fn asked(question: &SeriesQuestion) -> Value {
    match question {
        SeriesQuestion::Analysis {
            of,
            series,
            options,
        } => json!(["analysis", of.id, where_and_when(series), options]),
        SeriesQuestion::Correlation { of, with, query } => json!([
            "correlation",
            of.id,
            with.id,
            where_and_when(&query.series),
            query.step,
            query.deseasonalise,
            query.max_lag,
            query.min_coverage,
        ]),
        SeriesQuestion::Difference {
            of,
            minus,
            min_coverage,
        } => json!([
            "difference",
            of.0.id,
            where_and_when(&of.1),
            minus.0.id,
            where_and_when(&minus.1),
            min_coverage,
        ]),
        SeriesQuestion::Hovmoller { of, query } => json!([
            "hovmoller",
            of.id,
            query.along,
            query.band_deg,
            query
                .region
                .as_ref()
                .map(|asked| (Digest::of_json(&asked.region), &asked.name)),
            query.step,
            [query.from, query.to],
            query.earth,
            query.min_coverage,
        ]),
    }
}

/// A tree of a geometry would take many times its size: it is told by its digest.
fn where_and_when(series: &SeriesQuery) -> Value {
    let (from, to) = series.window();
    match series {
        SeriesQuery::Cell { place, .. } => json!(["cell", place, from, to]),
        SeriesQuery::Region(query) => json!([
            "region",
            Digest::of_json(&query.region),
            query.region_name,
            from,
            to,
            query.earth,
            query.ocean.as_ref().map(|ocean| ocean.id()),
        ]),
        SeriesQuery::Line(query) => json!([
            "line",
            Digest::of_json(&query.line.line),
            query.line.name,
            from,
            to,
            query.earth,
        ]),
    }
}
