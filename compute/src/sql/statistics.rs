//! `stats('product', 'region', 'month', 'mean,p90')` as a table: the rows of `fluxglobe stats`, exact sums and all, for what a
//! sum over rows of cells would do slower and less exactly.

use std::sync::Arc;

use async_trait::async_trait;
use contract::geometry::AskedGeometry;
use contract::grid::LonLatDeg;
use contract::region::AskedRegion;
use contract::statistics::{Statistic, Statistics, StatisticsAnswer, StatisticsQuery};
use contract::time::TimeStep;
use datafusion::arrow::array::{
    ArrayRef, Float64Array, RecordBatch, StringArray, TimestampMillisecondArray, UInt32Array,
};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::catalog::memory::MemorySourceConfig;
use datafusion::catalog::{Session, TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::{Result, ScalarValue, plan_err};
use datafusion::logical_expr::{Expr, TableType};
use datafusion::physical_plan::ExecutionPlan;

use super::columns::instant;
use super::named::Named;
use super::version::external;
use crate::reduce::statistics_of;
use crate::{ComputeError, Engine};

pub(super) const NAME: &str = "stats";

/// Name, signature, what it is, source.
pub(super) const ABOUT: [&str; 4] = [
    NAME,
    "stats('product', 'region'|'LON,LAT'|'LON,LAT;LON,LAT;...', 'step', 'statistics') as a table",
    "the rows of `fluxglobe stats` in the unit that people read; step native and statistics mean if left out",
    "",
];

const USAGE: &str = "stats takes texts: 'product', where, and perhaps a step and statistics, such as stats('sst', 'global', 'month', 'mean,p90')";

/// The table function.
pub(super) struct StatisticsFunction {
    engine: Engine,
}

impl StatisticsFunction {
    /// Nothing is stored for a question.
    pub(super) fn new(engine: &Engine) -> Self {
        Self {
            engine: engine.storing_no_weights(),
        }
    }
}

impl std::fmt::Debug for StatisticsFunction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(NAME)
    }
}

impl TableFunctionImpl for StatisticsFunction {
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
        let [product, place, more @ ..] = &words[..] else {
            return plan_err!("{USAGE}");
        };
        if more.len() > 2 {
            return plan_err!("{USAGE}");
        }
        let Some(product) = Named::of(product) else {
            return plan_err!("{product:?} is no product");
        };
        let asked = asked(&product, place, more).map_err(external)?;
        Ok(Arc::new(StatisticsTable {
            schema: schema(&asked.statistics),
            engine: self.engine.clone(),
            product,
            asked,
        }))
    }
}

fn asked(product: &Named, place: &str, more: &[&str]) -> Result<StatisticsQuery, ComputeError> {
    let geometry = if place.contains(';') || place.trim_start().starts_with("LINESTRING") {
        AskedGeometry::line(place)?
    } else if let Ok(place) = place.parse::<LonLatDeg>() {
        AskedGeometry::point(place, contract::geometry::Sampling::default())
    } else {
        place.parse::<AskedRegion>()?.into()
    };
    let usual = StatisticsQuery::new(product.product.clone(), geometry);
    let step = match more.first() {
        Some(step) => step.parse::<TimeStep>()?,
        None => usual.step,
    };
    let statistics = match more.get(1) {
        Some(words) => words.parse::<Statistics>()?,
        None => usual.statistics.clone(),
    };
    Ok(StatisticsQuery {
        step,
        statistics,
        ..usual
    })
}

fn schema(statistics: &Statistics) -> SchemaRef {
    let mut fields = vec![
        Field::new("time_start", instant(), false),
        Field::new("time_end", instant(), false),
    ];
    let number = |one: Statistic| Field::new(one.to_string(), DataType::Float64, true);
    fields.extend(statistics.iter().map(number));
    fields.extend([
        Field::new("coverage_percent", DataType::Float64, false),
        Field::new("step_count", DataType::UInt32, false),
        Field::new("unit", DataType::Utf8, false),
    ]);
    Arc::new(Schema::new(fields))
}

/// Rows that are worked out when they are read.
struct StatisticsTable {
    engine: Engine,
    product: Named,
    asked: StatisticsQuery,
    schema: SchemaRef,
}

impl std::fmt::Debug for StatisticsTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{NAME} of {}", self.asked.product)
    }
}

#[async_trait]
impl TableProvider for StatisticsTable {
    fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
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
        let manifest = self
            .product
            .manifest(&self.engine)
            .await
            .map_err(external)?;
        let Some(manifest) = manifest else {
            let known = storage::manifests::products(self.engine.store()).await;
            return Err(external(ComputeError::UnknownProduct {
                product: self.asked.product.to_string(),
                known: known.map_err(external)?,
            }));
        };
        let answer = statistics_of(&self.engine, &self.asked, &manifest, manifest.id()).await;
        let batch = rows(
            &answer.map_err(external)?,
            &self.asked.statistics,
            &self.schema,
        )?;
        let schema = self.schema();
        Ok(MemorySourceConfig::try_new_exec(
            &[vec![batch]],
            schema,
            projection.cloned(),
        )?)
    }
}

fn rows(
    answer: &StatisticsAnswer,
    statistics: &Statistics,
    schema: &SchemaRef,
) -> Result<RecordBatch> {
    let rows = &answer.rows;
    let instants = |ms: Vec<i64>| -> ArrayRef {
        Arc::new(TimestampMillisecondArray::from(ms).with_timezone("UTC"))
    };
    let mut columns = vec![
        instants(rows.iter().map(|row| row.start.ms()).collect()),
        instants(rows.iter().map(|row| row.end.ms()).collect()),
    ];
    for one in statistics.iter() {
        let name = one.to_string();
        let values = rows
            .iter()
            .map(|row| row.values.get(&name).copied().flatten());
        columns.push(Arc::new(values.collect::<Float64Array>()));
    }
    let coverage = rows.iter().map(|row| row.coverage_percent);
    columns.push(Arc::new(Float64Array::from_iter_values(coverage)));
    let steps = rows.iter().map(|row| row.step_count);
    columns.push(Arc::new(UInt32Array::from_iter_values(steps)));
    let units = rows.iter().map(|_row| &answer.cited.unit);
    columns.push(Arc::new(StringArray::from_iter_values(units)));
    Ok(RecordBatch::try_new(Arc::clone(schema), columns)?)
}
