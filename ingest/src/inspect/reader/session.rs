//! The parent's side of one reader process: starts it, asks it, and turns its death into a refusal of the file.

use std::collections::VecDeque;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use contract::event::RejectReason;
use serde::de::DeserializeOwned;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::time::Instant;

use super::protocol::{self, Answer, Opened, Request};
use crate::error::{IngestError, Rejection, Stop};
use crate::inspect::file::description::{Description, Part};
use crate::limits::Limits;
use crate::settings::Settings;

/// Last words of a reader that are kept to tell why it died.
const MAX_LAST_WORDS_BYTES: u64 = 4096;
/// How long a reader that closed its output may take to be gone: one that dies closes it in that moment.
const DYING: Duration = Duration::from_secs(5);
/// Values that are taken from the reader at a time.
const BLOCK_VALUES: usize = 1 << 17;

/// One reader process with its file open.
pub(crate) struct Session {
    child: Child,
    input: ChildStdin,
    output: ChildStdout,
    limits: Limits,
    deadline: Instant,
    library_bytes: u64,
    /// What it was asked for and has not been read, in its order.
    asked: VecDeque<Request>,
}

/// What became of waiting for the reader.
enum Silence {
    /// It died or closed its output.
    Ended,
    /// It took too long.
    Late,
}

impl Session {
    /// Starts a reader and has it describe the file.
    pub(crate) async fn open(
        path: &Path,
        settings: &Settings,
    ) -> Result<(Self, Description), Stop> {
        let limits = settings.limits;
        let spawn = |source| IngestError::Spawn {
            program: settings.decoder.program.clone(),
            source,
        };
        let mut child = Command::new(&settings.decoder.program)
            .args(&settings.decoder.arguments)
            .arg(path)
            .args([limits.memory_bytes, limits.cpu_s, limits.read_cells].map(|n| n.to_string()))
            .env_clear()
            // "::" switches dynamic plugins of the HDF5 library off altogether.
            .env("HDF5_PLUGIN_PRELOAD", "::")
            .env("HDF5_USE_FILE_LOCKING", "FALSE")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(spawn)?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(spawn(std::io::Error::other("no pipes to it")).into());
        };
        let mut session = Self {
            child,
            input,
            output,
            limits,
            deadline: Instant::now() + limits.wall,
            library_bytes: 0,
            asked: VecDeque::new(),
        };
        match session.message::<Opened>().await? {
            Opened::Described(description) => {
                session.library_bytes = description.library_bytes.min(limits.memory_bytes);
                Ok((session, description))
            }
            Opened::Rejected(rejection) => Err(rejection.cleaned().into()),
        }
    }

    /// Memory of the reader beside the values that are asked for, bytes.
    pub(crate) fn library_bytes(&self) -> u64 {
        self.library_bytes
    }

    /// Values of a part of a variable, as many as `expected`.
    pub(crate) async fn read(
        &mut self,
        variable: &str,
        part: &[Part],
        expected: u64,
    ) -> Result<Vec<f64>, Stop> {
        if expected > self.limits.read_cells {
            let detail = format!(
                "{expected} values at once, at most {} are read",
                self.limits.read_cells
            );
            return Err(Rejection::new(RejectReason::TooLarge, variable, detail).into());
        }
        let request = Request::new(variable, part);
        // What was asked for and is not wanted any more comes before.
        while self.asked.front().is_some_and(|front| *front != request) {
            self.asked.pop_front();
            if let Answer::Values { count } = self.message().await? {
                self.pass_over(count).await?;
            }
        }
        if self.asked.pop_front().is_none() {
            self.send(&request).await?;
        }
        match self.message::<Answer>().await? {
            Answer::Values { count } if count == expected => self.values(count as usize).await,
            Answer::Values { count } => {
                let detail = format!(
                    "the reader sent {count} values where {expected} belong; the file contradicts itself"
                );
                Err(Rejection::new(RejectReason::Corrupt, variable, detail).into())
            }
            Answer::Rejected(rejection) => Err(rejection.cleaned().into()),
        }
    }

    /// Asks for a part of a variable that will be read after what was asked for before: the reader is at it while its parent is
    /// busy with something else. Nothing is asked for twice.
    pub(crate) async fn ask(&mut self, variable: &str, part: &[Part]) -> Result<(), Stop> {
        let request = Request::new(variable, part);
        if self.asked.contains(&request) {
            return Ok(());
        }
        self.send(&request).await?;
        self.asked.push_back(request);
        Ok(())
    }

    async fn send(&mut self, request: &Request) -> Result<(), Stop> {
        let bytes = protocol::encode(request).map_err(|source| IngestError::Pipe { source })?;
        match tokio::time::timeout_at(self.deadline, self.input.write_all(&bytes)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_ended)) => Err(self.post_mortem(Silence::Ended).await),
            Err(_late) => Err(self.post_mortem(Silence::Late).await),
        }
    }

    /// Reads values that nobody wants.
    async fn pass_over(&mut self, count: u64) -> Result<(), Stop> {
        let mut left = count;
        while left > 0 {
            let block = left.min(BLOCK_VALUES as u64);
            self.bytes(block as usize * 8).await?;
            left -= block;
        }
        Ok(())
    }

    /// Values block by block: as bytes and as numbers at the same time a map would take its place twice.
    async fn values(&mut self, count: usize) -> Result<Vec<f64>, Stop> {
        let mut values = Vec::with_capacity(count);
        while values.len() < count {
            let block = (count - values.len()).min(BLOCK_VALUES);
            let bytes = self.bytes(block * 8).await?;
            let number =
                |b: &[u8]| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]);
            values.extend(bytes.chunks_exact(8).map(number));
        }
        Ok(values)
    }

    async fn message<T: DeserializeOwned>(&mut self) -> Result<T, Stop> {
        let prefix = self.bytes(4).await?;
        let prefix = [prefix[0], prefix[1], prefix[2], prefix[3]];
        // A reader that a file has taken over may say anything: what cannot be is a damaged file.
        let strange = |e: String| {
            Rejection::new(
                RejectReason::Corrupt,
                "file",
                format!("made its reader talk nonsense ({e})"),
            )
        };
        let len = protocol::message_bytes(prefix).map_err(|e| strange(e.to_string()))?;
        let json = self.bytes(len).await?;
        Ok(serde_json::from_slice(&json).map_err(|e| strange(e.to_string()))?)
    }

    async fn bytes(&mut self, count: usize) -> Result<Vec<u8>, Stop> {
        let mut bytes = vec![0; count];
        match tokio::time::timeout_at(self.deadline, self.output.read_exact(&mut bytes)).await {
            Ok(Ok(_)) => Ok(bytes),
            Ok(Err(_ended)) => Err(self.post_mortem(Silence::Ended).await),
            Err(_late) => Err(self.post_mortem(Silence::Late).await),
        }
    }

    /// Why a reader fell silent, as a refusal of its file.
    async fn post_mortem(&mut self, silence: Silence) -> Stop {
        let Limits {
            memory_bytes,
            cpu_s,
            wall,
            ..
        } = self.limits;
        let too_large =
            |detail: String| Stop::from(Rejection::new(RejectReason::TooLarge, "file", detail));
        if let Silence::Late = silence {
            self.kill();
            return too_large(format!(
                "was not read within {} s; give it in smaller pieces",
                wall.as_secs()
            ));
        }
        let corrupt =
            |detail: String| Stop::from(Rejection::new(RejectReason::Corrupt, "file", detail));
        let limit = Instant::now() + DYING;
        let last_words = self.last_words(limit).await;
        let status = match tokio::time::timeout_at(limit, self.child.wait()).await {
            Ok(Ok(status)) => status,
            Ok(Err(source)) => return IngestError::Pipe { source }.into(),
            Err(_alive) => {
                self.kill();
                let detail =
                    "made its reader close its output and go on; it is damaged, fetch it again";
                return corrupt(detail.to_owned());
            }
        };
        let last_words = String::from_utf8_lossy(&last_words);
        let signal = std::os::unix::process::ExitStatusExt::signal(&status);
        if last_words.contains("memory allocation") || last_words.contains("capacity overflow") {
            return too_large(format!(
                "needs more than {} MiB of memory to read; give it in smaller pieces",
                memory_bytes >> 20
            ));
        }
        // SIGKILL: the system had no memory left, or somebody stopped it.
        if signal == Some(9) {
            return IngestError::Killed.into();
        }
        // SIGXCPU.
        if signal == Some(24) {
            return too_large(format!(
                "took more than {cpu_s} s of processor time to read; give it in smaller pieces"
            ));
        }
        if status.code() == Some(i32::from(super::EXIT_USAGE)) {
            let source = std::io::Error::other(
                "it cannot set its limits, or is another version of this program",
            );
            return IngestError::Pipe { source }.into();
        }
        let cause = signal.map_or_else(|| status.to_string(), |n| format!("signal {n}"));
        corrupt(format!(
            "made its reader stop ({cause}); it is damaged, fetch it again"
        ))
    }

    /// What the reader wrote to its standard error; what is there at `limit` if somebody holds that open.
    async fn last_words(&mut self, limit: Instant) -> Vec<u8> {
        let mut last_words = Vec::new();
        if let Some(stderr) = self.child.stderr.take() {
            let mut stderr = stderr.take(MAX_LAST_WORDS_BYTES);
            let reading = stderr.read_to_end(&mut last_words);
            match tokio::time::timeout_at(limit, reading).await {
                Ok(Ok(_)) => {}
                Ok(Err(e)) => tracing::debug!(error = %e, "no last words"),
                Err(_open) => tracing::debug!("last words have no end"),
            }
        }
        last_words
    }

    fn kill(&mut self) {
        self.child
            .start_kill()
            .unwrap_or_else(|e| tracing::debug!(error = %e, "reader is gone already"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that reads nothing of what it is asked.
    fn deaf(wall: Duration) -> Session {
        let mut child = Command::new("sleep")
            .arg("60")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        Session {
            child,
            input,
            output,
            limits: Limits {
                wall,
                ..Limits::default()
            },
            deadline: Instant::now() + wall,
            library_bytes: 0,
            asked: VecDeque::new(),
        }
    }

    #[tokio::test]
    async fn a_reader_that_takes_no_requests_is_not_waited_for_beyond_its_time() {
        let mut session = deaf(Duration::from_millis(300));
        // More than a pipe holds.
        let long = "v".repeat(1 << 20);
        let asked = tokio::time::timeout(Duration::from_secs(30), session.ask(&long, &[]));
        let refused = asked.await.expect("it is waited for").unwrap_err();
        let Stop::Rejected(rejection) = refused else {
            panic!("a fault of the program")
        };
        assert_eq!(rejection.reason, RejectReason::TooLarge);
        assert!(session.child.wait().await.is_ok());
    }
}
