//! A question to a cluster is cut into tasks where its executors are known: by the scheduler, when it plans.
//!
//! A client sends one task with all pieces in it. Merged in any order, what parts of it accumulate is the same bits, so
//! that a plan which nobody cuts has the same answer.
//!
//! Tasks are rows of a table in memory, a partition each. Of such a leaf Ballista hands out the partition that is worked on, and
//! of no plan of ours as a leaf would it know how; as branches of a `UNION ALL` each task came with the texts of all.

use std::sync::Arc;

use datafusion::arrow::array::{RecordBatch, StringArray};
use datafusion::arrow::datatypes::{DataType, Field, Schema};
use datafusion::common::tree_node::{Transformed, TreeNode as _};
use datafusion::common::{Column, DataFusionError, Result, ScalarValue};
use datafusion::config::ConfigOptions;
use datafusion::datasource::{MemTable, provider_as_source};
use datafusion::logical_expr::{Expr, LogicalPlan, LogicalPlanBuilder, Projection, SubqueryAlias};
use datafusion::optimizer::AnalyzerRule;

use crate::functions::ACCUMULATE;
use crate::reduce::task::Task;

/// Places that tasks are made for however few there are: more executors may come while a query waits.
const LEAST_PLACES: usize = 4;
/// The table of tasks, and its one column.
const TASKS: &str = "tasks";
const TASK: &str = "task";

/// Cuts the one task of a question into rows of a table, by the parts that a query is planned in.
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
            let of_each = of_each(of_all, table(&tasks)?)?;
            Ok(Some(LogicalPlan::Projection(of_each)))
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

/// The texts of tasks, a partition each.
fn table(tasks: &[Task]) -> Result<LogicalPlan> {
    let schema = Arc::new(Schema::new(vec![Field::new(TASK, DataType::Utf8, false)]));
    let row = |task: &Task| {
        let text = Arc::new(StringArray::from(vec![task.text()]));
        Ok(vec![RecordBatch::try_new(Arc::clone(&schema), vec![text])?])
    };
    let partitions = tasks.iter().map(row).collect::<Result<_>>()?;
    let table = MemTable::try_new(schema, partitions)?;
    LogicalPlanBuilder::scan(TASKS, provider_as_source(Arc::new(table)), None)?.build()
}

/// The same projection of each of these tasks.
fn of_each(of_all: &Projection, tasks: LogicalPlan) -> Result<Projection> {
    let other = |expression: Expr| {
        let Expr::Literal(ScalarValue::Utf8(_), _) = expression else {
            return Ok(Transformed::no(expression));
        };
        let task = Column::new(Some(TASKS), TASK);
        Ok(Transformed::yes(Expr::Column(task)))
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
    Projection::try_new(named.collect(), Arc::new(tasks))
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;

    use ballista_core::JobId;
    use ballista_scheduler::planner::{DefaultDistributedPlanner, DistributedPlanner as _};
    use ballista_scheduler::state::task_builder::restrict_plan_to_partitions;
    use datafusion::arrow::array::AsArray as _;
    use datafusion::datasource::memory::MemorySourceConfig;
    use datafusion::datasource::source::DataSourceExec;
    use datafusion::physical_plan::{ExecutionPlan, ExecutionPlanProperties as _, displayable};
    use datafusion::prelude::SessionContext;
    use storage::Store;

    use super::*;
    use crate::reduce::{sql_of, task_of_pieces};
    use crate::{Objects, state};

    const PLACES: usize = 4;

    /// Stages of a question, as a scheduler plans them.
    async fn stages(task: &Task) -> Vec<Arc<dyn ExecutionPlan>> {
        let objects = Objects::of(&Store::memory());
        let runtime = state::runtime(&objects, state::MEMORY_BYTES).unwrap();
        let config = state::ballista_config(NonZeroUsize::new(PLACES).unwrap());
        let mut state = state::session_state(config, runtime, &objects).unwrap();
        state.add_analyzer_rule(Arc::new(Dealing));
        let context = SessionContext::new_with_state(state);
        let query = context.sql(&sql_of(task)).await.unwrap();
        let plan = query.create_physical_plan().await.unwrap();
        let job = JobId::new("job".to_owned());
        let state = context.state();
        let mut planner = DefaultDistributedPlanner::new();
        let stages = planner.plan_query_stages(&job, plan, state.config_options());
        let stages = stages.unwrap().into_iter();
        stages
            .map(|stage| stage as Arc<dyn ExecutionPlan>)
            .collect()
    }

    /// Texts of tasks in a plan, wherever they are.
    fn texts(plan: &Arc<dyn ExecutionPlan>) -> Vec<String> {
        let mut found = vec![];
        if let Some(source) = plan.downcast_ref::<DataSourceExec>() {
            let source: &dyn std::any::Any = source.data_source().as_ref();
            let rows = source.downcast_ref::<MemorySourceConfig>().unwrap();
            for batch in rows.partitions().iter().flatten() {
                let tasks = batch.column(0).as_string::<i32>();
                found.extend(tasks.iter().flatten().map(ToOwned::to_owned));
            }
        }
        found.extend(plan.children().into_iter().flat_map(texts));
        found
    }

    #[tokio::test]
    async fn each_task_comes_with_its_own_text_alone() {
        let task = task_of_pieces(40);
        let expected: Vec<String> = task.clone().dealt(PLACES).iter().map(Task::text).collect();
        assert!(expected.len() > PLACES, "{}", expected.len());
        let stages = stages(&task).await;
        assert_eq!(stages.len(), 2, "{stages:?}");
        let count = stages[0].output_partitioning().partition_count();
        assert_eq!(count, expected.len());
        for (at, text) in expected.iter().enumerate() {
            let own = restrict_plan_to_partitions(Arc::clone(&stages[0]), &[at]).unwrap();
            assert_eq!(own.output_partitioning().partition_count(), 1);
            assert_eq!(texts(&own), [text.as_str()]);
            let shown = displayable(own.as_ref()).indent(true).to_string();
            // The text is nowhere else in it.
            assert!(!shown.contains("pieces"), "{shown}");
            assert_eq!(shown.matches("AsyncFuncExec").count(), 1, "{shown}");
        }
        let last = displayable(stages[1].as_ref()).indent(true).to_string();
        assert!(!last.contains("AsyncFuncExec"), "{last}");
    }

    #[tokio::test]
    async fn a_question_of_one_piece_is_left_as_it_is() {
        let stages = stages(&task_of_pieces(1)).await;
        let first = displayable(stages[0].as_ref()).indent(true).to_string();
        assert!(!first.contains("DataSourceExec"), "{first}");
        assert_eq!(stages[0].output_partitioning().partition_count(), 1);
    }
}
