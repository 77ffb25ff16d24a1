//! A question to a cluster is cut into tasks where its executors are known: by the scheduler, when it plans.
//!
//! A client sends one task with all pieces in it. Merged in any order, what parts of it accumulate is the same bits, so
//! that a plan which nobody cuts has the same answer.

use std::sync::Arc;

use datafusion::common::tree_node::{Transformed, TreeNode as _};
use datafusion::common::{DataFusionError, Result, ScalarValue};
use datafusion::config::ConfigOptions;
use datafusion::logical_expr::{Expr, LogicalPlan, Projection, SubqueryAlias, Union};
use datafusion::optimizer::AnalyzerRule;

use crate::functions::ACCUMULATE;
use crate::reduce::task::Task;

/// Places that tasks are made for however few there are: more executors may come while a query waits.
const LEAST_PLACES: usize = 4;

/// Cuts the one task of a question into parts of a `UNION ALL`, by the parts that a query is planned in.
#[derive(Debug)]
pub(super) struct Dealing;

impl AnalyzerRule for Dealing {
    fn analyze(&self, plan: LogicalPlan, config: &ConfigOptions) -> Result<LogicalPlan> {
        let places = config.execution.target_partitions;
        let cut = |node: LogicalPlan| {
            let LogicalPlan::Aggregate(aggregate) = &node else {
                return Ok(Transformed::no(node));
            };
            match dealt(&aggregate.input, places)? {
                None => Ok(Transformed::no(node)),
                Some(input) => {
                    let expressions = node.expressions();
                    node.with_new_exprs(expressions, vec![input])
                        .map(Transformed::yes)
                }
            }
        };
        plan.transform_down(cut).map(|cut| cut.data)
    }

    fn name(&self) -> &'static str {
        "dealing"
    }
}

/// What the tasks of a question accumulate; none of another plan, or of a question that is one task.
fn dealt(plan: &LogicalPlan, places: usize) -> Result<Option<LogicalPlan>> {
    match plan {
        LogicalPlan::SubqueryAlias(named) => {
            let name = |input| SubqueryAlias::try_new(Arc::new(input), named.alias.clone());
            let dealt = dealt(&named.input, places)?.map(name).transpose()?;
            Ok(dealt.map(LogicalPlan::SubqueryAlias))
        }
        LogicalPlan::Projection(of_all) => {
            let Some(text) = task_text(of_all) else {
                return Ok(None);
            };
            let external = |e: crate::ComputeError| DataFusionError::External(e.into());
            let task = Task::of_text(text).map_err(external)?;
            let tasks = task.dealt(places.max(LEAST_PLACES));
            if tasks.len() < 2 {
                return Ok(None);
            }
            let parts = tasks.iter().map(|task| part(of_all, &task.text()));
            let parts = parts.collect::<Result<Vec<_>>>()?;
            Ok(Some(LogicalPlan::Union(Union::try_new(parts)?)))
        }
        _ => Ok(None),
    }
}

/// The task of a projection that is `accumulate('task')`.
fn task_text(projection: &Projection) -> Option<&str> {
    let [expression] = projection.expr.as_slice() else {
        return None;
    };
    let mut inner = expression;
    while let Expr::Alias(named) = inner {
        inner = &named.expr;
    }
    match inner {
        Expr::ScalarFunction(call) if call.name() == ACCUMULATE => match call.args.as_slice() {
            [Expr::Literal(ScalarValue::Utf8(Some(text)), _)] => Some(text),
            _ => None,
        },
        _ => None,
    }
}

/// The same projection of another task.
fn part(of_all: &Projection, text: &str) -> Result<Arc<LogicalPlan>> {
    let other = |expression: Expr| {
        let Expr::Literal(ScalarValue::Utf8(_), metadata) = expression else {
            return Ok(Transformed::no(expression));
        };
        let text = ScalarValue::from(text);
        Ok(Transformed::yes(Expr::Literal(text, metadata)))
    };
    let expressions = of_all.expr.iter().cloned();
    let expressions = expressions.map(|own| own.transform(other).map(|own| own.data));
    let expressions = expressions.collect::<Result<Vec<_>>>()?;
    // Named as before: what is above it knows it by that.
    let named = expressions.into_iter().zip(of_all.schema.fields());
    let named = named.map(|(own, field)| match own {
        Expr::Alias(_) => own,
        other => other.alias(field.name()),
    });
    let part = Projection::try_new(named.collect(), Arc::clone(&of_all.input))?;
    Ok(Arc::new(LogicalPlan::Projection(part)))
}
