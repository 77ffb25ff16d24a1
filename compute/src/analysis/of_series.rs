//! What is made of one series: a version of a product, a place or region and a period in; climatology, anomaly, trend, season
//! and extremes out, each or the reason why there is none.

use contract::analysis::{
    AnalysisOptions, AnalysisPart, BasePeriod, Refused, SeriesAnalysis, SeriesQuery,
};
use contract::time::Period;
use futures::future::BoxFuture;

use super::climatology::{anomalies, climatology};
use super::extremes::extremes;
use super::harmonics::season;
use super::read::{self, ReadSeries, Version};
use super::timeline::{left_out, no_shorter};
use super::trend::trend;
use super::undefined::Undefined;
use crate::{ComputeError, Engine};

/// The analysis of a version of a product.
///
/// # Errors
/// Those of reading the series. What is not defined for it is said in the answer.
pub fn analyse<'a>(
    engine: &'a Engine,
    of: Version<'a>,
    query: &'a SeriesQuery,
    options: &'a AnalysisOptions,
) -> BoxFuture<'a, Result<SeriesAnalysis, ComputeError>> {
    Box::pin(async move {
        let read = read::series(engine, of, query, options.min_coverage).await?;
        let options = options.clone();
        // Pairs of thousands of steps take a moment.
        tokio::task::spawn_blocking(move || made_of(read, &options))
            .await
            .map_err(|e| ComputeError::inconsistent("analysis", e))
    })
}

fn made_of(read: ReadSeries, options: &AnalysisOptions) -> SeriesAnalysis {
    let extent = read.extent();
    let value_count = read.value_count() as u64;
    let ReadSeries {
        cited,
        place,
        periods,
        values,
        left_out: left_out_count,
        notes,
        window: _,
    } = read;
    let mut answer = SeriesAnalysis {
        start: extent.start,
        end: extent.end,
        step_count: periods.len() as u64,
        value_count,
        min_coverage_percent: options.min_coverage.percent(),
        left_out_count: left_out_count as u64,
        notes,
        refused: vec![],
        climatology: None,
        anomaly: None,
        trend: None,
        season: None,
        extremes: None,
        cited,
        place,
    };
    let has_base =
        |part: &AnalysisPart| matches!(part, AnalysisPart::Climatology | AnalysisPart::Anomaly);
    if options.parts.iter().any(has_base) {
        let short = options.base.and_then(|base| short_of(base, extent));
        answer.notes.extend(short);
    }
    for part in &options.parts {
        let made = match part {
            AnalysisPart::Climatology => climatology(&periods, &values, options.bins, options.base)
                .map(|made| answer.climatology = Some(made)),
            AnalysisPart::Anomaly => climatology(&periods, &values, options.bins, options.base)
                .map(|normal| answer.anomaly = Some(anomalies(&periods, &values, &normal))),
            AnalysisPart::Trend => {
                let step = no_shorter(&periods, options.trend_step);
                answer.notes.extend(left_out(&periods, &values, step));
                trend(&periods, &values, step, &answer.cited.unit)
                    .map(|made| answer.trend = Some(made))
            }
            AnalysisPart::Season => {
                season(&periods, &values).map(|made| answer.season = Some(made))
            }
            AnalysisPart::Extremes => {
                extremes(&periods, &values).map(|made| answer.extremes = Some(made))
            }
        };
        answer
            .refused
            .extend(made.err().map(|e| refused(*part, &e)));
    }
    answer
}

/// Says that a series has no steps in some of the first or last years of a base period that was asked for.
fn short_of(base: BasePeriod, extent: Period) -> Option<String> {
    // Of no year in common the refusal tells.
    let common = base.touched_by(extent)?;
    (common != base).then(|| {
        format!("of the base period {base} there are steps in {common} alone: the climatology is that of these years")
    })
}

fn refused(part: AnalysisPart, why: &Undefined) -> Refused {
    Refused {
        part,
        reason: why.to_string(),
    }
}
