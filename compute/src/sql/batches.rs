//! How large the rows may become that a question computes at a time: its plan in; a refusal out where a batch of them might be larger than memory.
//!
//! A text that is written once stands in each of thousands of rows that are asked for with it, and no limit of memory counts rows that pass.

use std::sync::Arc;

use datafusion::arrow::datatypes::DataType;
use datafusion::common::tree_node::{TreeNode as _, TreeNodeRecursion};
use datafusion::common::{Column, DFSchema, ScalarValue};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::{Expr, ExprSchemable as _, LogicalPlan, Operator};

use super::joined::{DOUBLING, GATHERED, GATHERING};
use super::rows::BATCH_ROWS;
use super::told::told;
use crate::ComputeError;

/// Most that a batch of rows may come to, MiB: a quarter of the memory that a question has by default, which does not count it.
const MAX_BATCH_MIB: f64 = 256.0;
const BYTES_PER_MIB: f64 = 1_048_576.0;
/// A number or an instant, bytes.
const NUMBER_BYTES: f64 = 8.0;
/// One that is written as a text.
const WRITTEN_BYTES: f64 = 32.0;
/// A text of a table, as long as those of a batch are on average, generously.
const STORED_BYTES: f64 = 256.0;
/// Functions whose value is one of their arguments.
const CHOOSING: [&str; 7] = [
    "coalesce", "greatest", "ifnull", "least", "nullif", "nvl", "nvl2",
];

/// # Errors
/// `Sql`: a batch of rows might come to more than [`MAX_BATCH_MIB`]; `text_bytes` is the length of the question.
pub(super) fn check(plan: &LogicalPlan, text_bytes: usize) -> Result<(), ComputeError> {
    let most = most_bytes(plan, text_bytes).map_err(|error| told(error, None))?;
    if most <= MAX_BATCH_MIB * BYTES_PER_MIB {
        return Ok(());
    }
    let reason = format!(
        "{BATCH_ROWS} of its rows, which are computed at a time, may come to more than {MAX_BATCH_MIB} MiB: texts that are written in it stand in every \
         row that they are asked for in; write shorter ones, or ask for fewer columns"
    );
    Err(ComputeError::Sql { reason })
}

fn most_bytes(plan: &LogicalPlan, text_bytes: usize) -> Result<f64, DataFusionError> {
    let of_question = STORED_BYTES.max(text_bytes as f64);
    let (mut queries, mut is_recursive) = (vec![], false);
    plan.apply_with_subqueries(|node| {
        is_recursive |= matches!(node, LogicalPlan::RecursiveQuery(_));
        if let LogicalPlan::Subquery(within) = node {
            queries.push(Arc::clone(&within.subquery));
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    let mut batches = Batches {
        // What one turn reads is what was written for the one before.
        stored: if is_recursive {
            of_question
        } else {
            STORED_BYTES
        },
        outer: of_question,
        gathered: 1.0,
        passing: 0.0,
        most: 0.0,
    };
    batches.of(plan)?;
    for query in queries {
        batches.of(&query)?;
    }
    Ok(batches.most)
}

/// How large the batches of a plan may be.
struct Batches {
    /// Bytes of a text of a table.
    stored: f64,
    /// Of one of the question around.
    outer: f64,
    /// What a value that gathers rows counts as, in the node that is looked at: so often as long as one of a row.
    gathered: f64,
    /// Bytes of the largest value that an expression computes on its way, of one row.
    passing: f64,
    /// Bytes of the largest batch.
    most: f64,
}

/// What comes of a node at a time.
struct Batch {
    rows: f64,
    /// Bytes of each column, of one row.
    columns: Vec<f64>,
}

/// What an expression reads.
struct Below<'a> {
    schema: &'a DFSchema,
    columns: &'a [f64],
}

impl Below<'_> {
    fn column(&self, column: &Column) -> f64 {
        let place = self.schema.maybe_index_of_column(column);
        let known = place.and_then(|at| self.columns.get(at));
        known.copied().unwrap_or_else(|| largest(self.columns))
    }
}

impl Batches {
    fn of(&mut self, node: &LogicalPlan) -> Result<Batch, DataFusionError> {
        let mut inputs = vec![];
        for input in node.inputs() {
            inputs.push(self.of(input)?);
        }
        let rows = rows(node, &inputs);
        // Expressions are computed for each of these.
        let read = inputs.iter().map(|input| input.rows).fold(rows, f64::max);
        let has_inputs = !inputs.is_empty();
        let columns = inputs.into_iter().flat_map(|input| input.columns);
        let columns: Vec<f64> = columns.collect();
        let (written, passing) = self.written(node, &columns)?;
        let count = node.schema().fields().len();
        let own = match node {
            LogicalPlan::Projection(_) | LogicalPlan::Aggregate(_) if written.len() == count => {
                written
            }
            LogicalPlan::Window(_) if columns.len() + written.len() == count => {
                [columns, written].concat()
            }
            LogicalPlan::Values(_) => widest(&written, count),
            LogicalPlan::Union(_) | LogicalPlan::RecursiveQuery(_) => widest(&columns, count),
            _ if !has_inputs => {
                let fields = node.schema().fields().iter();
                fields
                    .map(|field| of_type(field.data_type(), self.stored))
                    .collect()
            }
            _ if columns.len() == count => columns,
            _ => vec![largest(&columns); count],
        };
        // Rows that are written in a question are as long as that.
        if !matches!(node, LogicalPlan::Values(_)) {
            let bytes = own.iter().sum::<f64>() * rows + passing * read;
            self.most = self.most.max(bytes);
        }
        Ok(Batch { rows, columns: own })
    }

    /// Bytes that each expression of a node makes of a row of its inputs, and the most that is there on the way to them.
    fn written(
        &mut self,
        node: &LogicalPlan,
        columns: &[f64],
    ) -> Result<(Vec<f64>, f64), DataFusionError> {
        let inputs = node.inputs();
        let schema = match inputs.as_slice() {
            [input] => input.schema(),
            _ => node.schema(),
        };
        let below = Below { schema, columns };
        let makes_columns = matches!(
            node,
            LogicalPlan::Projection(_)
                | LogicalPlan::Aggregate(_)
                | LogicalPlan::Window(_)
                | LogicalPlan::Values(_)
        );
        let gathered = match node {
            LogicalPlan::Aggregate(own) if own.group_expr.is_empty() => GATHERED,
            _ => 1.0,
        };
        let (mut written, mut most) = (vec![], 0.0f64);
        node.apply_expressions(|expr| {
            (self.passing, self.gathered) = (0.0, gathered);
            let bytes = self.of_expression(expr, &below)?;
            let passing = if makes_columns {
                self.passing
            } else {
                self.passing.max(bytes)
            };
            written.push(bytes);
            // What is summed is there for all sums at once.
            most = if matches!(node, LogicalPlan::Aggregate(_)) {
                most + passing
            } else {
                most.max(passing)
            };
            Ok(TreeNodeRecursion::Continue)
        })?;
        Ok((written, most))
    }

    /// Bytes that an expression makes of a row.
    fn of_expression(&mut self, expr: &Expr, below: &Below<'_>) -> Result<f64, DataFusionError> {
        let is_call = is_call(expr);
        let mut parts = vec![];
        expr.apply_children(|part| {
            let bytes = self.of_expression(part, below)?;
            let is_made = match part {
                Expr::Column(_) | Expr::OuterReferenceColumn(..) => false,
                // It is compared as it is, and handed to functions in every row.
                Expr::Literal(..) => is_call,
                _ => true,
            };
            if is_made {
                self.passing = self.passing.max(bytes);
            }
            parts.push(bytes);
            Ok(TreeNodeRecursion::Continue)
        })?;
        let sum: f64 = parts.iter().sum();
        let is_short = || expr.get_type(below.schema).is_ok_and(|it| is_number(&it));
        Ok(match expr {
            Expr::Column(column) => below.column(column),
            Expr::OuterReferenceColumn(field, _) => of_type(field.data_type(), self.outer),
            Expr::Literal(value, _) => of_literal(value),
            Expr::ScalarSubquery(own) => {
                let (passing, gathered) = (self.passing, self.gathered);
                let found = self.of(&own.subquery)?;
                (self.passing, self.gathered) = (passing, gathered);
                largest(&found.columns)
            }
            Expr::Alias(_) | Expr::GroupingSet(_) | Expr::Unnest(_) | Expr::Lambda(_) => sum,
            Expr::BinaryExpr(both) if both.op == Operator::StringConcat => sum,
            Expr::Case(_) => largest(&parts),
            Expr::Cast(_) | Expr::TryCast(_) if !is_short() => sum.max(WRITTEN_BYTES),
            _ if !is_call || is_short() => NUMBER_BYTES,
            _ => match name_of(expr) {
                name if CHOOSING.contains(&name) => largest(&parts),
                name if name == DOUBLING => 2.0 * sum,
                name if GATHERING.contains(&name) => self.gathered * sum,
                _ => sum.max(WRITTEN_BYTES),
            },
        })
    }
}

/// How many rows of a node are there at a time.
fn rows(node: &LogicalPlan, inputs: &[Batch]) -> f64 {
    let all = inputs.iter().map(|input| input.rows);
    let rows: f64 = match node {
        LogicalPlan::Values(own) => own.values.len() as f64,
        LogicalPlan::Aggregate(own) if own.group_expr.is_empty() => 1.0,
        LogicalPlan::EmptyRelation(_)
        | LogicalPlan::DescribeTable(_)
        | LogicalPlan::Explain(_)
        | LogicalPlan::Analyze(_) => 1.0,
        LogicalPlan::Join(_) => all.product(),
        LogicalPlan::Projection(_)
        | LogicalPlan::Filter(_)
        | LogicalPlan::Window(_)
        | LogicalPlan::Aggregate(_)
        | LogicalPlan::Sort(_)
        | LogicalPlan::Repartition(_)
        | LogicalPlan::Union(_)
        | LogicalPlan::Subquery(_)
        | LogicalPlan::SubqueryAlias(_)
        | LogicalPlan::Limit(_)
        | LogicalPlan::Distinct(_) => all.sum(),
        // A table, and whatever makes rows of its own.
        _ => BATCH_ROWS as f64,
    };
    rows.min(BATCH_ROWS as f64)
}

/// Of each column the most of any row, rows one after the other.
fn widest(all: &[f64], count: usize) -> Vec<f64> {
    let mut own = vec![NUMBER_BYTES; count];
    for row in all.chunks(count.max(1)) {
        for (most, bytes) in own.iter_mut().zip(row) {
            *most = most.max(*bytes);
        }
    }
    own
}

fn largest(all: &[f64]) -> f64 {
    all.iter().copied().fold(NUMBER_BYTES, f64::max)
}

fn is_call(expr: &Expr) -> bool {
    matches!(
        expr,
        Expr::ScalarFunction(_)
            | Expr::HigherOrderFunction(_)
            | Expr::AggregateFunction(_)
            | Expr::WindowFunction(_)
    )
}

/// The name of a function that is called.
fn name_of(expr: &Expr) -> &str {
    match expr {
        Expr::ScalarFunction(call) => call.func.name(),
        Expr::AggregateFunction(call) => call.func.name(),
        Expr::WindowFunction(call) => call.fun.name(),
        _ => "",
    }
}

fn of_type(of: &DataType, text_bytes: f64) -> f64 {
    if is_number(of) {
        NUMBER_BYTES
    } else {
        text_bytes
    }
}

/// Has it a few bytes, whatever its value?
fn is_number(of: &DataType) -> bool {
    of.is_primitive() || matches!(of, DataType::Boolean | DataType::Null)
}

fn of_literal(value: &ScalarValue) -> f64 {
    let bytes = match value.try_as_str() {
        Some(text) => text.map_or(0, str::len),
        None if is_number(&value.data_type()) => 0,
        None => value.size(),
    };
    NUMBER_BYTES.max(bytes as f64)
}
