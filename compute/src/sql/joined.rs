//! How long texts and lists may become that a question joins with each other: its plan in; a refusal out where a value might be larger than
//! memory. No limit of memory counts single values.

use datafusion::common::tree_node::{TreeNode as _, TreeNodeRecursion, TreeNodeVisitor};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::{Expr, LogicalPlan, Operator};

use super::told::told;
use crate::ComputeError;

/// Functions of the engine whose value is as large as their arguments together, by the names that plans have for them. `||` of lists is
/// one of them.
const JOINING: [&str; 11] = [
    "array_append",
    "array_concat",
    "array_prepend",
    "array_union",
    "arrays_zip",
    "concat",
    "make_array",
    "map",
    "named_struct",
    "overlay",
    "struct",
];
/// One whose value may be twice as large as its argument: hexadecimal digits of bytes.
pub(super) const DOUBLING: &str = "encode";
/// Aggregates of rows as one value, which may already be as large as the limit of memory lets them.
pub(super) const GATHERING: [&str; 2] = ["array_agg", "string_agg"];
/// What those count as: texts so often as long as one of a row.
pub(super) const GATHERED: f64 = 256.0;

/// Longest text of a product's tables, bytes, generously.
const STORED_BYTES: usize = 1024;
/// Longest value that a question may make by joining, MiB: 12 doublings of what is stored.
const MAX_VALUE_MIB: f64 = 4.0;
const BYTES_PER_MIB: f64 = 1_048_576.0;

/// # Errors
/// `Sql`: values might come to more than [`MAX_VALUE_MIB`]; `text_bytes` is the length of the question, whose texts can be no longer.
pub(super) fn check(plan: &LogicalPlan, text_bytes: usize) -> Result<(), ComputeError> {
    let mut growth = Growth::default();
    let visited = plan.visit_with_subqueries(&mut growth);
    visited.map_err(|error| told(error, None))?;
    let value_bytes = growth.all * text_bytes.max(STORED_BYTES) as f64;
    if value_bytes <= MAX_VALUE_MIB * BYTES_PER_MIB {
        return Ok(());
    }
    let reason = format!(
        "it joins texts or lists with each other, and what comes of it again, so often that one value may have more than {MAX_VALUE_MIB} MiB: join \
         fewer, or in fewer steps"
    );
    Err(ComputeError::Sql { reason })
}

/// How many times as long as those of tables the values of a plan may be.
#[derive(Default)]
struct Growth {
    all: f64,
    /// Of every node that is being visited, outermost first.
    open: Vec<Below>,
}

/// What lies below a node.
struct Below {
    /// The most of what it reads.
    inputs: f64,
    /// Of all questions within it, each of which may read what it reads.
    within: f64,
}

impl<'n> TreeNodeVisitor<'n> for Growth {
    type Node = LogicalPlan;

    fn f_down(&mut self, _node: &'n LogicalPlan) -> Result<TreeNodeRecursion, DataFusionError> {
        self.open.push(Below {
            inputs: 1.0,
            within: 1.0,
        });
        Ok(TreeNodeRecursion::Continue)
    }

    fn f_up(&mut self, node: &'n LogicalPlan) -> Result<TreeNodeRecursion, DataFusionError> {
        let below = self.open.pop();
        let below = below.map_or(1.0, |below| below.inputs * below.within);
        let made = match node {
            // What grows in one turn grows in each.
            LogicalPlan::RecursiveQuery(_) if below > 1.0 => f64::INFINITY,
            _ => below * of_node(node)?,
        };
        self.all = self.all.max(made);
        let own = if hands_on(node) { below } else { made };
        match (self.open.last_mut(), node) {
            (Some(above), LogicalPlan::Subquery(_)) => above.within *= own,
            (Some(above), _) => above.inputs = above.inputs.max(own),
            (None, _) => {}
        }
        Ok(TreeNodeRecursion::Continue)
    }
}

/// Does a node hand on what it reads as it is, whatever it computes to choose or to order it?
fn hands_on(node: &LogicalPlan) -> bool {
    matches!(
        node,
        LogicalPlan::Filter(_)
            | LogicalPlan::Sort(_)
            | LogicalPlan::Join(_)
            | LogicalPlan::Limit(_)
            | LogicalPlan::SubqueryAlias(_)
    )
}

/// The most that an expression of a node makes of what the node reads.
fn of_node(node: &LogicalPlan) -> Result<f64, DataFusionError> {
    let mut most = 1.0f64;
    node.apply_expressions(|expr| {
        most = most.max(of_expression(expr)?);
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(most)
}

/// How many times as long as one of its columns its value may be: written texts are told by the length of the question.
fn of_expression(expr: &Expr) -> Result<f64, DataFusionError> {
    let (mut leaves, mut is_joining, mut factor) = (0u32, false, 1.0);
    expr.apply(|part| {
        match part {
            Expr::Column(_)
            | Expr::OuterReferenceColumn(..)
            | Expr::ScalarSubquery(_)
            | Expr::LambdaVariable(_) => leaves += 1,
            Expr::BinaryExpr(both) => is_joining |= both.op == Operator::StringConcat,
            Expr::ScalarFunction(call) => {
                is_joining |= JOINING.contains(&call.func.name());
                if call.func.name() == DOUBLING {
                    factor *= 2.0;
                }
            }
            Expr::AggregateFunction(call) if GATHERING.contains(&call.func.name()) => {
                factor *= GATHERED;
            }
            Expr::WindowFunction(call) if GATHERING.contains(&call.fun.name()) => {
                factor *= GATHERED;
            }
            _ => {}
        }
        Ok(TreeNodeRecursion::Continue)
    })?;
    let joined = if is_joining { leaves.max(1) } else { 1 };
    Ok(factor * f64::from(joined))
}
