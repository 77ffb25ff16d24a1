//! Log lines on standard error: for people, or a JSON object a line for collectors.

use std::io::{IsTerminal as _, stderr};

use tracing_subscriber::EnvFilter;

use crate::ServiceError;

/// What log lines look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// For people.
    Text,
    /// A JSON object a line.
    Json,
}

/// Starts logging; `filter` is a level or a list of `target=level`.
pub fn start_logging(filter: &str, format: LogFormat) -> Result<(), ServiceError> {
    let parsed = EnvFilter::try_new(filter).map_err(|e| ServiceError::LogFilter {
        filter: filter.to_owned(),
        reason: e.to_string(),
    })?;
    let mut lines = tracing_subscriber::fmt()
        .with_env_filter(parsed)
        .with_writer(stderr);
    // Files and journals are searched as they are: colours are for a terminal alone, unless NO_COLOR forbids them.
    if !stderr().is_terminal() {
        lines = lines.with_ansi(false);
    }
    match format {
        LogFormat::Text => lines.init(),
        LogFormat::Json => lines
            .json()
            .flatten_event(true)
            .with_current_span(true)
            .init(),
    }
    Ok(())
}
