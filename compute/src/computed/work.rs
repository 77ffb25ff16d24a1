//! Tasks handed to the engine: their texts as rows of a small table, cut into parts that executors work on, and what they
//! answer in the order of tasks.

use contract::digest::Digest;
use datafusion::arrow::array::{Array as _, AsArray as _};
use datafusion::logical_expr::{LogicalPlanBuilder, lit};
use datafusion::prelude::{DataFrame, col};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::job::Job;
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// Most parts that tasks are cut into: each is a task of a scheduler. More executors than that have nothing to do.
const MOST_PARTS: usize = 128;

/// Has a function of [`crate::functions`] work on every task. Answers come in any order.
pub(super) async fn on_engine<Task, Made>(
    engine: &Engine,
    function: &'static str,
    job: &Job,
    tasks: &[Task],
) -> Result<Vec<Made>, ComputeError>
where
    Task: Serialize + Sync,
    Made: DeserializeOwned,
{
    if tasks.is_empty() {
        return Ok(vec![]);
    }
    let job = text(job)?;
    let texts = tasks.iter().map(text).collect::<Result<Vec<_>, _>>()?;
    let name = Digest::of_json(&(function, &job, &texts));
    let ask = |context: QueryContext| {
        let (job, texts) = (&job, &texts);
        async move {
            let failed = || ComputeError::engine("computing a product");
            let query = query(&context, function, job, texts).map_err(failed())?;
            let batches = query.collect().await.map_err(failed())?;
            let mut made = vec![];
            for batch in &batches {
                let answers = batch.column(0).as_string_opt::<i32>();
                let answers = answers.ok_or_else(|| inconsistent("an answer is no text"))?;
                for row in 0..answers.len() {
                    let answer = serde_json::from_str(answers.value(row));
                    made.push(answer.map_err(inconsistent)?);
                }
            }
            if made.len() != texts.len() {
                let reason = format!("{} answers to {} tasks", made.len(), texts.len());
                return Err(inconsistent(reason));
            }
            Ok(made)
        }
    };
    Box::pin(engine.answer(name, ask)).await
}

/// `SELECT function(job, task) FROM (VALUES ...)`, a part each.
fn query(
    context: &QueryContext,
    function: &str,
    job: &str,
    tasks: &[String],
) -> Result<DataFrame, datafusion::error::DataFusionError> {
    let state = context.state();
    let function = state
        .scalar_functions()
        .get(function)
        .cloned()
        .ok_or_else(|| {
            datafusion::error::DataFusionError::Plan(format!("{function} is not registered"))
        })?;
    let part = |tasks: &[String]| {
        let rows = tasks.iter().map(|task| vec![lit(task.as_str())]).collect();
        let call = function.call(vec![lit(job), col("column1")]).alias("made");
        LogicalPlanBuilder::values(rows)?.project([call])
    };
    let mut parts = tasks.chunks(tasks.len().div_ceil(MOST_PARTS));
    let mut all = part(parts.next().unwrap_or_default())?;
    for rest in parts {
        all = all.union(part(rest)?.build()?)?;
    }
    Ok(DataFrame::new(state, all.build()?))
}

fn text<T: Serialize>(value: &T) -> Result<String, ComputeError> {
    serde_json::to_string(value).map_err(inconsistent)
}

fn inconsistent(reason: impl std::fmt::Display) -> ComputeError {
    ComputeError::inconsistent("a computed product", reason)
}
