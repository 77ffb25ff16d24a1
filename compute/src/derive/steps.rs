//! One run of steps accumulated on the engine: frames in, exact running sums of every chunk after every step out.

use std::collections::BTreeMap;

use contract::chunk::{Window, frame_chunks};
use contract::grid::Grid;
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::datatypes::{Int64Type, TimestampMillisecondType, UInt32Type};
use futures::TryStreamExt as _;

use super::SourceStep;
use crate::budget::running::{add_sums, column_kg_m2};
use crate::{ComputeError, Engine, scan};

/// One row a chunk and step. Seconds are counted from the start of accumulation on.
const RUNNING_SUMS: &str = "
    SELECT chunk,
           period_start,
           column_sum(\"values\", seconds) OVER (
               PARTITION BY chunk ORDER BY period_start ROWS BETWEEN UNBOUNDED PRECEDING AND CURRENT ROW
           ) AS sums
    FROM (
        SELECT chunk, period_start, \"values\",
               (CAST(period_end AS BIGINT) - GREATEST(CAST(period_start AS BIGINT), CAST($start AS BIGINT))) / 1000.0
                   AS seconds
        FROM frames
    )";

/// Accumulated columns after every step of a run, kg m⁻², `[row, col]`, NaN outside the domain.
///
/// `sums` holds the exact sums of the steps before (`[row, col]`, kg m⁻² in steps of 10⁻¹⁵) and then those of this run
/// too.
pub(super) async fn accumulate_segment(
    engine: &Engine,
    grid: &Grid,
    run: &[SourceStep<'_>],
    domain: &[bool],
    sums: &mut [i64],
) -> Result<Vec<Vec<f32>>, ComputeError> {
    let frames: Vec<_> = run.iter().map(|step| &step.step.frame).collect();
    let context = engine.context().await?;
    scan::register(
        &context,
        "frames",
        engine.store(),
        &frames,
        &storage::frames::SCHEMA,
    )?;
    let failed = || ComputeError::engine("accumulating carbon");
    let sql = RUNNING_SUMS.replace("$start", &run[0].period.start.ms().to_string());
    let query = context.sql(&sql).await.map_err(failed())?;
    let mut batches = query.execute_stream().await.map_err(failed())?;
    let mut segment = Segment::new(grid, run, domain, sums);
    while let Some(batch) = batches.try_next().await.map_err(failed())? {
        segment.take(&batch)?;
    }
    segment.finish(sums)
}

/// Columns as they come in, chunk by chunk in any order.
struct Segment<'a> {
    grid: &'a Grid,
    windows: Vec<Window>,
    domain: &'a [bool],
    /// Index of a step by the start of its source's period, ms.
    index_of: BTreeMap<i64, usize>,
    /// Exact sums before this run.
    before: Vec<i64>,
    /// Exact sums after it.
    after: Vec<i64>,
    columns: Vec<Vec<f32>>,
    rows_taken: usize,
}

impl<'a> Segment<'a> {
    fn new(grid: &'a Grid, run: &[SourceStep<'_>], domain: &'a [bool], sums: &[i64]) -> Self {
        let starts = run.iter().enumerate();
        Self {
            grid,
            windows: frame_chunks(grid),
            domain,
            index_of: starts
                .map(|(index, step)| (step.step.period.start.ms(), index))
                .collect(),
            before: sums.to_vec(),
            after: sums.to_vec(),
            columns: vec![vec![f32::NAN; grid.cell_count()]; run.len()],
            rows_taken: 0,
        }
    }

    fn take(&mut self, batch: &RecordBatch) -> Result<(), ComputeError> {
        let chunks = batch.column(0).as_primitive::<UInt32Type>();
        let starts = batch.column(1).as_primitive::<TimestampMillisecondType>();
        let lists = batch.column(2).as_list::<i32>();
        for row in 0..batch.num_rows() {
            let sums = lists.value(row);
            self.take_chunk(
                chunks.value(row),
                starts.value(row),
                sums.as_primitive::<Int64Type>().values(),
            )?;
        }
        Ok(())
    }

    fn take_chunk(&mut self, chunk: u32, start_ms: i64, sums: &[i64]) -> Result<(), ComputeError> {
        let window = self
            .windows
            .get(chunk as usize)
            .filter(|window| window.cell_count() == sums.len());
        let (Some(window), Some(&step)) = (window, self.index_of.get(&start_ms)) else {
            return Err(ComputeError::inconsistent(
                "accumulated carbon",
                format!("chunk {chunk} was not asked for"),
            ));
        };
        let indices: Vec<usize> = window.cell_indices(self.grid).collect();
        let mut totals: Vec<i64> = indices.iter().map(|&index| self.before[index]).collect();
        add_sums(&mut totals, sums)
            .map_err(|e| ComputeError::inconsistent("accumulated carbon", e))?;
        let is_last = step + 1 == self.columns.len();
        for (&index, total) in indices.iter().zip(totals) {
            if self.domain[index] {
                self.columns[step][index] = column_kg_m2(total);
            }
            if is_last {
                self.after[index] = total;
            }
        }
        self.rows_taken += 1;
        Ok(())
    }

    fn finish(self, sums: &mut [i64]) -> Result<Vec<Vec<f32>>, ComputeError> {
        let expected = self.windows.len() * self.columns.len();
        if self.rows_taken != expected {
            let reason = format!(
                "the engine answered for {} chunks of {expected}",
                self.rows_taken
            );
            return Err(ComputeError::inconsistent("accumulated carbon", reason));
        }
        sums.copy_from_slice(&self.after);
        Ok(self.columns)
    }
}
