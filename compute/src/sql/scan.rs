//! The leaf of a plan: some columns of a selection out of a version, read piece by piece, a few ahead.

use std::fmt::Formatter;
use std::sync::Arc;

use cube::Block;
use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::common::stats::Precision;
use datafusion::common::tree_node::TreeNodeRecursion;
use datafusion::common::{ColumnStatistics, DataFusionError, Result, ScalarValue, Statistics};
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::physical_expr::{EquivalenceProperties, PhysicalExpr};
use datafusion::physical_plan::coop::cooperative;
use datafusion::physical_plan::execution_plan::{Boundedness, EmissionType, SchedulingType};
use datafusion::physical_plan::metrics::{
    Count, ExecutionPlanMetricsSet, MetricBuilder, MetricsSet,
};
use datafusion::physical_plan::statistics::StatisticsArgs;
use datafusion::physical_plan::stream::RecordBatchStreamAdapter;
use datafusion::physical_plan::{
    ChildrenPropertiesMode, DisplayAs, DisplayFormatType, ExecutionPlan, Partitioning,
    PlanProperties, ReplaceChildrenOptions,
};
use futures::{StreamExt as _, TryStreamExt as _, future, stream};

use super::columns::Column;
use super::reads::{Piece, Reads};
use super::rows::RowMaker;
use super::selection::Selection;
use super::version::{Version, external};
use crate::ComputeError;

/// Reads a selection.
#[derive(Debug, Clone)]
pub(super) struct Scan {
    what: Arc<What>,
    /// Rows after which it ends.
    limit: Option<usize>,
    properties: Arc<PlanProperties>,
    metrics: ExecutionPlanMetricsSet,
}

/// What is read.
pub(super) struct What {
    pub(super) version: Version,
    /// Its values along time, where some are read so.
    pub(super) values: Option<cube::Values>,
    pub(super) selection: Selection,
    pub(super) reads: Arc<Reads>,
    pub(super) columns: Vec<Column>,
    pub(super) schema: SchemaRef,
}

impl std::fmt::Debug for What {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.version)
    }
}

impl What {
    fn are_values_read(&self) -> bool {
        self.columns.contains(&Column::Value)
    }

    /// Is every cell of every selected step selected?
    fn is_whole_steps(&self) -> bool {
        self.selection.cell_count() == self.version.manifest().grid.cell_count()
    }

    async fn batches(self: Arc<Self>, piece: Piece) -> Result<Vec<RecordBatch>> {
        match piece {
            Piece::Chunks { step, chunks } if self.are_values_read() => {
                self.of_fields(step, chunks).await.map_err(external)
            }
            Piece::Chunks { step, chunks } => self
                .made(move |what, maker| {
                    let windows = what.reads.windows();
                    let mut own = chunks.iter().map(|chunk| windows[*chunk as usize]);
                    let made = own.try_for_each(|window| maker.chunk(step, window, None));
                    made.map_err(ComputeError::engine("making rows"))
                })
                .await
                .map_err(external),
            Piece::Blocks { steps, blocks } => {
                self.of_blocks(steps, blocks).await.map_err(external)
            }
        }
    }

    /// Chunks of a field; what is remembered of a damaged one, which was stored anew since, is forgotten once.
    async fn of_fields(
        self: Arc<Self>,
        step: u32,
        chunks: Vec<u32>,
    ) -> Result<Vec<RecordBatch>, ComputeError> {
        let own = &self.version.manifest().steps[step as usize];
        match Arc::clone(&self).tried(step, &chunks).await {
            Err(error) if self.version.is_forgotten(own, &error) => self.tried(step, &chunks).await,
            other => other,
        }
    }

    async fn tried(
        self: Arc<Self>,
        step: u32,
        chunks: &[u32],
    ) -> Result<Vec<RecordBatch>, ComputeError> {
        let own = &self.version.manifest().steps[step as usize];
        let (fetched, period) = (self.version.chunks(own, chunks).await?, own.period);
        self.made(move |what, maker| {
            let windows = what.reads.windows();
            fetched.each(
                |chunk| storage::fields::expected(windows, chunk, period),
                |chunk, values| {
                    maker
                        .chunk(step, windows[chunk as usize], Some(values))
                        .map_err(ComputeError::engine("making rows"))
                },
            )
        })
        .await
    }

    async fn of_blocks(
        self: Arc<Self>,
        steps: Vec<u32>,
        blocks: Vec<[u32; 2]>,
    ) -> Result<Vec<RecordBatch>, ComputeError> {
        let (Some(first), Some(last), Some(values)) = (steps.first(), steps.last(), &self.values)
        else {
            return Ok(vec![]);
        };
        let (first, run) = (*first, *first as usize..*last as usize + 1);
        let read: Vec<Block> = match values.blocks(&blocks, run.clone()).await {
            Ok(read) => read,
            Err(error) => match self.version.values_anew().await {
                Some(values) => values?.blocks(&blocks, run).await?,
                None => return Err(error.into()),
            },
        };
        self.made(move |_what, maker| {
            for block in &read {
                let made = maker.block(&steps, first, block);
                made.map_err(ComputeError::engine("making rows"))?;
            }
            Ok(())
        })
        .await
    }

    /// Makes rows on a thread of their own.
    async fn made(
        self: Arc<Self>,
        make: impl FnOnce(&Self, &mut RowMaker<'_>) -> Result<(), ComputeError> + Send + 'static,
    ) -> Result<Vec<RecordBatch>, ComputeError> {
        let made = tokio::task::spawn_blocking(move || {
            let axes = self.version.axes();
            let mut maker = RowMaker::new(axes, &self.selection, &self.columns, &self.schema);
            make(&self, &mut maker)?;
            maker.finish().map_err(ComputeError::engine("making rows"))
        });
        made.await
            .map_err(|e| ComputeError::inconsistent("rows of a product", e))?
    }
}

impl Scan {
    pub(super) fn new(what: What, limit: Option<usize>) -> Self {
        let properties = PlanProperties::new(
            EquivalenceProperties::new(Arc::clone(&what.schema)),
            Partitioning::UnknownPartitioning(1),
            EmissionType::Incremental,
            Boundedness::Bounded,
        );
        Self {
            what: Arc::new(what),
            limit,
            properties: Arc::new(properties.with_scheduling_type(SchedulingType::Cooperative)),
            metrics: ExecutionPlanMetricsSet::new(),
        }
    }

    /// Bytes of values that are decoded.
    fn bytes(&self) -> usize {
        if self.what.are_values_read() {
            self.what.reads.bytes()
        } else {
            0
        }
    }

    fn column_statistics(&self, column: Column, row_count: usize) -> ColumnStatistics {
        let mut own = ColumnStatistics::new_unknown();
        let manifest = self.what.version.manifest();
        let steps = &self.what.selection.steps;
        if column != Column::Value {
            own.null_count = Precision::Exact(0);
        } else if self.what.is_whole_steps() && self.limit.is_none() {
            let valid = steps
                .iter()
                .map(|step| manifest.steps[*step as usize].valid_cells);
            let valid: u64 = valid.sum();
            own.null_count = Precision::Exact(row_count.saturating_sub(valid as usize));
        }
        let (Some(first), Some(last), None) = (steps.first(), steps.last(), self.limit) else {
            return own;
        };
        let axes = self.what.version.axes();
        let instants = match column {
            Column::TimeStart => &axes.starts_ms,
            Column::TimeEnd => &axes.ends_ms,
            _ => return own,
        };
        if row_count > 0 {
            let exact = |step: u32| {
                let ms = Some(instants[step as usize]);
                Precision::Exact(ScalarValue::TimestampMillisecond(ms, Some("UTC".into())))
            };
            (own.min_value, own.max_value) = (exact(*first), exact(*last));
        }
        own
    }
}

impl DisplayAs for Scan {
    fn fmt_as(&self, _how: DisplayFormatType, f: &mut Formatter<'_>) -> std::fmt::Result {
        let (what, selection) = (&self.what, &self.what.selection);
        let manifest = what.version.manifest();
        let names: Vec<&str> = what.columns.iter().map(|column| column.name()).collect();
        let [chunks, all_chunks] = what.reads.chunk_counts();
        write!(
            f,
            "ProductScan: {}, columns=[{}], steps={} of {}, cells={} of {}, chunks={chunks} of {all_chunks}, ",
            what.version.id(),
            names.join(", "),
            selection.steps.len(),
            manifest.steps.len(),
            selection.cell_count(),
            manifest.grid.cell_count(),
        )?;
        if what.are_values_read() {
            write!(f, "reads={}, bytes={}", what.reads.how(), self.bytes())?;
        } else {
            write!(f, "reads=nothing, bytes=0")?;
        }
        match self.limit {
            Some(limit) => write!(f, ", limit={limit}"),
            None => Ok(()),
        }
    }
}

impl ExecutionPlan for Scan {
    fn name(&self) -> &'static str {
        "ProductScan"
    }

    fn properties(&self) -> &Arc<PlanProperties> {
        &self.properties
    }

    fn children(&self) -> Vec<&Arc<dyn ExecutionPlan>> {
        vec![]
    }

    fn apply_expressions(
        &self,
        _each: &mut dyn FnMut(&Arc<dyn PhysicalExpr>) -> Result<TreeNodeRecursion>,
    ) -> Result<TreeNodeRecursion> {
        Ok(TreeNodeRecursion::Continue)
    }

    fn replace_children(
        self: Arc<Self>,
        _children: Vec<Arc<dyn ExecutionPlan>>,
        _options: ReplaceChildrenOptions,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        Ok(self)
    }

    fn with_new_children(
        self: Arc<Self>,
        children: Vec<Arc<dyn ExecutionPlan>>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let options = ReplaceChildrenOptions::new(ChildrenPropertiesMode::Recompute);
        self.replace_children(children, options)
    }

    fn execute(
        &self,
        partition: usize,
        _context: Arc<TaskContext>,
    ) -> Result<SendableRecordBatchStream> {
        let what = Arc::clone(&self.what);
        // Of a few rows nothing is read that nobody may ask for.
        let ahead = match self.limit {
            Some(_few) => 1,
            None => what.version.decoders() + 1,
        };
        let counter = |name| MetricBuilder::new(&self.metrics).counter(name, partition);
        let (rows, pieces) = (counter("output_rows"), counter("pieces_read"));
        let schema = Arc::clone(&what.schema);
        let batches = stream::iter(what.reads.pieces())
            .map(move |piece| Arc::clone(&what).batches(piece))
            .buffered(ahead)
            .inspect_ok(move |_batches| pieces.add(1))
            .map_ok(|batches| stream::iter(batches.into_iter().map(Ok::<_, DataFusionError>)))
            .try_flatten();
        let batches = limited(batches, self.limit, rows);
        let stream = RecordBatchStreamAdapter::new(schema, Box::pin(batches));
        Ok(Box::pin(cooperative(stream)))
    }

    fn metrics(&self) -> Option<MetricsSet> {
        Some(self.metrics.clone_inner())
    }

    fn statistics_from_inputs(
        &self,
        _inputs: &[Arc<Statistics>],
        _args: &StatisticsArgs,
    ) -> Result<Arc<Statistics>> {
        let all = self.what.selection.row_count();
        let row_count = self.limit.map_or(all, |limit| limit.min(all));
        let columns = self.what.columns.iter();
        Ok(Arc::new(Statistics {
            num_rows: Precision::Exact(row_count),
            total_byte_size: Precision::Absent,
            column_statistics: columns
                .map(|column| self.column_statistics(*column, row_count))
                .collect(),
        }))
    }
}

/// Batches up to a number of rows, counted.
fn limited(
    batches: impl stream::Stream<Item = Result<RecordBatch>>,
    limit: Option<usize>,
    rows: Count,
) -> impl stream::Stream<Item = Result<RecordBatch>> {
    let left = limit.unwrap_or(usize::MAX);
    batches
        .scan(left, |left, batch| {
            future::ready(match batch {
                _ if *left == 0 => None,
                Ok(batch) => {
                    let batch = batch.slice(0, batch.num_rows().min(*left));
                    *left -= batch.num_rows();
                    Some(Ok(batch))
                }
                Err(error) => Some(Err(error)),
            })
        })
        .inspect_ok(move |batch| rows.add(batch.num_rows()))
}
