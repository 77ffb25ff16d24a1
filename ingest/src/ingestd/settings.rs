//! Settings of the ingest service as flags and environment variables of the same name.

use std::path::PathBuf;
use std::time::Duration;

use crate::error::IngestError;
use crate::fetch::{Allowed, AllowedHost, RetryLimits, Sources};
use crate::limits::Limits;
use crate::plan::profile::Profiles;
use crate::settings::{DecoderCommand, Settings};

const MIB: u64 = 1 << 20;
const TIB: u64 = 1 << 40;

/// What the ingest service may read, and how much at a time.
#[derive(Debug, Clone, clap::Args)]
pub struct ServiceSettings {
    /// Folder that notices may name files in, its subfolders included; several with commas. Links that lead out of it
    /// are not followed. None: no file of this machine is read.
    #[arg(
        long,
        env = "FLUXGLOBE_ALLOW_FOLDER",
        value_delimiter = ',',
        value_name = "FOLDER"
    )]
    pub allow_folder: Vec<PathBuf>,
    /// Host that notices may name although its address is not public, as HOST or HOST:PORT; several with commas. Public
    /// hosts need no permission; all others (loopback, private, link-local, metadata services) are refused.
    #[arg(
        long,
        env = "FLUXGLOBE_ALLOW_HOST",
        value_delimiter = ',',
        value_name = "HOST[:PORT]"
    )]
    pub allow_host: Vec<AllowedHost>,
    /// Prefix of an object store that notices may name files below, such as `s3://BUCKET/FOLDER`; several with commas. Keys
    /// of the store come from its usual variables.
    #[arg(
        long,
        env = "FLUXGLOBE_ALLOW_STORE",
        value_delimiter = ',',
        value_name = "URL"
    )]
    pub allow_store: Vec<String>,
    /// Folder for files from the network while they are worked on, and for fields too large to be held while they are written; made if absent, emptied of
    /// what a killed process left.
    #[arg(
        long,
        env = "FLUXGLOBE_SPOOL",
        default_value = "/var/tmp/fluxglobe-spool",
        value_name = "FOLDER"
    )]
    pub spool: PathBuf,
    /// Most bytes in the spool; further files wait. 1 MiB to 1 TiB.
    #[arg(long, env = "FLUXGLOBE_SPOOL_BYTES", default_value_t = 16 << 30,
          value_parser = clap::value_parser!(u64).range(MIB..=TIB))]
    pub spool_bytes: u64,
    /// Largest file, bytes; larger ones are refused. 1 MiB to 16 GiB, which is what the store takes in one object.
    #[arg(long, env = "FLUXGLOBE_FILE_BYTES", default_value_t = 8 << 30,
          value_parser = clap::value_parser!(u64).range(MIB..=16 << 30))]
    pub file_bytes: u64,
    /// Files that are read at the same time, 1 to 64: each has a reader process of its own.
    #[arg(long, env = "FLUXGLOBE_PARALLEL_FILES", default_value_t = 2,
          value_parser = clap::value_parser!(u16).range(1..=64))]
    pub parallel_files: u16,
    /// Memory that the files which are worked on may take together, their readers included, bytes: the cells that they
    /// unpack to count, and not what they weigh. One that needs more goes alone. 1 MiB to 1 TiB.
    #[arg(long, env = "FLUXGLOBE_PARALLEL_BYTES", default_value_t = 1 << 30,
          value_parser = clap::value_parser!(u64).range(MIB..=TIB))]
    pub parallel_bytes: u64,
    /// Notices that are under way at the same time, 1 to 1024. Those that wait for a source that is slow or away are not
    /// counted, up to 16 times as many.
    #[arg(long, env = "FLUXGLOBE_PARALLEL_NOTICES", default_value_t = 64,
          value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub parallel_notices: u16,
    /// Memory of one reader process, bytes. 64 MiB to 1 TiB.
    #[arg(long, env = "FLUXGLOBE_READER_BYTES", default_value_t = 3 << 30,
          value_parser = clap::value_parser!(u64).range(64 * MIB..=TIB))]
    pub reader_bytes: u64,
    /// Times a source is asked that says that it has no such file, or not for us, 1 to 100; then the notice is refused.
    #[arg(long, env = "FLUXGLOBE_FETCH_TRIES", default_value_t = 5,
          value_parser = clap::value_parser!(u32).range(1..=100))]
    pub fetch_tries: u32,
    /// How long a source is asked again that does not answer or is out of order, seconds, at most a week; then the notice
    /// is refused.
    #[arg(long, env = "FLUXGLOBE_FETCH_RETRY_S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(0..=604_800))]
    pub fetch_retry_s: u64,
    /// Time limit of one attempt to fetch a file, seconds, 1 to 86400.
    #[arg(long, env = "FLUXGLOBE_FETCH_LIMIT_S", default_value_t = 1800,
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub fetch_limit_s: u64,
    /// A source that does not answer for so long, or sends less than --fetch-slowest-bytes-s on average, is left and asked
    /// again, within --fetch-retry-s; seconds, 1 to 3600.
    #[arg(long, env = "FLUXGLOBE_FETCH_SILENCE_S", default_value_t = 30,
          value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub fetch_silence_s: u64,
    /// The slowest that a source may be, bytes a second, at most 1 GiB; 0 for any that sends something.
    #[arg(long, env = "FLUXGLOBE_FETCH_SLOWEST_BYTES_S", default_value_t = 4096,
          value_parser = clap::value_parser!(u64).range(0..=1 << 30))]
    pub fetch_slowest_bytes_s: u64,
    /// How long work that is under way may take after the service was asked to stop, seconds, at most an hour. What is not
    /// done then is done again by another process.
    #[arg(long, env = "FLUXGLOBE_DRAIN_S", default_value_t = 25,
          value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub drain_s: u64,
    /// Folder of profiles of your own (*.toml), tried before those of the program.
    #[arg(long, env = "FLUXGLOBE_PROFILES", value_name = "FOLDER")]
    pub profiles: Option<PathBuf>,
}

impl ServiceSettings {
    /// Checks what the settings name (folders, profiles, spool, stores) and makes it ready to use.
    ///
    /// # Errors
    /// The setting that cannot be used.
    pub fn resolve(&self, decoder: DecoderCommand) -> Result<Settings, IngestError> {
        let allowed = Allowed {
            folders: self.allow_folder.clone(),
            hosts: self.allow_host.clone(),
            stores: self.allow_store.clone(),
            spool: self.spool.clone(),
            spool_bytes: self.spool_bytes,
            retry_limits: RetryLimits {
                attempts: self.fetch_tries,
                away: Duration::from_secs(self.fetch_retry_s),
                one_attempt: Duration::from_secs(self.fetch_limit_s),
                silence: Duration::from_secs(self.fetch_silence_s),
                slowest_bytes_s: self.fetch_slowest_bytes_s,
            },
        };
        Ok(Settings {
            decoder,
            limits: Limits {
                file_bytes: self.file_bytes,
                memory_bytes: self.reader_bytes,
                ..Limits::default()
            },
            parallel_files: usize::from(self.parallel_files),
            parallel_bytes: self.parallel_bytes,
            spool: self.spool.clone(),
            profiles: match &self.profiles {
                Some(folder) => Profiles::with_folder(folder)?,
                None => Profiles::shipped(),
            },
            sources: Sources::guarded(allowed)?,
        })
    }
}
