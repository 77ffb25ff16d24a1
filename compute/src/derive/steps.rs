//! One run of steps accumulated on the engine over a band of rows: fields in, exact running sums of every chunk after every step out.

use std::collections::BTreeMap;
use std::ops::Range;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, Window, field_chunk_count, field_chunks};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use datafusion::arrow::array::{AsArray as _, BooleanArray, RecordBatch};
use datafusion::arrow::datatypes::{Int64Type, TimestampMillisecondType, UInt32Type};
use datafusion::error::DataFusionError;
use datafusion::execution::SendableRecordBatchStream;
use futures::TryStreamExt as _;
use storage::domain::Cells;

use super::source::SourceStep;
use crate::budget::running::{add_sums, column_kg_m2};
use crate::scan;
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// One row a chunk and step: the sums after it, and which cells it adds to. Seconds are counted from the start of
/// accumulation on.
const RUNNING_SUMS: &str = "
    SELECT chunk,
           period_start,
           column_sum(\"values\", seconds) OVER (
               PARTITION BY chunk ORDER BY period_start ROWS BETWEEN UNBOUNDED PRECEDING AND CURRENT ROW
           ) AS sums,
           has_data(\"values\") AS has_data
    FROM (
        SELECT chunk, period_start, \"values\",
               (CAST(period_end AS BIGINT) - GREATEST(CAST(period_start AS BIGINT), CAST($start AS BIGINT))) / 1000.0
                   AS seconds
        FROM fields $where
    )";

/// One row a chunk: the same sums after the last step only.
const FINAL_SUMS: &str = "
    SELECT chunk, column_sum(\"values\", seconds) AS sums
    FROM (
        SELECT chunk, \"values\",
               (CAST(period_end AS BIGINT) - GREATEST(CAST(period_start AS BIGINT), CAST($start AS BIGINT))) / 1000.0
                   AS seconds
        FROM fields $where
    )
    GROUP BY chunk";

/// Rows of a grid that are accumulated together: whole rows of chunks.
#[derive(Debug, Clone)]
pub(super) struct Band {
    whole: Grid,
    rows: Range<u32>,
}

impl Band {
    pub(super) fn new(grid: &Grid, rows: &Range<u32>) -> Self {
        Self {
            whole: *grid,
            rows: rows.clone(),
        }
    }

    /// A grid of its rows alone.
    fn grid(&self) -> Grid {
        Grid {
            rows: self.rows.len() as u32,
            ..self.whole
        }
    }

    /// Number of its first cell.
    fn first_cell(&self) -> usize {
        self.rows.start as usize * self.whole.cols as usize
    }

    /// Number of its first chunk.
    fn first_chunk(&self) -> u32 {
        self.rows.start / CHUNK_ROWS * self.whole.cols.div_ceil(CHUNK_COLS)
    }

    /// What selects its chunks; nothing where it is all of the grid.
    fn condition(&self) -> String {
        if self.rows.len() == self.whole.rows as usize {
            return String::new();
        }
        let first = self.first_chunk();
        let end = u64::from(first) + field_chunk_count(&self.grid());
        format!("WHERE chunk >= {first} AND chunk < {end}")
    }
}

/// A run of steps, accumulated over a band.
pub(super) struct Accumulated {
    /// Columns after every step, kg m⁻², `[row, col]`, NaN outside the domain.
    pub(super) columns: Vec<Vec<f32>>,
    /// Cells with data in every step, `[row, col]`.
    pub(super) has_data: Vec<Vec<bool>>,
    /// Exact sums after the last step, `[row, col]`, kg m⁻² in steps of 10⁻¹⁵.
    pub(super) after: Vec<i64>,
}

/// Accumulates a run of steps over a band; `domain` is of the whole grid.
///
/// `before` holds the exact sums of the steps before (`[row, col]` of the band, kg m⁻² in steps of 10⁻¹⁵).
pub(super) async fn accumulate_segment(
    engine: &Engine,
    band: &Band,
    run: &[SourceStep<'_>],
    domain: &Cells,
    before: &[i64],
) -> Result<Accumulated, ComputeError> {
    let job = job("running sums", band, run);
    let columns = |context: QueryContext| async move {
        let mut batches = query(engine, &context, (RUNNING_SUMS, band), run).await?;
        let mut segment = Segment::new(band, run, domain, before);
        while let Some(batch) = batches.try_next().await.map_err(failed())? {
            segment.take(&batch)?;
        }
        segment.finish()
    };
    let answered = scan::caught(Box::pin(engine.answer(job, columns))).await;
    scan::or_damaged(engine.store(), &fields_of(run), answered).await
}

/// The exact sums of a band after the last step of a run, `[row, col]`, kg m⁻² in steps of 10⁻¹⁵.
pub(super) async fn sums_after(
    engine: &Engine,
    band: &Band,
    run: &[SourceStep<'_>],
) -> Result<Vec<i64>, ComputeError> {
    let job = job("final sums", band, run);
    let sums = |context: QueryContext| async move {
        let mut batches = query(engine, &context, (FINAL_SUMS, band), run).await?;
        let grid = &band.grid();
        let (windows, first_chunk) = (field_chunks(grid), band.first_chunk());
        let (mut sums, mut taken) = (vec![0; grid.cell_count()], 0);
        while let Some(batch) = batches.try_next().await.map_err(failed())? {
            let chunks = batch.column(0).as_primitive::<UInt32Type>();
            let lists = batch.column(1).as_list::<i32>();
            for row in 0..batch.num_rows() {
                let list = lists.value(row);
                let chunk_sums = list.as_primitive::<Int64Type>().values();
                let chunk = chunks.value(row);
                let window = window_of(&windows, (chunk, first_chunk), chunk_sums.len())?;
                for (index, &sum) in window.cell_indices(grid).zip(chunk_sums) {
                    sums[index] = sum;
                }
                taken += 1;
            }
        }
        all_chunks(taken, windows.len()).map(|()| sums)
    };
    let answered = scan::caught(Box::pin(engine.answer(job, sums))).await;
    scan::or_damaged(engine.store(), &fields_of(run), answered).await
}

fn fields_of<'a>(run: &[SourceStep<'a>]) -> Vec<&'a ObjectKey> {
    run.iter().map(|step| &step.step.field).collect()
}

fn failed() -> impl FnOnce(DataFusionError) -> ComputeError {
    ComputeError::engine("accumulating carbon")
}

/// Named by what the last step is made of, by where the run begins, and by the rows.
fn job(what: &str, band: &Band, run: &[SourceStep<'_>]) -> Digest {
    let made_of = |step: Option<&SourceStep<'_>>| step.map(|step| step.made_of);
    let rows = (band.rows.start, band.rows.end);
    Digest::of_json(&(what, rows, made_of(run.first()), made_of(run.last())))
}

async fn query(
    engine: &Engine,
    context: &QueryContext,
    (sql, band): (&str, &Band),
    run: &[SourceStep<'_>],
) -> Result<SendableRecordBatchStream, ComputeError> {
    let (store, fields) = (engine.store(), fields_of(run));
    scan::register(context, "fields", store, &fields).await?;
    let sql = sql.replace("$start", &run[0].period.start.ms().to_string());
    let sql = sql.replace("$where", &band.condition());
    let query = context.sql(&sql).await.map_err(failed())?;
    query.execute_stream().await.map_err(failed())
}

/// The window of an answered chunk in its band, if it was asked for; `first` is the number of the band's first one.
fn window_of(
    windows: &[Window],
    (chunk, first): (u32, u32),
    cell_count: usize,
) -> Result<Window, ComputeError> {
    let window = chunk
        .checked_sub(first)
        .and_then(|chunk| windows.get(chunk as usize))
        .filter(|window| window.cell_count() == cell_count);
    let not_asked = || format!("chunk {chunk} was not asked for");
    window
        .copied()
        .ok_or_else(|| ComputeError::inconsistent("accumulated carbon", not_asked()))
}

fn all_chunks(taken: usize, expected: usize) -> Result<(), ComputeError> {
    if taken == expected {
        return Ok(());
    }
    let reason = format!("the engine answered for {taken} chunks of {expected}");
    Err(ComputeError::inconsistent("accumulated carbon", reason))
}

/// Columns as they come in, chunk by chunk in any order.
struct Segment<'a> {
    /// Of the band alone.
    grid: Grid,
    windows: Vec<Window>,
    first_chunk: u32,
    /// Cells of the band that are of the domain.
    is_of_domain: Vec<bool>,
    /// Index of a step by the start of its source's period, ms.
    index_of: BTreeMap<i64, usize>,
    /// Exact sums before this run.
    before: &'a [i64],
    /// Exact sums after it.
    after: Vec<i64>,
    columns: Vec<Vec<f32>>,
    has_data: Vec<Vec<bool>>,
    rows_taken: usize,
}

impl<'a> Segment<'a> {
    fn new(band: &Band, run: &[SourceStep<'_>], domain: &Cells, before: &'a [i64]) -> Self {
        let starts = run.iter().enumerate();
        let (grid, first_cell) = (band.grid(), band.first_cell());
        Self {
            grid,
            windows: field_chunks(&grid),
            first_chunk: band.first_chunk(),
            is_of_domain: domain.flags(first_cell..first_cell + grid.cell_count()),
            index_of: starts
                .map(|(index, step)| (step.step.period.start.ms(), index))
                .collect(),
            before,
            after: before.to_vec(),
            columns: vec![vec![f32::NAN; grid.cell_count()]; run.len()],
            has_data: vec![vec![false; grid.cell_count()]; run.len()],
            rows_taken: 0,
        }
    }

    fn take(&mut self, batch: &RecordBatch) -> Result<(), ComputeError> {
        let chunks = batch.column(0).as_primitive::<UInt32Type>();
        let starts = batch.column(1).as_primitive::<TimestampMillisecondType>();
        let lists = batch.column(2).as_list::<i32>();
        let flags = batch.column(3).as_list::<i32>();
        for row in 0..batch.num_rows() {
            let (sums, has_data) = (lists.value(row), flags.value(row));
            self.take_chunk(
                chunks.value(row),
                starts.value(row),
                sums.as_primitive::<Int64Type>().values(),
                has_data.as_boolean(),
            )?;
        }
        Ok(())
    }

    fn take_chunk(
        &mut self,
        chunk: u32,
        start_ms: i64,
        sums: &[i64],
        has_data: &BooleanArray,
    ) -> Result<(), ComputeError> {
        let chunk = (chunk, self.first_chunk);
        let window = window_of(&self.windows, chunk, sums.len())?;
        window_of(&self.windows, chunk, has_data.len())?;
        let Some(&step) = self.index_of.get(&start_ms) else {
            let reason = format!("a step from {start_ms} ms on was not asked for");
            return Err(ComputeError::inconsistent("accumulated carbon", reason));
        };
        let indices: Vec<usize> = window.cell_indices(&self.grid).collect();
        let mut totals: Vec<i64> = indices.iter().map(|&index| self.before[index]).collect();
        add_sums(&mut totals, sums)
            .map_err(|e| ComputeError::inconsistent("accumulated carbon", e))?;
        let is_last = step + 1 == self.columns.len();
        for (&index, total) in indices.iter().zip(totals) {
            if self.is_of_domain[index] {
                self.columns[step][index] = column_kg_m2(total);
            }
            if is_last {
                self.after[index] = total;
            }
        }
        for (&index, has_data) in indices.iter().zip(has_data.values()) {
            self.has_data[step][index] = has_data;
        }
        self.rows_taken += 1;
        Ok(())
    }

    fn finish(self) -> Result<Accumulated, ComputeError> {
        all_chunks(self.rows_taken, self.windows.len() * self.columns.len())?;
        Ok(Accumulated {
            columns: self.columns,
            has_data: self.has_data,
            after: self.after,
        })
    }
}
