//! Lengths of time that a question compares: its plan in; a refusal out where one is an interval that the engine would compare wrongly.
//!
//! An interval is months, days and what is shorter, and of two the engine compares the months first, then the days, then the rest. So 31 days,
//! which a difference of instants has as what is shorter, are less than `INTERVAL '2 days'`.

use datafusion::arrow::datatypes::DataType;
use datafusion::common::tree_node::{TreeNode as _, TreeNodeRecursion};
use datafusion::common::{DFSchema, ScalarValue};
use datafusion::logical_expr::{Expr, ExprSchemable as _, LogicalPlan, Operator};

use super::told::told;
use crate::ComputeError;

/// # Errors
/// `Sql`: an interval that may have months or days is compared.
pub(super) fn check(plan: &LogicalPlan) -> Result<(), ComputeError> {
    let mut is_compared = false;
    let visited = plan.apply_with_subqueries(|node| {
        let inputs = node.inputs();
        // Of a join both sides.
        let mut of_inputs = DFSchema::empty();
        for input in &inputs {
            of_inputs.merge(input.schema());
        }
        let schema: &DFSchema = if inputs.is_empty() {
            node.schema()
        } else {
            &of_inputs
        };
        node.apply_expressions(|expr| {
            expr.apply(|part| {
                is_compared |= compares(part, schema);
                Ok(TreeNodeRecursion::Continue)
            })
        })
    });
    visited.map_err(|error| told(error, None))?;
    if !is_compared {
        return Ok(());
    }
    let reason = "intervals have no order: months, days and hours are compared one after the other, so that 48 hours are less than 2 days; compare \
        instants (time_end > time_start + INTERVAL '2 days') or numbers (extract(epoch FROM time_end - time_start) > 2 * 86400)";
    Err(ComputeError::Sql {
        reason: reason.to_owned(),
    })
}

/// Does an expression compare such an interval itself?
fn compares(expr: &Expr, schema: &DFSchema) -> bool {
    match expr {
        Expr::BinaryExpr(own) => {
            is_comparison(own.op) && (has_days(&own.left, schema) || has_days(&own.right, schema))
        }
        Expr::Between(own) => {
            has_days(&own.expr, schema) || has_days(&own.low, schema) || has_days(&own.high, schema)
        }
        Expr::InList(own) => {
            has_days(&own.expr, schema) || own.list.iter().any(|one| has_days(one, schema))
        }
        _ => false,
    }
}

fn is_comparison(op: Operator) -> bool {
    matches!(
        op,
        Operator::Eq
            | Operator::NotEq
            | Operator::Lt
            | Operator::LtEq
            | Operator::Gt
            | Operator::GtEq
            | Operator::IsDistinctFrom
            | Operator::IsNotDistinctFrom
    )
}

/// Is an expression an interval that may have months or days?
fn has_days(expr: &Expr, schema: &DFSchema) -> bool {
    if let Expr::Literal(ScalarValue::IntervalMonthDayNano(Some(own)), _) = expr {
        return own.months != 0 || own.days != 0;
    }
    // What has no type is told of by the engine.
    let kind = expr.get_type(schema);
    kind.is_ok_and(|kind| matches!(kind, DataType::Interval(_)))
}
