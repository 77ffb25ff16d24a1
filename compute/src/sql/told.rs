//! Errors of the engine in our words: whose turn it is, and one reason.

use datafusion::arrow::error::ArrowError;
use datafusion::error::DataFusionError;

use super::limits::SqlLimits;
use crate::ComputeError;

/// Longest part of an engine's message that is told.
const MAX_MESSAGE: usize = 2000;

/// What the engine says of a text that it takes for an instant and that is none, in whatever rule it meets it.
const NO_INSTANT: &str = "Error parsing timestamp";

/// What a question is told whose time is over.
pub(super) fn overdue(limits: SqlLimits) -> ComputeError {
    ComputeError::QueryTime {
        limit_s: limits.time.as_secs_f64(),
    }
}

/// An error of the engine in our words: whose turn it is, and one reason.
pub(super) fn told(error: DataFusionError, limits: Option<SqlLimits>) -> ComputeError {
    let error = match own(error) {
        Ok(own) => return own,
        Err(error) => error,
    };
    match (error.find_root(), limits) {
        (DataFusionError::ResourcesExhausted(_), Some(limits)) => ComputeError::QueryMemory {
            limit_mib: limits.memory_bytes >> 20,
        },
        (
            DataFusionError::SQL(..)
            | DataFusionError::Plan(_)
            | DataFusionError::SchemaError(..)
            | DataFusionError::NotImplemented(_)
            | DataFusionError::Configuration(_)
            | DataFusionError::Execution(_)
            | DataFusionError::Collection(_)
            | DataFusionError::Diagnostic(..)
            | DataFusionError::ArrowError(..),
            _,
        ) => ComputeError::Sql {
            reason: in_words(&error),
        },
        _ => ComputeError::engine("answering SQL")(error),
    }
}

/// The error of ours that the engine passes on.
fn own(error: DataFusionError) -> Result<ComputeError, DataFusionError> {
    match error {
        DataFusionError::External(inner) => match inner.downcast::<ComputeError>() {
            Ok(own) => Ok(*own),
            Err(inner) => Err(DataFusionError::External(inner)),
        },
        DataFusionError::ArrowError(inner, trace) => match *inner {
            ArrowError::ExternalError(inner) => match inner.downcast::<DataFusionError>() {
                Ok(inner) => own(*inner),
                Err(inner) => own(DataFusionError::External(inner)),
            },
            other => Err(DataFusionError::ArrowError(Box::new(other), trace)),
        },
        DataFusionError::Context(what, inner) => {
            own(*inner).map_err(|inner| DataFusionError::Context(what, Box::new(inner)))
        }
        DataFusionError::Diagnostic(what, inner) => {
            own(*inner).map_err(|inner| DataFusionError::Diagnostic(what, Box::new(inner)))
        }
        other => Err(other),
    }
}

fn in_words(error: &DataFusionError) -> String {
    let text = match error.find_root() {
        DataFusionError::SQL(error, _trace) => error.to_string().replace("sql parser error: ", ""),
        DataFusionError::ArrowError(inner, _trace) if inner.to_string().contains(NO_INSTANT) => {
            let reason = inner.to_string().replace("Parser error: ", "");
            format!("{reason}; write '2000-07-01' or '2000-07-01T12:00:00Z'")
        }
        _ => error.strip_backtrace(),
    };
    match text.char_indices().nth(MAX_MESSAGE) {
        Some((end, _)) => text[..end].to_owned(),
        None => text,
    }
}
