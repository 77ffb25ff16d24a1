//! Settings of ingest: limits on what a file may ask for, what may be read, and where the sandboxed reader is.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use crate::fetch::Sources;
use crate::profile::Profiles;

/// The sandboxed reader: a program and what comes before its own arguments.
#[derive(Debug, Clone)]
pub struct DecoderCommand {
    /// Program.
    pub program: PathBuf,
    /// Arguments before those of [`crate::decoder::run_child`], such as the hidden subcommand.
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

/// What one file may ask for. A file beyond a limit is refused with the limit named.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Largest input file, bytes; the object store takes 2 GiB in one object.
    pub file_bytes: u64,
    /// Memory of the sandboxed reader, bytes of address space.
    pub memory_bytes: u64,
    /// Processor time of the sandboxed reader, seconds for one file.
    pub cpu_s: u64,
    /// Time for one file as the clock on the wall has it.
    pub wall: Duration,
    /// Most cells of one map of one variable; also bounds what is allocated for it.
    pub plane_cells: u64,
    /// Most cells that any variable may declare over all its dimensions.
    pub variable_cells: u64,
    /// Most time steps in one file.
    pub steps: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 2 << 30,
            memory_bytes: 3 << 30,
            cpu_s: 600,
            wall: Duration::from_mins(30),
            plane_cells: 1 << 26,
            variable_cells: 1 << 34,
            steps: 100_000,
        }
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
    /// Memory that files which are worked on may take together, readers and series included, bytes: what they unpack to
    /// counts, not what they weigh. One that needs more goes alone.
    pub parallel_bytes: u64,
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
            sources: Sources::command_line(),
            profiles: Profiles::shipped(),
        }
    }
}
