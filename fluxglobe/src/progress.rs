//! Progress bars on standard error: a name and a count of steps in, a bar or (without a terminal) a line out.

use std::io::{ErrorKind, Write};
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `steps` named steps; without a terminal it stays silent and `done` prints one line.
pub(crate) fn bar(what: &'static str, steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template(
        "{prefix:>24} {bar:32.cyan/blue} {pos}/{len} {wide_msg} {elapsed}",
    )
    .expect("the template is constant")
    .progress_chars("━╸─");
    let bar = ProgressBar::new(steps).with_style(style).with_prefix(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Ends a bar and leaves one line that says what came of it.
pub(crate) fn done(bar: &ProgressBar, outcome: &str) {
    let what = bar.prefix();
    let seconds = bar.elapsed().as_secs_f64();
    bar.finish_and_clear();
    say(&format!("{what:>24} {outcome} ({seconds:.1} s)"));
}

/// Ingest's progress as a bar over files.
pub(crate) struct LandingBar(ProgressBar);

impl LandingBar {
    /// A bar over a number of files.
    pub(crate) fn new(files: usize) -> Self {
        Self(bar("land files", files as u64))
    }

    /// Ends the bar and leaves one line.
    pub(crate) fn done(&self, outcome: &str) {
        done(&self.0, outcome);
    }
}

impl ingest::Progress for LandingBar {
    fn stage(&self, file: &Path, stage: ingest::Stage, _step: usize, _steps: usize) {
        let name = file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        self.0
            .set_message(format!("{} {name}", format!("{stage:?}").to_lowercase()));
    }

    fn done(&self, _outcome: &ingest::Outcome) {
        self.0.inc(1);
    }
}

/// A line of talk on standard error. Where nobody takes it (`2>&1 | head`, a log on a full disk), the work goes on and its result counts:
/// the macro of the standard library would panic.
pub(crate) fn say(line: &str) {
    say_to(&mut std::io::stderr(), line);
}

fn say_to(out: &mut dyn Write, line: &str) {
    _ = writeln!(out, "{line}");
}

/// A result. A reader that went away (`| head`) is no failure.
pub(crate) fn result(text: &str) -> anyhow::Result<()> {
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        outcome => Ok(outcome?),
    }
}
