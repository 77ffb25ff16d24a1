//! What ends servers of a test's own together with whoever started them, however that one ends.

use std::path::Path;
use std::process::{Child, Command, Stdio};

/// The watcher's standard input comes to its end with the process that holds the other end of it, killed or not.
const WATCH: &str = "cat >/dev/null; \"$@\" && rm -rf \"$FLUXGLOBE_RUN\"";

/// Stops servers of `deploy/services` and removes their run folder when it is dropped or this process ends, be it by a kill or with
/// this value in a static. They lead sessions of their own, so that nothing else would end them.
pub struct Stopper {
    watcher: Child,
}

impl Stopper {
    /// For servers by their names in `services.sh`, before they are started: what is killed meanwhile has ended too. `run` is their
    /// `FLUXGLOBE_RUN`, and nobody else's.
    ///
    /// # Errors
    /// The watching process cannot be started.
    pub fn new(names: &[&str], run: &Path) -> std::io::Result<Self> {
        let script = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../deploy/services/services.sh"
        );
        let mut command = Command::new("sh");
        command
            .args(["-c", WATCH, "sh", script, "stop"])
            .args(names)
            .env("FLUXGLOBE_RUN", run)
            .stdin(Stdio::piped())
            // Whoever reads what a test says waits for all that could say more.
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;
            // A suite that is ended is killed as a group.
            command.process_group(0);
        }
        Ok(Self {
            watcher: command.spawn()?,
        })
    }
}

impl Drop for Stopper {
    fn drop(&mut self) {
        drop(self.watcher.stdin.take());
        // A server that cannot be stopped is left to the end of the machine; the test has its verdict already.
        drop(self.watcher.wait());
    }
}
