//! Pieces of a question worked on: by this process, or as a query whose every part is some of them.
//!
//! In process no query is planned: what a plan would do is known, and planning takes longer than a point's answer.

use std::collections::BTreeSet;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId};
use cube::Values;
use datafusion::arrow::array::{Array as _, AsArray as _, RecordBatch};

use super::accumulator::Accumulated;
use super::piece_queue;
use super::question::{PIECE_BYTES, Piece, Question};
use super::task::{Task, Worker};
use crate::scan;
use crate::session::QueryContext;
use crate::{ComputeError, Engine};

/// Most pieces that those of large maps are cut into when they are dealt out: each is some hundred bytes of a query. Of more, which are many
/// steps, whole maps are dealt out, and whoever reads them cuts them.
const MOST_CUTS: usize = 1 << 12;

/// What some pieces of a question come to. None where executors did not find along time what these pieces were planned for: the
/// question is to be asked of fields then.
pub(super) async fn run(
    engine: &Engine,
    question: Question,
    values: Option<Values>,
    pieces: Vec<Piece>,
) -> Result<Option<Accumulated>, ComputeError> {
    if engine.is_distributed() {
        distributed(engine, question, pieces).await
    } else {
        in_process(engine, question, values, pieces).await.map(Some)
    }
}

/// The version along time. A cluster, whose executors can do without it, is asked for fields where its cube cannot be read: others land
/// in it and clean it up meanwhile.
pub(super) async fn opened(
    engine: &Engine,
    manifest: &Manifest,
    id: &ManifestId,
) -> Result<Option<Values>, ComputeError> {
    match engine.values(manifest, id).await {
        Err(error) if engine.is_distributed() && !error.is_retryable() => {
            tracing::warn!(version = %id, %error, "its cube cannot be read: its fields are");
            Ok(None)
        }
        opened => opened.map(Some),
    }
}

/// Fields are always there.
pub(super) fn changed_meanwhile() -> ComputeError {
    ComputeError::inconsistent(
        "statistics",
        "executors did not find the fields of the version",
    )
}

async fn in_process(
    engine: &Engine,
    question: Question,
    values: Option<Values>,
    pieces: Vec<Piece>,
) -> Result<Accumulated, ComputeError> {
    let worker = Worker::new(engine.objects(), question, values).await?;
    // One is read while the others are reduced; each is held as it was stored, and as it is reduced.
    let held = engine.memory_bytes() / (4 * PIECE_BYTES as usize);
    let at_once = (engine.partitions().get() + 1).min(held.max(1));
    let reduce = async move |piece| worker.reduce(piece).await;
    piece_queue::reduced(reduce, pieces, at_once).await
}

async fn distributed(
    engine: &Engine,
    question: Question,
    pieces: Vec<Piece>,
) -> Result<Option<Accumulated>, ComputeError> {
    let keys: BTreeSet<ObjectKey> = pieces.iter().map(|piece| piece.key.clone()).collect();
    let keys: Vec<&ObjectKey> = keys.iter().collect();
    let cut_count: usize = pieces.iter().map(Piece::cut_count).sum();
    let pieces = if cut_count <= MOST_CUTS {
        pieces.into_iter().flat_map(Piece::cut).collect()
    } else {
        pieces
    };
    let all = Task { question, pieces };
    // A cluster's scheduler knows its executors, and deals pieces out to them when it plans.
    let tasks = if engine.has_dealer() {
        vec![all]
    } else {
        all.dealt(engine.partitions().get())
    };
    let sql = sql(&tasks);
    let job = Digest::of_json(&("statistics", &sql));
    let answered = async {
        let batches = engine.answer(job, |context| ask(context, &sql)).await?;
        only_part(&batches)
    };
    let answered = scan::caught(Box::pin(answered)).await;
    scan::or_damaged(engine.store(), &keys, answered).await
}

/// The question: each task a part of its own, which gives nothing but what it accumulated to the one that merges them.
fn sql(tasks: &[Task]) -> String {
    let quoted = |task: &Task| task.text().replace('\'', "''");
    let part = |task: &Task| format!("SELECT accumulate('{}') AS part", quoted(task));
    let parts: Vec<String> = tasks.iter().map(part).collect();
    format!(
        "SELECT merge_accumulated(part) FROM ({})",
        parts.join(" UNION ALL ")
    )
}

async fn ask(context: QueryContext, sql: &str) -> Result<Vec<RecordBatch>, ComputeError> {
    let failed = || ComputeError::engine("statistics");
    let query = context.sql(sql).await.map_err(failed())?;
    query.collect().await.map_err(failed())
}

/// The one row of an answer; none if it is NULL.
fn only_part(batches: &[RecordBatch]) -> Result<Option<Accumulated>, ComputeError> {
    let mut rows = batches.iter().filter(|batch| batch.num_rows() > 0);
    match (rows.next(), rows.next()) {
        (Some(batch), None) if batch.num_rows() == 1 => {
            let part = batch.column(0).as_binary::<i32>();
            let part = part
                .is_valid(0)
                .then(|| Accumulated::of_bytes(part.value(0)));
            part.transpose()
        }
        _ => Err(ComputeError::inconsistent(
            "statistics",
            "the engine gave no single row",
        )),
    }
}

#[cfg(test)]
pub(super) mod tests;
