//! A process from its start to its end: what it printed, how long it took, how much memory it held at most.

use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};
use serde::Serialize;

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// A process that has ended well.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Ran {
    #[serde(skip)]
    pub(super) output: String,
    pub(super) wall_s: f64,
    /// Most memory that it held, as the system counts it (`VmHWM`), its children apart; none where the system does not tell.
    pub(super) peak_mb: Option<f64>,
}

/// Runs a program to its end; settings of this process are not its own.
pub(super) fn ran(program: &Path, words: &[String]) -> Result<Ran> {
    let begun = Instant::now();
    let mut child = Command::new(program)
        .args(words)
        .env_remove("FLUXGLOBE_STORE")
        .env_remove("FLUXGLOBE_CLUSTER")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("starting {}", program.display()))?;
    let (out, talk) = (child.stdout.take(), child.stderr.take());
    let read = |mut from: Box<dyn std::io::Read + Send>| {
        std::thread::Builder::new()
            .name("bench-output".to_owned())
            .spawn(move || {
                let mut text = String::new();
                from.read_to_string(&mut text).map(|_bytes| text)
            })
    };
    let out = read(Box::new(out.context("standard output is piped")?))?;
    let talk = read(Box::new(talk.context("standard error is piped")?))?;
    let mut peak_kb: Option<u64> = None;
    let status = loop {
        peak_kb = peak_kb.max(high_water_kb(child.id()));
        if let Some(status) = child.try_wait()? {
            break status;
        }
        std::thread::sleep(LOOK);
    };
    let wall_s = begun.elapsed().as_secs_f64();
    let joined = |text: std::thread::JoinHandle<std::io::Result<String>>| {
        let text = text.join().ok().context("reading what it printed")?;
        Ok::<_, anyhow::Error>(text?)
    };
    let (output, talk) = (joined(out)?, joined(talk)?);
    ensure!(
        status.success(),
        "{} {} failed ({status}): {talk}",
        program.display(),
        words.join(" ")
    );
    Ok(Ran {
        output,
        wall_s,
        peak_mb: peak_kb.map(|kb| kb as f64 / 1024.0),
    })
}

/// Most memory that a running process has held so far, KiB.
fn high_water_kb(pid: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(line: &str) -> Result<Ran> {
        ran(Path::new("/bin/sh"), &["-c".to_owned(), line.to_owned()])
    }

    #[test]
    fn what_it_printed_and_held_is_told_and_a_failure_is_one() {
        let told = shell("sleep 0.1; echo yes").unwrap();
        assert_eq!(told.output, "yes\n");
        assert!(told.wall_s >= 0.1, "{}", told.wall_s);
        if cfg!(target_os = "linux") {
            assert!(told.peak_mb.unwrap() > 0.1);
        }
        let failed = shell("echo no >&2; exit 3").unwrap_err().to_string();
        assert!(failed.contains("no") && failed.contains('3'), "{failed}");
    }
}
