//! The built program: words in; exit code, standard output and standard error out.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context as _, Result, ensure};

/// Path of the built `fluxglobe`, beside the folder this test runs from.
pub fn path() -> PathBuf {
    let test = std::env::current_exe().expect("a running test has a path");
    let target = test
        .parent()
        .and_then(Path::parent)
        .expect("tests run in a folder of the target folder");
    target.join("fluxglobe")
}

/// A command on a data folder; nothing of the caller's settings leaks into it.
pub fn command(data: &Path) -> Command {
    let mut command = unset();
    command.arg("--data").arg(data);
    command
}

/// The program without any setting: servers that this test run was given are not meant for it.
pub fn unset() -> Command {
    let mut command = Command::new(path());
    for (name, _value) in std::env::vars_os() {
        let is_setting = |text: &str| text.starts_with("FLUXGLOBE_") || text.starts_with("AWS_");
        if name.to_str().is_some_and(is_setting) {
            command.env_remove(name);
        }
    }
    command
}

/// Runs to the end, whatever its exit code.
pub fn run(data: &Path, words: &[&str]) -> Result<Output> {
    let program = path();
    ensure!(
        program.exists(),
        "{} is not built; run `cargo build --workspace` first",
        program.display()
    );
    command(data)
        .args(words)
        .output()
        .context("cannot start fluxglobe")
}

/// Standard output of a run that must succeed.
pub fn succeed(data: &Path, words: &[&str]) -> Result<String> {
    let output = run(data, words)?;
    let talk = String::from_utf8_lossy(&output.stderr);
    ensure!(
        output.status.success(),
        "fluxglobe {words:?} failed ({}):\n{talk}",
        output.status
    );
    Ok(String::from_utf8(output.stdout)?)
}

/// JSON on the standard output of a run that must succeed.
pub fn json(data: &Path, words: &[&str]) -> Result<serde_json::Value> {
    let text = succeed(data, words)?;
    serde_json::from_str(&text)
        .with_context(|| format!("fluxglobe {words:?} printed no JSON: {text}"))
}

/// Standard error of a run that must fail, without a panic.
pub fn fail(data: &Path, words: &[&str]) -> Result<String> {
    let output = run(data, words)?;
    let talk = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(
        !output.status.success(),
        "fluxglobe {words:?} should have failed:\n{talk}"
    );
    ensure!(
        !talk.contains("panicked"),
        "fluxglobe {words:?} panicked:\n{talk}"
    );
    Ok(talk)
}

/// Resident memory of a process, bytes.
pub fn memory_bytes(id: u32) -> Result<u64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status"))?;
    let kib = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))
        .and_then(|rest| rest.trim().trim_end_matches(" kB").parse::<u64>().ok());
    kib.map(|kib| kib << 10).context("no memory figure")
}
