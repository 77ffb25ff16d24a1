//! A started `fluxglobe serve`: waits until it answers, fetches, and stops it when dropped.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::http::{self, Answer};
use crate::program;

/// Longest wait for a started server to answer.
const START_LIMIT: Duration = Duration::from_mins(1);

/// A running server.
pub struct Server {
    child: Child,
    /// Address, such as `http://127.0.0.1:40123`.
    pub url: String,
}

impl Server {
    /// Starts a server on a free port of this machine.
    pub fn start(data: &Path, words: &[&str]) -> Result<Self> {
        Self::start_with(data, words, &[])
    }

    /// The same with variables of the environment.
    pub fn start_with(data: &Path, words: &[&str], settings: &[(String, String)]) -> Result<Self> {
        let mut child = program::command(data)
            .args(words)
            .envs(settings.iter().map(|(name, value)| (name, value)))
            .args(["--listen", "127.0.0.1:0"])
            .stderr(Stdio::piped())
            .spawn()?;
        let talk = child.stderr.take().context("standard error is piped")?;
        let (sender, receiver) = std::sync::mpsc::sync_channel(1);
        // Goes on reading after the address is found, so that the server never blocks on a full pipe.
        std::thread::Builder::new()
            .name("server-talk".to_owned())
            .spawn(move || {
                for line in BufReader::new(talk).lines().map_while(Result::ok) {
                    let address = line
                        .split_whitespace()
                        .find(|word| word.starts_with("http://127.0.0.1:"));
                    if let Some(address) = address {
                        // Only the first address matters; later ones find the channel full or closed.
                        drop(sender.try_send(address.trim_end_matches('/').to_owned()));
                    }
                }
            })?;
        match receiver.recv_timeout(START_LIMIT) {
            Ok(url) => {
                let server = Self { child, url };
                server.wait_until_ready()?;
                Ok(server)
            }
            Err(_silent) => {
                drop(child.kill());
                bail!("fluxglobe {words:?} printed no address within {START_LIMIT:?}")
            }
        }
    }

    fn wait_until_ready(&self) -> Result<()> {
        let start = Instant::now();
        while start.elapsed() < START_LIMIT {
            if self.get("/readyz").is_ok_and(|answer| answer.status == 200) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        bail!("{} was not ready within {START_LIMIT:?}", self.url)
    }

    /// Resident memory, bytes.
    pub fn memory_bytes(&self) -> Result<u64> {
        program::memory_bytes(self.child.id())
    }

    /// Fetches a path; every status is an answer.
    pub fn get(&self, path: &str) -> Result<Answer> {
        http::get(&format!("{}{path}", self.url))
    }

    /// Asks a path with a body of GeoJSON; every status is an answer.
    pub fn post_geojson(&self, path: &str, body: &str) -> Result<Answer> {
        http::post_geojson(&format!("{}{path}", self.url), body)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}
