//! What can go wrong with stored observations, and whose turn it is then.

use std::time::Duration;

use contract::ContractError;
use contract::product::ProductId;
use storage::StorageError;
use tokio_postgres::error::SqlState;

/// A call that gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum ObservationError {
    /// An observation or a question that is not valid.
    #[error(transparent)]
    Contract(#[from] ContractError),
    /// The object store or the event log failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A setting that cannot be used, or a database that is not set up.
    #[error("observations cannot be kept: {reason}")]
    Setup {
        /// What is wrong and what to do.
        reason: String,
    },
    /// The database refused a statement or broke off.
    #[error("database, {action}: {}", words(.source))]
    Database {
        /// What was being done.
        action: &'static str,
        /// Its own words.
        source: tokio_postgres::Error,
    },
    /// No connection to the database is to be had now.
    #[error("no connection to the database: {reason}")]
    Connection {
        /// Why.
        reason: String,
    },
    /// The database did not answer in time.
    #[error("database, {action}: no answer within {} s", .limit.as_secs())]
    Slow {
        /// What was being done.
        action: &'static str,
        /// How long was waited.
        limit: Duration,
    },
    /// The database's tables could not be brought to this version.
    #[error("database tables: {source}")]
    Migration {
        /// Why.
        source: Box<refinery::Error>,
    },
    /// Something stored does not hold what it must.
    #[error("{object} is damaged: {reason}")]
    Damaged {
        /// The object.
        object: String,
        /// How.
        reason: String,
    },
    /// Other writers kept taking the next number of a dataset's index.
    #[error("gave up on dataset {dataset} after {attempts} lost races for its next index")]
    Contended {
        /// Dataset.
        dataset: ProductId,
        /// How many.
        attempts: usize,
    },
}

/// Whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorClass {
    /// The question or the observation makes no sense as it is.
    BadRequest,
    /// The same call may succeed later.
    Retryable,
    /// A fault of the program, its settings or of what is stored.
    Internal,
}

impl ObservationError {
    /// Whose turn it is; a server maps this to its status.
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Contract(_) => ErrorClass::BadRequest,
            Self::Storage(e) if e.is_retryable() => ErrorClass::Retryable,
            Self::Connection { .. } | Self::Slow { .. } | Self::Contended { .. } => {
                ErrorClass::Retryable
            }
            Self::Database { source, .. } => database_class(source),
            Self::Migration { source } => migration_class(source),
            Self::Storage(_) | Self::Setup { .. } | Self::Damaged { .. } => ErrorClass::Internal,
        }
    }

    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        self.class() == ErrorClass::Retryable
    }

    pub(crate) fn database(action: &'static str) -> impl FnOnce(tokio_postgres::Error) -> Self {
        move |source| Self::Database { action, source }
    }

    pub(crate) fn setup(reason: impl std::fmt::Display) -> Self {
        Self::Setup {
            reason: reason.to_string(),
        }
    }

    pub(crate) fn damaged(object: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Damaged {
            object: object.into(),
            reason: reason.to_string(),
        }
    }
}

/// A failed statement by its SQLSTATE class; without one it is the connection that failed.
fn database_class(error: &tokio_postgres::Error) -> ErrorClass {
    let Some(code) = error.code().map(SqlState::code) else {
        return ErrorClass::Retryable;
    };
    match code.get(..2) {
        // Data and integrity: the observation itself cannot be stored.
        Some("22" | "23") => ErrorClass::BadRequest,
        // Connection, rollback, resources, locks, operator, system, and a read-only stand-by.
        Some("08" | "25" | "40" | "53" | "55" | "57" | "58") => ErrorClass::Retryable,
        _ => ErrorClass::Internal,
    }
}

fn migration_class(error: &refinery::Error) -> ErrorClass {
    let source = std::error::Error::source(error);
    match source.and_then(|e| e.downcast_ref::<tokio_postgres::Error>()) {
        Some(database) => database_class(database),
        None => ErrorClass::Internal,
    }
}

/// The database's own words: its library says only of which kind an error is.
pub(crate) fn words(error: &tokio_postgres::Error) -> String {
    let source = std::error::Error::source(error);
    match (error.as_db_error(), source) {
        (Some(said), _) => format!("{} (SQLSTATE {})", said.message(), said.code().code()),
        (None, Some(source)) => format!("{error}: {source}"),
        (None, None) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_race_may_be_won_later_and_a_bad_setting_may_not() {
        let contended = ObservationError::Contended {
            dataset: "buoys".parse().unwrap(),
            attempts: 9,
        };
        assert!(contended.is_retryable());
        assert_eq!(ObservationError::setup("no").class(), ErrorClass::Internal);
        let bad = ContractError::invalid("limit", "0", "1 to 10000");
        assert_eq!(ObservationError::from(bad).class(), ErrorClass::BadRequest);
    }
}
