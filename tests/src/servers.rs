//! Real servers (Kafka, PostGIS, S3, HDFS) of a test's own: on free ports, in its own folder, stopped when dropped,
//! and when the test's process ends, killed or not.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, ensure};
use tempfile::TempDir;
use test_data::{Stopper, free_port};

/// Some of the servers of `deploy/services`.
pub struct Servers {
    /// Before the folder, which goes after it.
    _stopper: Stopper,
    folder: TempDir,
    told: Vec<(&'static str, String)>,
    settings: Vec<(String, String)>,
}

impl Servers {
    /// Starts some of `kafka`, `postgis`, `s3`, `hdfs` and `prometheus`.
    pub fn start(names: &[&'static str]) -> Result<Self> {
        Self::start_told(names, vec![])
    }

    /// The same, told more than their ports: variables that the scripts of `deploy/services` know.
    pub fn start_told(names: &[&'static str], told: Vec<(&'static str, String)>) -> Result<Self> {
        let port = || free_port().to_string();
        let ports = [
            "FLUXGLOBE_KAFKA_PORT",
            "FLUXGLOBE_KAFKA_CONTROLLER_PORT",
            "FLUXGLOBE_POSTGIS_PORT",
            "FLUXGLOBE_S3_PORT",
            "FLUXGLOBE_HDFS_PORT",
            "FLUXGLOBE_HDFS_HTTP_PORT",
            "FLUXGLOBE_PROMETHEUS_PORT",
        ];
        let folder = tempfile::tempdir()?;
        let mut servers = Self {
            _stopper: Stopper::new(names, folder.path())?,
            folder,
            told: ports.map(|name| (name, port())).to_vec(),
            settings: vec![],
        };
        servers.told.extend(told);
        servers.script("start", names)?;
        let text = servers.script("env", names)?;
        servers.settings = text.lines().filter_map(setting).collect();
        Ok(servers)
    }

    /// What the program must be told to use them, as environment variables.
    pub fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    /// One of the settings.
    pub fn setting(&self, name: &str) -> Result<&str> {
        let found = self.settings.iter().find(|(known, _)| known == name);
        found
            .map(|(_, value)| value.as_str())
            .with_context(|| format!("no server gives {name}"))
    }

    /// Folder of the servers' files.
    pub fn folder(&self) -> &std::path::Path {
        self.folder.path()
    }

    /// Tells the scripts one thing more, from the next start on.
    pub fn tell(&mut self, name: &'static str, value: &str) {
        self.told.push((name, value.to_owned()));
    }

    /// Stops one in an orderly way; its data stay.
    pub fn stop_one(&self, name: &'static str) -> Result<()> {
        self.script("stop", &[name]).map(|_text| ())
    }

    /// Kills one with SIGKILL; its data stay as they are.
    pub fn kill_one(&self, name: &'static str) -> Result<()> {
        let file = self.folder.path().join(name).join("pid");
        let pid = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
        let status = Command::new("kill").args(["-KILL", pid.trim()]).status()?;
        ensure!(status.success(), "cannot kill {name}");
        Ok(())
    }

    /// Starts one again on its old port with its old data.
    pub fn start_one(&self, name: &'static str) -> Result<()> {
        self.script("start", &[name]).map(|_text| ())
    }

    fn script(&self, verb: &str, names: &[&str]) -> Result<String> {
        let script =
            PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../deploy/services/services.sh");
        let output = Command::new(&script)
            .arg(verb)
            .args(names)
            .envs(self.told.iter().map(|(name, value)| (*name, value)))
            .env("FLUXGLOBE_RUN", self.folder.path())
            .stdin(Stdio::null())
            .output()
            .with_context(|| script.display().to_string())?;
        let talk = String::from_utf8_lossy(&output.stderr);
        ensure!(
            output.status.success(),
            "services.sh {verb} {names:?} failed:\n{talk}"
        );
        Ok(String::from_utf8(output.stdout)?)
    }
}

/// `export NAME=value`, the value perhaps in single quotes.
fn setting(line: &str) -> Option<(String, String)> {
    let (name, value) = line.strip_prefix("export ")?.split_once('=')?;
    Some((name.to_owned(), value.trim_matches('\'').to_owned()))
}
