//! What a Kafka client says of itself: its log lines go to tracing, its last trouble is kept for error messages.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rdkafka::ClientContext;
use rdkafka::config::RDKafkaLogLevel;
use rdkafka::consumer::ConsumerContext;
use rdkafka::error::{KafkaError, RDKafkaErrorCode};

use crate::KafkaFailure;
use crate::error::is_lasting_code;

/// Longest text that is kept of a trouble, characters.
const MAX_NOTED_CHARS: usize = 300;

/// Shared by one client and those who use it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Context {
    trouble: Arc<Mutex<Option<Trouble>>>,
}

#[derive(Debug, Clone)]
struct Trouble {
    code: Option<RDKafkaErrorCode>,
    text: String,
}

impl Context {
    fn trouble(&self) -> MutexGuard<'_, Option<Trouble>> {
        // The value is replaced whole, so a panic elsewhere cannot leave it half written.
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Did the client complain since it was last known to be well?
    pub(crate) fn is_troubled(&self) -> bool {
        self.trouble().is_some()
    }

    /// The brokers answer.
    pub(crate) fn well(&self) {
        *self.trouble() = None;
    }

    /// An error of a call, with what the client said before; a refused login shows as that and not as a lost connection.
    pub(crate) fn failure(&self, step: &'static str, error: KafkaError) -> KafkaFailure {
        let trouble = self.trouble().clone();
        let lasting = trouble
            .as_ref()
            .and_then(|trouble| trouble.code)
            .filter(|&code| is_lasting_code(code));
        KafkaFailure::Client {
            step,
            source: lasting.map_or(error, KafkaError::Global),
            noted: trouble.map(|trouble| trouble.text),
        }
    }

    /// A call that took too long.
    pub(crate) fn slow(&self, step: &'static str, limit: Duration) -> KafkaFailure {
        KafkaFailure::Slow {
            step,
            limit_ms: limit.as_millis(),
            noted: self.trouble().clone().map(|trouble| trouble.text),
        }
    }
}

impl ClientContext for Context {
    fn log(&self, level: RDKafkaLogLevel, facility: &str, text: &str) {
        match level {
            RDKafkaLogLevel::Emerg | RDKafkaLogLevel::Alert | RDKafkaLogLevel::Critical => {
                tracing::error!(target: "kafka", facility, "{text}");
            }
            // Each try to connect to a broker that is down is an "error": not more than a remark here, since the call
            // that needed the broker reports it.
            RDKafkaLogLevel::Error
            | RDKafkaLogLevel::Warning
            | RDKafkaLogLevel::Notice
            | RDKafkaLogLevel::Info
            | RDKafkaLogLevel::Debug => tracing::debug!(target: "kafka", facility, "{text}"),
        }
    }

    fn error(&self, error: KafkaError, reason: &str) {
        // A consumer is told of these in its queue; they are no trouble.
        if matches!(error, KafkaError::PartitionEOF(_)) || is_end(&error) {
            return;
        }
        tracing::debug!(target: "kafka", %error, "{reason}");
        let code = if is_certificate_refused(reason) {
            Some(RDKafkaErrorCode::SSL)
        } else {
            error.rdkafka_error_code()
        };
        *self.trouble() = Some(Trouble {
            code,
            text: reason.chars().take(MAX_NOTED_CHARS).collect(),
        });
    }
}

/// In TLS 1.3 a broker that does not want this client's certificate says so after the handshake: the client takes that for
/// a lost connection, only its words tell the difference.
fn is_certificate_refused(reason: &str) -> bool {
    reason.contains("SSL routines")
        && reason.contains("alert")
        && ["certificate", "unknown ca"]
            .iter()
            .any(|what| reason.contains(what))
}

fn is_end(error: &KafkaError) -> bool {
    error.rdkafka_error_code() == Some(RDKafkaErrorCode::PartitionEOF)
}

impl ConsumerContext for Context {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_certificate_is_no_lost_connection() {
        let context = Context::default();
        let lost = || KafkaError::Global(RDKafkaErrorCode::BrokerTransportFailure);
        context.error(lost(), "Receive failed: connection reset, certificate");
        assert!(context.failure("looking", lost()).is_retryable());
        let text = "Receive failed: error:0A00045C:SSL routines::tlsv13 alert certificate required";
        context.error(lost(), text);
        assert!(!context.failure("looking", lost()).is_retryable());
    }

    #[test]
    fn a_refused_login_is_named_instead_of_the_lost_connection() {
        let context = Context::default();
        let lost = || KafkaError::MetadataFetch(RDKafkaErrorCode::BrokerTransportFailure);
        assert!(context.failure("looking", lost()).is_retryable());
        context.error(
            KafkaError::Global(RDKafkaErrorCode::Authentication),
            "wrong password for bob",
        );
        let failure = context.failure("looking", lost());
        assert!(!failure.is_retryable());
        assert!(
            failure.to_string().contains("wrong password for bob"),
            "{failure}"
        );
        context.well();
        assert!(context.failure("looking", lost()).is_retryable());
    }
}
