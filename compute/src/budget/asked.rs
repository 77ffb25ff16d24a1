//! Exact sums of a region's share of some steps, asked of the engine: chunks are read where the region is, and only sums
//! leave the part of the query that read them.

use std::collections::BTreeMap;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Step;
use contract::time::{Period, TimeMs};
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::{DataType, Decimal128Type, Int64Type, TimestampMillisecondType};
use serde::{Deserialize, Serialize};

use super::bands::{BAND_COUNT, band_areas, summed_bands};
use super::rows::StepSum;
use crate::region::address::RegionAddress;
use crate::region::loaded::weights_failed;
use crate::scan;
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// One row a step: the seconds are those of the whole step; parts of steps are shared out afterwards, exactly.
///
/// Weights are no table: a join would hold them beside every chunk, and under Ballista it would send every value to
/// another part of the query. What is asked of the fields is which chunks to read.
///
/// Chunks are counted: one that a damaged footer hides from the engine must not be missing from a sum in silence.
const STEP_SUMS: &str = "
    SELECT period_start,
           period_end,
           SUM(get_field(sums, 'mass')) AS mass,
           SUM(get_field(sums, 'area')) AS area,
           SUM(get_field(sums, 'chunks')) AS chunks,
           STRING_AGG(bands, ' ') AS bands
    FROM (SELECT period_start,
                 period_end,
                 region_sums(\"values\", chunk, $seconds, '$weights') AS sums,
                 band_sums(\"values\", chunk, $seconds, '$ocean', '$grid') AS bands
          FROM fields
          WHERE $chunks)
    GROUP BY period_start, period_end";

/// What is summed over cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// Flux x area x time: a mass, kg.
    Mass,
    /// Value x area: what a mean is made of.
    Mean,
}

/// A region on a grid, its weights read.
pub(super) struct WeighedRegion {
    grid: Grid,
    weights: RegionAddress,
    /// Chunks that the region touches.
    runs: Vec<(u32, u32)>,
    chunk_count: usize,
    /// Area of the region on the grid, m².
    pub(super) on_grid_m2: f64,
    /// Area of its sea in every band, m² in steps of 10⁻⁶.
    pub(super) sea_steps: [i128; BAND_COUNT],
}

impl WeighedRegion {
    /// Reads the weights.
    pub(super) async fn read(
        engine: &Engine,
        grid: &Grid,
        weights: &RegionAddress,
    ) -> Result<Self, ComputeError> {
        let weighed = async |address: &str| {
            let weights = engine.objects().weights(address).await;
            weights.map_err(weights_failed)
        };
        let (whole, sea) = (weighed(&weights.all).await?, weighed(&weights.ocean).await?);
        let sea_steps = band_areas(grid, sea.chunks())
            .map_err(|e| ComputeError::inconsistent(weights.keys.ocean.as_str(), e))?;
        Ok(Self {
            grid: *grid,
            weights: weights.clone(),
            runs: whole.runs(),
            chunk_count: whole.chunk_count(),
            on_grid_m2: whole.chunks().flat_map(|(_, areas_m2)| areas_m2).sum(),
            sea_steps,
        })
    }
}

/// The question about all fields.
fn sql(measure: Measure, region: &WeighedRegion) -> String {
    let seconds = match measure {
        Measure::Mass => "(CAST(period_end AS BIGINT) - CAST(period_start AS BIGINT)) / 1000.0",
        Measure::Mean => "CAST(1.0 AS DOUBLE)",
    };
    let run = |(first, last): (u32, u32)| {
        format!("chunk BETWEEN CAST({first} AS INT UNSIGNED) AND CAST({last} AS INT UNSIGNED)")
    };
    let chunks: Vec<String> = region.runs.iter().copied().map(run).collect();
    let quoted = |text: &str| text.replace('\'', "''");
    let grid = serde_json::to_string(&region.grid).expect("a grid is plain numbers");
    STEP_SUMS
        .replace("$seconds", seconds)
        .replace("$chunks", &chunks.join(" OR "))
        .replace("$weights", &quoted(&region.weights.all))
        .replace("$ocean", &quoted(&region.weights.ocean))
        .replace("$grid", &quoted(&grid))
}

/// Exact sums of steps in their order.
pub(super) async fn asked(
    engine: &Engine,
    steps: &[&Step],
    region: &WeighedRegion,
    measure: Measure,
) -> Result<Vec<StepSum>, ComputeError> {
    let fields: Vec<&ObjectKey> = steps.iter().map(|step| &step.field).collect();
    let keys = &region.weights.keys;
    let job = Digest::of_json(&("sums", measure, &fields, keys));
    let ask = |context| ask(engine, context, &fields, region, measure);
    let answered = async {
        let answer = engine.answer(job, ask).await?;
        in_order(steps, &answer)
    };
    let mut read = fields.clone();
    read.extend([&keys.all, &keys.ocean]);
    scan::or_damaged(
        engine.store(),
        &read,
        scan::caught(Box::pin(answered)).await,
    )
    .await
}

/// An answer of the engine: rows, and of how many chunks each must be.
struct Answer {
    batches: Vec<RecordBatch>,
    chunk_count: usize,
}

async fn ask(
    engine: &Engine,
    context: QueryContext,
    fields: &[&ObjectKey],
    region: &WeighedRegion,
    measure: Measure,
) -> Result<Answer, ComputeError> {
    let store = engine.store();
    scan::register(&context, "fields", store, fields).await?;
    let failed = || ComputeError::engine("summing over a region");
    let query = context.sql(&sql(measure, region)).await.map_err(failed())?;
    Ok(Answer {
        batches: query.collect().await.map_err(failed())?,
        chunk_count: region.chunk_count,
    })
}

/// The sums of each of these steps.
fn in_order(steps: &[&Step], answer: &Answer) -> Result<Vec<StepSum>, ComputeError> {
    let mut sums = BTreeMap::new();
    for batch in &answer.batches {
        for (sum, chunk_count) in sums_of(batch)? {
            if usize::try_from(chunk_count) != Ok(answer.chunk_count) {
                let reason = format!(
                    "the engine summed {chunk_count} chunks of {}, the region touches {}",
                    sum.period, answer.chunk_count
                );
                return Err(ComputeError::inconsistent("sums", reason));
            }
            sums.insert(sum.period.start, sum);
        }
    }
    let found: Option<Vec<StepSum>> = steps
        .iter()
        .map(|step| sums.remove(&step.period.start))
        .collect();
    found.filter(|_| sums.is_empty()).ok_or_else(|| {
        let reason = format!(
            "the engine did not answer for each of {} steps",
            steps.len()
        );
        ComputeError::inconsistent("sums", reason)
    })
}

/// Sums of steps, each with the number of chunks in it.
fn sums_of(batch: &RecordBatch) -> Result<Vec<(StepSum, i64)>, ComputeError> {
    let time = |column: usize| {
        batch
            .column(column)
            .as_primitive::<TimestampMillisecondType>()
    };
    let decimal = |column: usize| batch.column(column).as_primitive::<Decimal128Type>();
    let (starts, ends, masses, areas) = (time(0), time(1), decimal(2), decimal(3));
    let chunk_counts = batch.column(4).as_primitive::<Int64Type>();
    let bands = cast(batch.column(5), &DataType::Utf8)
        .map_err(|e| ComputeError::inconsistent("sums of bands", e))?;
    let sea = |row: usize| {
        let text = bands.as_string::<i32>().value(row);
        summed_bands(text).ok_or_else(|| ComputeError::inconsistent("sums of bands", text))
    };
    (0..batch.num_rows())
        .map(|row| {
            let period = Period::new(
                TimeMs::new(starts.value(row))?,
                TimeMs::new(ends.value(row))?,
            )?;
            let sum = StepSum {
                period,
                mass_steps: masses.value(row),
                area_steps: areas.value(row),
                sea: sea(row)?,
            };
            Ok((sum, chunk_counts.value(row)))
        })
        .collect()
}

#[cfg(test)]
mod tests;
