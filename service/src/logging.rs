//! Log lines on standard error: for people, or a JSON object a line for collectors.

use std::io::{IsTerminal as _, stderr};

use tracing_subscriber::EnvFilter;

use crate::ServiceError;

/// What is logged unless a filter is given: warnings, without those of libraries that say what nobody can do anything about. Ballista's
/// scheduler cannot add the measures of a stage to its plan where DataFusion measures more operators than the plan shows, which
/// changes no answer; the rasteriser of plots tells of every shape that is too small to be seen.
pub const USUAL_FILTER: &str = "warn,ballista_scheduler::display=off,usvg=off";

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
    // A line that cannot be written (a log on a full disk, a reader that went away) is lost, and no panic of whoever said it: the library
    // would tell of it by `eprintln!`, on the same standard error.
    let mut lines = tracing_subscriber::fmt()
        .log_internal_errors(false)
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

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};

    use super::*;

    /// Keeps the targets of what is logged.
    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<String>>>);

    impl<S: tracing::Subscriber> Layer<S> for Kept {
        fn on_event(&self, event: &tracing::Event<'_>, _context: Context<'_, S>) {
            let target = event.metadata().target().to_owned();
            self.0.lock().unwrap().push(target);
        }
    }

    fn logged(filter: &str) -> Vec<String> {
        let kept = Kept::default();
        let filter = EnvFilter::try_new(filter).unwrap();
        let subscriber = tracing_subscriber::registry().with(filter);
        tracing::subscriber::with_default(subscriber.with(kept.clone()), || {
            tracing::error!(target: "ballista_scheduler::display", "a stage");
            tracing::error!(target: "ballista_scheduler::state", "a job");
            tracing::warn!(target: "usvg::parser::shapes", "a shape");
            tracing::warn!(target: "ingest", "a file");
            tracing::info!(target: "ingest", "another file");
        });
        let targets = kept.0.lock().unwrap();
        targets.clone()
    }

    #[test]
    fn libraries_that_cry_for_nothing_are_heard_when_asked_for() {
        assert_eq!(
            logged(USUAL_FILTER),
            ["ballista_scheduler::state", "ingest"]
        );
        let all = [
            "ballista_scheduler::display",
            "ballista_scheduler::state",
            "usvg::parser::shapes",
            "ingest",
        ];
        assert_eq!(logged("warn"), all);
    }
}
