//! A disk that can be filled and emptied: a folder in memory of a few megabytes. Only the superuser can make one.

use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use tempfile::TempDir;

/// What fills it.
const FILLER: &str = "filler";
const BLOCK_BYTES: usize = 4096;

/// A mounted disk, unmounted when dropped.
pub struct SmallDisk {
    folder: PathBuf,
    /// Where it is mounted if that is a folder of its own.
    own: Option<TempDir>,
}

impl SmallDisk {
    /// Mounts one in a folder of its own; none, with a word on standard error, for those who may not.
    pub fn make(mebibytes: u32) -> Result<Option<Self>> {
        let own = tempfile::tempdir()?;
        let disk = Self::over(own.path(), mebibytes)?;
        Ok(disk.map(|mut disk| {
            disk.own = Some(own);
            disk
        }))
    }

    /// Mounts one over a folder, whose content is hidden meanwhile.
    pub fn over(folder: &Path, mebibytes: u32) -> Result<Option<Self>> {
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={mebibytes}m"), "tmpfs"])
            .arg(folder)
            .output()
            .context("cannot start mount")?;
        if !mounted.status.success() {
            let reason = String::from_utf8_lossy(&mounted.stderr);
            test_data::not_run(&format!("the right to mount a disk ({})", reason.trim()));
            return Ok(None);
        }
        Ok(Some(Self {
            folder: folder.to_owned(),
            own: None,
        }))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Fills it up to so many free bytes.
    pub fn fill(&self, free_bytes: usize) -> Result<()> {
        let mut file = File::create(self.folder.join(FILLER))?;
        let mut written_bytes = 0u64;
        loop {
            match file.write_all(&[1; BLOCK_BYTES]) {
                Ok(()) => written_bytes += BLOCK_BYTES as u64,
                Err(e) if e.kind() == ErrorKind::StorageFull => break,
                Err(e) => return Err(e.into()),
            }
        }
        ensure!(written_bytes > free_bytes as u64, "the disk is too small");
        file.set_len(written_bytes - free_bytes as u64)?;
        Ok(())
    }

    /// Makes room again.
    pub fn empty(&self) -> Result<()> {
        std::fs::remove_file(self.folder.join(FILLER))?;
        Ok(())
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Also while a process still has a file open on it; nothing of it is wanted any more.
        drop(
            Command::new("umount")
                .arg("--lazy")
                .arg(&self.folder)
                .status(),
        );
        drop(self.own.take());
    }
}
