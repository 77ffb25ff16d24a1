//! One service of a cluster as a process: started, asked, killed, started again.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::http::{self, Answer};
use crate::program;

/// Longest wait for a service to be ready, whatever is built with little optimisation and on few cores.
const READY_LIMIT: Duration = Duration::from_mins(2);

/// A service process.
pub struct Node {
    /// Name for people, such as `ingestd-1`.
    pub name: String,
    /// Where `/readyz` and `/metrics` are.
    pub admin: String,
    words: Vec<String>,
    settings: Vec<(String, String)>,
    log: PathBuf,
    child: Option<Child>,
}

impl Node {
    /// Starts `fluxglobe WORDS` with settings from the environment; `admin` is the address it serves health on.
    pub fn start(
        folder: &Path,
        name: &str,
        words: &[&str],
        admin: &str,
        settings: &[(String, String)],
    ) -> Result<Self> {
        let mut node = Self {
            name: name.to_owned(),
            admin: format!("http://{admin}"),
            words: words.iter().map(ToString::to_string).collect(),
            settings: settings.to_vec(),
            log: folder.join(format!("{name}.log")),
            child: None,
        };
        node.restart()?;
        Ok(node)
    }

    /// Starts it again (or the first time); what it says is appended to its log.
    pub fn restart(&mut self) -> Result<()> {
        let log = File::options().create(true).append(true).open(&self.log)?;
        let child = program::unset()
            .args(&self.words)
            .envs(self.settings.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
            .with_context(|| format!("cannot start {}", self.name))?;
        self.child = Some(child);
        Ok(())
    }

    /// Kills it with SIGKILL.
    pub fn kill(&mut self) -> Result<()> {
        if let Some(mut child) = self.child.take() {
            child.kill()?;
            child.wait()?;
        }
        Ok(())
    }

    /// Asks it to stop and waits; its exit code.
    pub fn stop(&mut self) -> Result<Option<i32>> {
        let Some(mut child) = self.child.take() else {
            return Ok(None);
        };
        Command::new("kill")
            .args(["-TERM", &child.id().to_string()])
            .status()?;
        let start = Instant::now();
        while start.elapsed() < READY_LIMIT {
            if let Some(status) = child.try_wait()? {
                return Ok(status.code());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        child.kill()?;
        child.wait()?;
        bail!("{} did not stop when asked:\n{}", self.name, self.talk())
    }

    /// Has it ended by itself?
    pub fn has_ended(&mut self) -> bool {
        self.child
            .as_mut()
            .is_none_or(|child| !matches!(child.try_wait(), Ok(None)))
    }

    /// Waits until it ends by itself; its exit code, none if a signal ended it.
    pub fn wait_until_ended(&mut self) -> Result<Option<i32>> {
        let start = Instant::now();
        let mut child = self.child.take().context("it does not run")?;
        while start.elapsed() < READY_LIMIT {
            if let Some(status) = child.try_wait()? {
                return Ok(status.code());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        child.kill()?;
        child.wait()?;
        bail!("{} went on:\n{}", self.name, self.talk())
    }

    /// Waits until it says that it is ready; how long that took.
    pub fn wait_until_ready(&mut self) -> Result<Duration> {
        let start = Instant::now();
        while start.elapsed() < READY_LIMIT {
            if http::get(&format!("{}/readyz", self.admin)).is_ok_and(|answer| answer.status == 200)
            {
                return Ok(start.elapsed());
            }
            if self.has_ended() {
                bail!("{} ended:\n{}", self.name, self.talk());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        bail!(
            "{} was not ready within {READY_LIMIT:?}:\n{}",
            self.name,
            self.talk()
        )
    }

    /// Fetches a path of its admin address.
    pub fn get(&self, path: &str) -> Result<Answer> {
        http::get(&format!("{}{path}", self.admin))
    }

    /// A metric's value summed over its labels; 0 when there is none yet.
    pub fn metric(&self, name: &str) -> Result<f64> {
        let text = self.get("/metrics")?.text();
        let value = |line: &str| {
            let rest = line.strip_prefix(name)?;
            if !rest.starts_with([' ', '{']) {
                return None;
            }
            rest.rsplit(' ').next()?.parse::<f64>().ok()
        };
        Ok(text.lines().filter_map(value).sum())
    }

    /// All that it said since it was first started.
    pub fn said(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    /// The end of what it said.
    pub fn talk(&self) -> String {
        let text = self.said();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(40)..].join("\n")
    }

    /// Resident memory, bytes.
    pub fn memory_bytes(&self) -> Result<u64> {
        let child = self.child.as_ref().context("it does not run")?;
        program::memory_bytes(child.id())
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        drop(self.kill());
    }
}
