//! What can go wrong with Kafka, and which of it may pass.

use std::path::PathBuf;

use rdkafka::error::{KafkaError, RDKafkaErrorCode};
use storage::StorageError;

/// A failed step of the event log on Kafka.
#[derive(Debug, thiserror::Error)]
pub enum KafkaFailure {
    /// The client or a broker refused or lost something.
    #[error("{step}: {source}{}", noted.as_ref().map_or_else(String::new, |noted| format!(" ({noted})")))]
    Client {
        /// What was being done.
        step: &'static str,
        source: KafkaError,
        /// What the client said last about its brokers.
        noted: Option<String>,
    },
    /// No answer in time.
    #[error("{step}: no answer within {limit_ms} ms{}", noted.as_ref().map_or_else(String::new, |noted| format!(" ({noted})")))]
    Slow {
        step: &'static str,
        limit_ms: u128,
        noted: Option<String>,
    },
    /// The client no longer knows any broker.
    #[error("the client has lost all brokers: another one is needed")]
    Lost,
    /// A call follows one that failed or was given up.
    #[error("this reader failed before: join again")]
    Spent,
    /// The process is ending.
    #[error("{step}: the process is ending")]
    Ending { step: &'static str },
    /// A file of the settings cannot be used.
    #[error("{flag}: {path:?} cannot be used: {reason}")]
    File {
        flag: &'static str,
        path: PathBuf,
        reason: String,
    },
    /// Settings that do not go together.
    #[error("{0}")]
    Settings(&'static str),
    /// A topic is missing or made otherwise than it must be.
    #[error("{0}")]
    Topic(String),
}

impl KafkaFailure {
    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Client { source, .. } => !is_lasting(source),
            Self::Slow { .. } | Self::Lost | Self::Spent | Self::Ending { .. } => true,
            Self::File { .. } | Self::Settings(_) | Self::Topic(_) => false,
        }
    }

    /// Was this member taken out of its group, or left behind by it?
    pub(crate) fn is_left_behind(&self) -> bool {
        let Self::Client { source, .. } = self else {
            return false;
        };
        matches!(
            source.rdkafka_error_code(),
            Some(
                RDKafkaErrorCode::IllegalGeneration
                    | RDKafkaErrorCode::UnknownMemberId
                    | RDKafkaErrorCode::RebalanceInProgress
            )
        )
    }

    /// Was there no answer for as long as the client waits? It may have nobody left to ask.
    pub(crate) fn is_out_of_time(&self) -> bool {
        match self {
            Self::Slow { .. } | Self::Lost => true,
            Self::Client { source, .. } => matches!(
                source.rdkafka_error_code(),
                Some(
                    RDKafkaErrorCode::MessageTimedOut
                        | RDKafkaErrorCode::OperationTimedOut
                        | RDKafkaErrorCode::BrokerTransportFailure
                        | RDKafkaErrorCode::AllBrokersDown
                )
            ),
            Self::Spent
            | Self::Ending { .. }
            | Self::File { .. }
            | Self::Settings(_)
            | Self::Topic(_) => false,
        }
    }

    /// The same in the words of the event log's trait.
    pub(crate) fn of_log(self, servers: &str) -> StorageError {
        if self.is_retryable() {
            StorageError::log(servers, self)
        } else {
            // Where no server is named, that is what is wrong.
            let log = if servers.is_empty() {
                "on Kafka"
            } else {
                servers
            };
            StorageError::LogSetup {
                log: log.to_owned(),
                reason: self.to_string(),
            }
        }
    }
}

/// Is it something that somebody has to put right?
fn is_lasting(error: &KafkaError) -> bool {
    match error {
        KafkaError::ClientConfig(..) | KafkaError::ClientCreation(_) | KafkaError::Nul(_) => true,
        _ => error.rdkafka_error_code().is_some_and(is_lasting_code),
    }
}

/// A topic that is unknown is not among them: a broker that just came back may not have heard of it yet. A topic that is
/// really missing is told of when connecting.
pub(crate) fn is_lasting_code(code: RDKafkaErrorCode) -> bool {
    matches!(
        code,
        RDKafkaErrorCode::Authentication
            | RDKafkaErrorCode::SaslAuthenticationFailed
            | RDKafkaErrorCode::UnsupportedSASLMechanism
            | RDKafkaErrorCode::SSL
            | RDKafkaErrorCode::TopicAuthorizationFailed
            | RDKafkaErrorCode::GroupAuthorizationFailed
            | RDKafkaErrorCode::ClusterAuthorizationFailed
            | RDKafkaErrorCode::TransactionalIdAuthorizationFailed
            | RDKafkaErrorCode::MessageSizeTooLarge
            | RDKafkaErrorCode::UnsupportedVersion
            | RDKafkaErrorCode::InvalidTransactionTimeout
            | RDKafkaErrorCode::InvalidReplicationFactor
            | RDKafkaErrorCode::PolicyViolation
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(code: RDKafkaErrorCode) -> KafkaFailure {
        KafkaFailure::Client {
            step: "appending",
            source: KafkaError::MessageProduction(code),
            noted: Some("broker a:1 is down".to_owned()),
        }
    }

    #[test]
    fn a_lost_broker_may_come_back_and_a_refused_login_does_not_mend_itself() {
        assert!(client(RDKafkaErrorCode::BrokerTransportFailure).is_retryable());
        assert!(client(RDKafkaErrorCode::QueueFull).is_retryable());
        let refused = client(RDKafkaErrorCode::TopicAuthorizationFailed).of_log("a:1");
        assert!(matches!(refused, StorageError::LogSetup { .. }));
        assert!(refused.to_string().contains("broker a:1 is down"));
        let unnamed = KafkaFailure::Settings("--kafka is needed").of_log("");
        assert_eq!(
            unnamed.to_string(),
            "event log on Kafka cannot be used: --kafka is needed"
        );
    }
}
