//! A question under way: its rows as they come, until its time is over or nobody wants them.

use std::time::Duration;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::execution::SendableRecordBatchStream;
use futures::StreamExt as _;
use tokio::sync::{OwnedSemaphorePermit, mpsc};
use tokio::task::JoinHandle;
use tokio::time::{Instant, timeout_at};

use super::limits::SqlLimits;
use super::told::{overdue, told};
use crate::ComputeError;

/// Batches that wait for who asked.
const WAITING: usize = 2;
/// How long one that ought to have ended is waited for: what computes without a pause hears of its end late.
const GRACE: Duration = Duration::from_secs(1);

/// What is let go of when a question's work ends, whoever still holds its rows.
pub(crate) type Turn = Option<OwnedSemaphorePermit>;

/// Rows of an answer, batch by batch. Dropped, it ends the question.
#[derive(Debug)]
pub struct Rows {
    schema: SchemaRef,
    batches: mpsc::Receiver<RecordBatch>,
    work: JoinHandle<Result<(), ComputeError>>,
    deadline: Instant,
    limits: SqlLimits,
    is_over: bool,
}

impl Rows {
    pub(super) fn start(
        schema: SchemaRef,
        stream: SendableRecordBatchStream,
        deadline: Instant,
        limits: SqlLimits,
        turn: Turn,
    ) -> Self {
        let (sender, batches) = mpsc::channel(WAITING);
        let work = tokio::spawn(async move {
            let _turn = turn;
            let running = hand_over(stream, sender, limits);
            let ended = timeout_at(deadline, running).await;
            ended.unwrap_or_else(|_elapsed| Err(overdue(limits)))
        });
        Self {
            schema,
            batches,
            work,
            deadline,
            limits,
            is_over: false,
        }
    }

    /// Columns of the answer.
    pub fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// The next rows; none at the end.
    ///
    /// # Errors
    /// What was read is damaged; the question needs more time or memory than it may have.
    pub async fn next(&mut self) -> Result<Option<RecordBatch>, ComputeError> {
        if self.is_over {
            return Ok(None);
        }
        let next = timeout_at(self.deadline + GRACE, self.batches.recv()).await;
        if let Ok(Some(batch)) = next {
            return Ok(Some(batch));
        }
        self.is_over = true;
        if next.is_err() {
            return Err(overdue(self.limits));
        }
        // Why there are no more, the work says: an end that nobody saw must not look like one.
        let ended = (&mut self.work).await;
        ended.map_err(|e| ComputeError::inconsistent("the query engine", e))??;
        Ok(None)
    }
}

impl Drop for Rows {
    fn drop(&mut self) {
        self.work.abort();
    }
}

async fn hand_over(
    mut stream: SendableRecordBatchStream,
    sender: mpsc::Sender<RecordBatch>,
    limits: SqlLimits,
) -> Result<(), ComputeError> {
    while let Some(batch) = stream.next().await {
        let batch = batch.map_err(|error| told(error, Some(limits)))?;
        if sender.send(batch).await.is_err() {
            break;
        }
    }
    Ok(())
}
