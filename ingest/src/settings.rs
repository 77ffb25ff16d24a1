//! Settings of ingest: limits on what a file may ask for, what may be read, and where the sandboxed reader is.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::fetch::Sources;
use crate::limits::Limits;
use crate::plan::profile::Profiles;

/// The sandboxed reader: a program and what comes before its own arguments.
#[derive(Debug, Clone)]
pub struct DecoderCommand {
    /// Program.
    pub program: PathBuf,
    /// Arguments before those of [`crate::reader::run_child`], such as the hidden subcommand.
    pub arguments: Vec<OsString>,
}

impl DecoderCommand {
    /// This very program with its hidden subcommand `decode-file`.
    ///
    /// # Errors
    /// The system does not say where this program is.
    pub fn current() -> std::io::Result<Self> {
        Ok(Self {
            program: std::env::current_exe()?,
            arguments: vec!["decode-file".into()],
        })
    }
}

/// Settings of ingest.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The sandboxed reader.
    pub decoder: DecoderCommand,
    /// Limits on one file.
    pub limits: Limits,
    /// Files that are read at the same time, 1 to 64.
    pub parallel_files: usize,
    /// Memory that files which are worked on may take together, readers included, bytes: what they unpack to
    /// counts, not what they weigh. One that needs more goes alone.
    pub parallel_bytes: u64,
    /// Folder for what is too large to be held while it is worked on.
    pub spool: PathBuf,
    /// What may be read.
    pub sources: Sources,
    /// How files are to be read.
    pub profiles: Profiles,
}

impl Settings {
    /// Default limits, two files at a time, and this very program as the reader, for files that the user names.
    ///
    /// # Errors
    /// The system does not say where this program is.
    pub fn with_current_program() -> std::io::Result<Self> {
        Ok(Self::with_decoder(DecoderCommand::current()?))
    }

    /// Default limits and two files at a time, for files that the user names.
    pub fn with_decoder(decoder: DecoderCommand) -> Self {
        Self {
            decoder,
            limits: Limits::default(),
            parallel_files: 2,
            parallel_bytes: 1 << 30,
            spool: spool(),
            sources: Sources::command_line(),
            profiles: Profiles::shipped(),
        }
    }
}

/// A folder on a disk: that for temporary files may lie in memory.
fn spool() -> PathBuf {
    let disk = PathBuf::from("/var/tmp");
    if disk.is_dir() {
        disk
    } else {
        std::env::temp_dir()
    }
}
