//! Tables that are the answer to a question about one product, worked out when their rows are read: what the functions
//! `stats`, `budget` and `analysis` stand for.

use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::sync::Arc;

use async_trait::async_trait;
use contract::manifest::Manifest;
use contract::region::{AskedRegion, MaskCode};
use datafusion::arrow::array::{ArrayRef, RecordBatch, StringArray, TimestampMillisecondArray};
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::catalog::memory::MemorySourceConfig;
use datafusion::catalog::{Session, TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::{Result, ScalarValue, plan_err};
use datafusion::logical_expr::{Expr, TableType};
use datafusion::physical_plan::ExecutionPlan;
use futures::future::BoxFuture;

use super::named::Named;
use super::pinned::Pinned;
use super::version::external;
use crate::region::mask;
use crate::{ComputeError, Engine};

/// Where a question of the cells of a mask is until their rows are read: looking them up is no part of a plan.
const EVERYWHERE: &str = "global";

/// A question about a version of a product.
pub(super) trait Question: Debug + Send + Sync {
    /// Columns of its answer.
    fn schema(&self) -> SchemaRef;

    /// The same of another region.
    fn over(&self, region: AskedRegion) -> Arc<dyn Question>;

    /// Rows of its answer.
    fn rows<'a>(
        &'a self,
        engine: &'a Engine,
        manifest: &'a Manifest,
    ) -> BoxFuture<'a, Result<RecordBatch, ComputeError>>;
}

/// A kind of questions, as SQL calls it.
#[derive(Debug)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    /// What it takes, with an example: said where texts are others or too few or many.
    pub(super) usage: &'static str,
    /// How many texts may come after those of the product and the place.
    pub(super) more: RangeInclusive<usize>,
    /// Texts to a question: its product and place, and what comes after them.
    pub(super) asked: fn(&Named, &str, &[&str]) -> Asked,
}

/// A question, or why there is none.
pub(super) type Asked = Result<Arc<dyn Question>, ComputeError>;

/// A function that stands for the answers of a kind of questions, about the versions that one question in SQL reads.
pub(super) struct AnswerFunction {
    kind: &'static Kind,
    engine: Engine,
    pinned: Arc<Pinned>,
}

impl AnswerFunction {
    /// Nothing is stored for a question.
    pub(super) fn new(kind: &'static Kind, engine: &Engine, pinned: &Arc<Pinned>) -> Self {
        Self {
            kind,
            engine: engine.storing_no_weights(),
            pinned: Arc::clone(pinned),
        }
    }
}

impl Debug for AnswerFunction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.kind.name)
    }
}

impl TableFunctionImpl for AnswerFunction {
    fn call_with_args(&self, args: TableFunctionArgs<'_, '_>) -> Result<Arc<dyn TableProvider>> {
        let text = |expr: &Expr| match expr {
            Expr::Literal(ScalarValue::Utf8(Some(text)) | ScalarValue::Utf8View(Some(text)), _) => {
                Some(text.clone())
            }
            _ => None,
        };
        let texts: Option<Vec<String>> = args.exprs().iter().map(text).collect();
        let texts = texts.unwrap_or_default();
        let words: Vec<&str> = texts.iter().map(String::as_str).collect();
        let (kind, usage) = (self.kind, self.kind.usage);
        let [product, place, more @ ..] = &words[..] else {
            return plan_err!("{usage}");
        };
        if !kind.more.contains(&more.len()) {
            return plan_err!("{usage}");
        }
        let Some(product) = Named::of(product) else {
            return plan_err!("{product:?} is no product");
        };
        let mask = Named::with_code(place);
        let place = mask.as_ref().map_or(*place, |_| EVERYWHERE);
        let question = (kind.asked)(&product, place, more).map_err(external)?;
        Ok(Arc::new(AnswerTable {
            engine: self.engine.clone(),
            pinned: Arc::clone(&self.pinned),
            product,
            mask,
            question,
        }))
    }
}

/// Rows that are worked out when they are read.
struct AnswerTable {
    engine: Engine,
    pinned: Arc<Pinned>,
    product: Named,
    /// Whose cells with this code the question is of, if it is.
    mask: Option<(Named, MaskCode)>,
    question: Arc<dyn Question>,
}

impl AnswerTable {
    async fn rows(&self) -> Result<RecordBatch, ComputeError> {
        let engine = &self.engine;
        let manifest = self.pinned.required(&self.product).await?;
        let Some((named, code)) = &self.mask else {
            return self.question.rows(engine, &manifest).await;
        };
        let codes = self.pinned.required(named).await?;
        let region = mask::region(engine.store(), &codes, code).await?;
        self.question.over(region).rows(engine, &manifest).await
    }
}

impl Debug for AnswerTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} of {}", self.question, self.product.product)
    }
}

#[async_trait]
impl TableProvider for AnswerTable {
    fn schema(&self) -> SchemaRef {
        self.question.schema()
    }

    fn table_type(&self) -> TableType {
        TableType::Temporary
    }

    async fn scan(
        &self,
        _state: &dyn Session,
        projection: Option<&Vec<usize>>,
        _filters: &[Expr],
        _limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let batch = self.rows().await.map_err(external)?;
        Ok(MemorySourceConfig::try_new_exec(
            &[vec![batch]],
            self.schema(),
            projection.cloned(),
        )?)
    }
}

/// A column of instants, ms.
pub(super) fn instants(ms: impl Iterator<Item = i64>) -> ArrayRef {
    Arc::new(TimestampMillisecondArray::from_iter_values(ms).with_timezone("UTC"))
}

/// A column that says in every row what may surprise about an answer, which nobody sees beside its table here; null where nothing does.
pub(super) fn told_in_each_row(notes: &[String], count: usize) -> ArrayRef {
    let notes = (!notes.is_empty()).then(|| notes.join("; "));
    Arc::new(std::iter::repeat_n(notes, count).collect::<StringArray>())
}

/// Rows of columns in the order of their schema.
pub(super) fn batch(
    schema: SchemaRef,
    columns: Vec<ArrayRef>,
) -> Result<RecordBatch, ComputeError> {
    let failed = ComputeError::engine("telling an answer");
    RecordBatch::try_new(schema, columns).map_err(|e| failed(e.into()))
}
