//! Can a service do its work now? Asked of each part, with a time limit.

use std::future::Future;
use std::time::Duration;

use async_trait::async_trait;
use serde::Serialize;

/// A part that needs longer than this to say that it is there is as good as away.
const PART_LIMIT: Duration = Duration::from_secs(2);

/// One part that a service needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Part {
    /// Name for operators.
    pub name: &'static str,
    /// Does it work?
    pub ok: bool,
    /// Can the service not do without it?
    pub required: bool,
    /// What is wrong, or what there is; no secrets and no addresses.
    pub detail: String,
}

/// All parts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Do all required parts work?
    pub ready: bool,
    /// Each part.
    pub checks: Vec<Part>,
}

/// Whoever can say so.
#[async_trait]
pub trait Readiness: Send + Sync + 'static {
    /// Every part, asked now.
    async fn parts(&self) -> Vec<Part>;
}

impl Part {
    /// Asks a part that the service cannot do without. The error goes to the log; who asks over HTTP reads only that
    /// there is one, since errors name folders and servers.
    pub async fn required<E: std::fmt::Display>(
        name: &'static str,
        asked: impl Future<Output = Result<String, E>>,
    ) -> Self {
        let (ok, detail) = match tokio::time::timeout(PART_LIMIT, asked).await {
            Ok(Ok(detail)) => (true, detail),
            Ok(Err(error)) => {
                tracing::warn!(part = name, %error, "not ready");
                (false, "it does not work now; the log says why".to_owned())
            }
            Err(_elapsed) => (
                false,
                format!("no answer within {} s", PART_LIMIT.as_secs()),
            ),
        };
        Self {
            name,
            ok,
            required: true,
            detail,
        }
    }
}

impl Report {
    /// The report on some parts.
    pub fn of(checks: Vec<Part>) -> Self {
        Self {
            ready: checks.iter().all(|part| part.ok || !part.required),
            checks,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_part_that_does_not_answer_is_away() {
        let silent = std::future::pending::<Result<String, String>>();
        let part = Part::required("store", silent).await;
        assert!(!part.ok && part.detail.contains("2 s"), "{part:?}");
        assert!(!Report::of(vec![part]).ready);
    }

    #[tokio::test]
    async fn errors_are_not_shown_to_who_asks() {
        let failing = async { Err::<String, _>("password hunter2 at 10.0.0.1") };
        let part = Part::required("database", failing).await;
        assert!(!part.ok && !part.detail.contains("hunter2"), "{part:?}");
    }
}
