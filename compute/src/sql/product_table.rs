//! A version of a product as a table: what is asked of it becomes a scan.

use std::sync::Arc;

use async_trait::async_trait;
use cube::Description;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::catalog::{Session, TableProvider};
use datafusion::common::Result;
use datafusion::logical_expr::{Expr, TableProviderFilterPushDown, TableType};
use datafusion::physical_plan::ExecutionPlan;

use super::columns::{self, Column};
use super::reads::Reads;
use super::scan::{Scan, What};
use super::selection::{Selection, axis_of};
use super::version::{Version, external};

/// The table.
#[derive(Debug)]
pub(super) struct ProductTable {
    version: Version,
    schema: SchemaRef,
}

impl ProductTable {
    pub(super) fn new(version: Version, description: &Description) -> Self {
        Self {
            schema: columns::schema(description),
            version,
        }
    }
}

#[async_trait]
impl TableProvider for ProductTable {
    fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    fn supports_filters_pushdown(
        &self,
        filters: &[&Expr],
    ) -> Result<Vec<TableProviderFilterPushDown>> {
        let each = filters.iter().map(|filter| match axis_of(filter) {
            Some(_axis) => TableProviderFilterPushDown::Exact,
            None => TableProviderFilterPushDown::Unsupported,
        });
        Ok(each.collect())
    }

    async fn scan(
        &self,
        state: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let selection = Selection::of(self.version.axes(), filters, state)?;
        let columns: Vec<Column> = match projection {
            Some(places) => places.iter().map(|place| Column::ALL[*place]).collect(),
            None => Column::ALL.to_vec(),
        };
        let schema = match projection {
            Some(places) => Arc::new(self.schema.project(places)?),
            None => self.schema(),
        };
        let is_along_time =
            columns.contains(&Column::Value) && Reads::may_be_less_along_time(&selection);
        let values = if is_along_time {
            Some(self.version.values().await.map_err(external)?)
        } else {
            None
        };
        let grid = &self.version.manifest().grid;
        let what = What {
            reads: Arc::new(Reads::of(grid, &selection, values.as_ref())),
            version: self.version.clone(),
            values,
            selection,
            columns,
            schema,
        };
        Ok(Arc::new(Scan::new(what, limit)))
    }
}
