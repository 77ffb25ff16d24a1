//! Answers as streams of Flight, and errors as its statuses.

use std::pin::Pin;

use arrow_flight::FlightData;
use arrow_flight::encode::FlightDataEncoderBuilder;
use arrow_flight::error::FlightError;
use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::SchemaRef;
use futures::{Stream, StreamExt as _, TryStreamExt as _, stream};
use tonic::Status;

use crate::sql::Rows;
use crate::{ComputeError, ErrorClass};

/// What a call answers with.
pub(super) type Answer = Pin<Box<dyn Stream<Item = Result<FlightData, Status>> + Send>>;

/// Rows as they come, no more than so many.
pub(super) fn rows(rows: Rows, max_rows: u64) -> Answer {
    let schema = rows.schema().clone();
    let batches = stream::try_unfold((rows, 0), move |(mut rows, count)| async move {
        let next = rows.next().await.map_err(|error| status(&error))?;
        let Some(batch) = next else {
            return Ok(None);
        };
        let count = count + batch.num_rows() as u64;
        if count > max_rows {
            return Err(Status::out_of_range(format!(
                "the answer has more than {max_rows} rows, the limit of this server; ask for less"
            )));
        }
        Ok(Some((batch, (rows, count))))
    });
    encoded(
        schema,
        batches.map_err(|status| FlightError::Tonic(Box::new(status))),
    )
}

/// One batch.
pub(super) fn batch(batch: RecordBatch) -> Answer {
    encoded(batch.schema(), stream::once(async { Ok(batch) }))
}

fn encoded(
    schema: SchemaRef,
    batches: impl Stream<Item = Result<RecordBatch, FlightError>> + Send + 'static,
) -> Answer {
    let encoder = FlightDataEncoderBuilder::new().with_schema(schema);
    encoder.build(batches).map_err(Status::from).boxed()
}

/// An error by whose turn it is.
pub(super) fn status(error: &ComputeError) -> Status {
    let text = error.to_string();
    match error {
        ComputeError::QueryTime { .. } => Status::deadline_exceeded(text),
        ComputeError::QueryMemory { .. } => Status::resource_exhausted(text),
        _ => match error.class() {
            ErrorClass::NotFound => Status::not_found(text),
            ErrorClass::BadRequest => Status::invalid_argument(text),
            ErrorClass::Retryable => Status::unavailable(text),
            ErrorClass::Internal => {
                tracing::error!(error = %text, "a question failed");
                Status::internal(text)
            }
        },
    }
}
