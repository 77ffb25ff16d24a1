//! What may be read: anything by its path on the command line; for the service what its settings name, and nothing else.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::event::RejectReason;
use futures::StreamExt as _;

use super::checksum::Expected;
use super::http::{self, AllowedHost, Web};
use super::keep::Keep;
use super::local;
use super::location::Location;
use super::object::{self, AllowedStore};
use super::pace::Slowest;
use super::raw::RawGranule;
use super::retry::{Attempts, Miss, RetryLimits, answered, given_up, limited};
use super::spool::Spool;
use super::turns::Turns;
use crate::error::{IngestError, Rejection, Stop};
use crate::limits::Limits;

/// What may be read. Clones share connections and spool.
#[derive(Debug, Clone, Default)]
pub struct Sources(Option<Arc<Guarded>>);

/// What the settings of a service allow.
#[derive(Debug)]
struct Guarded {
    /// Canonical.
    folders: Vec<PathBuf>,
    web: Web,
    stores: Vec<AllowedStore>,
    spool: Spool,
    retry_limits: RetryLimits,
    turns: Turns,
}

/// What a service may read, as its settings say it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Allowed {
    pub(crate) folders: Vec<PathBuf>,
    pub(crate) hosts: Vec<AllowedHost>,
    pub(crate) stores: Vec<String>,
    pub(crate) spool: PathBuf,
    pub(crate) spool_bytes: u64,
    pub(crate) retry_limits: RetryLimits,
}

impl Sources {
    /// Any file of this machine, and nothing else: for files that the user names.
    pub fn command_line() -> Self {
        Self(None)
    }

    /// What a service may read. Everything is tried now, so that a mistake in the settings is told before any work.
    pub(crate) fn guarded(allowed: Allowed) -> Result<Self, IngestError> {
        let canonical = |folder: &PathBuf| {
            let failed = |e: std::io::Error| IngestError::Setting {
                setting: "allow-folder",
                detail: format!("{}: {e}", folder.display()),
            };
            let real = std::fs::canonicalize(folder).map_err(failed)?;
            std::fs::read_dir(&real).map_err(failed)?;
            Ok(real)
        };
        let folders = allowed.folders.iter().map(canonical);
        let stores = allowed.stores.iter().map(|text| AllowedStore::open(text));
        Ok(Self(Some(Arc::new(Guarded {
            folders: folders.collect::<Result<_, IngestError>>()?,
            stores: stores.collect::<Result<_, IngestError>>()?,
            web: Web::new(allowed.hosts)?,
            spool: Spool::open(&allowed.spool, allowed.spool_bytes)?,
            retry_limits: allowed.retry_limits,
            turns: Turns::default(),
        }))))
    }

    /// May files be named by whoever sends a notice, and not by the user alone?
    pub(crate) fn is_guarded(&self) -> bool {
        self.0.is_some()
    }

    /// Can a file be kept now?
    pub(crate) fn check(&self) -> Result<(), IngestError> {
        self.0
            .as_ref()
            .map_or(Ok(()), |guarded| guarded.spool.check())
    }

    pub(super) async fn fetch(
        &self,
        location: &Location,
        expected: &Expected,
        limits: Limits,
    ) -> Result<RawGranule, Stop> {
        match (&self.0, location) {
            (Some(guarded), _) => guarded.fetch(location, expected, limits).await,
            (None, Location::File(path)) => {
                let (path, expected) = (path.clone(), expected.clone());
                tokio::task::spawn_blocking(move || local::any(&path, &expected, limits)).await?
            }
            (None, Location::Web(_) | Location::Object(_)) => {
                let detail = "is an address; give a file of this machine, or send a notice to the ingest service";
                Err(Rejection::new(RejectReason::Location, "path", detail).into())
            }
        }
    }
}

impl Guarded {
    /// Has a file, however often its source must be asked, within the limits that the settings give.
    async fn fetch(
        self: &Arc<Self>,
        location: &Location,
        expected: &Expected,
        limits: Limits,
    ) -> Result<RawGranule, Stop> {
        let source = self.turns.source(location.source());
        let away_limit = self.retry_limits.away;
        let mut attempts = Attempts::new(self.retry_limits);
        loop {
            let turn = self.turns.take(&source, away_limit).await;
            let turn = turn.map_err(|why| given_up(away_limit, &why))?;
            // Waiting for room of our own is not the source's fault.
            let (begun, mut for_room) = (Instant::now(), Duration::ZERO);
            let tried = self.attempt(location, expected, limits, &mut for_room);
            let tried = tried.await;
            match &tried {
                Ok(_) | Err(Miss::Absent(_)) => source.answered(),
                Err(Miss::Away(why)) => source.is_away(why),
                Err(Miss::Stop(_)) => {}
            }
            match tried {
                Ok(raw) => return Ok(raw),
                Err(miss) => {
                    drop(turn);
                    let spent = begun.elapsed().saturating_sub(for_room);
                    attempts.after(miss, spent, location).await?;
                }
            }
        }
    }

    /// Largest file that is fetched.
    fn most(&self, limits: Limits) -> u64 {
        limits.file_bytes.min(self.spool.bytes())
    }

    /// Tries to have a file; adds to `for_room` how long it waited for room in the spool. That is waited for once the
    /// source has answered: one that never does takes no room from others.
    async fn attempt(
        self: &Arc<Self>,
        location: &Location,
        expected: &Expected,
        limits: Limits,
        for_room: &mut Duration,
    ) -> Result<RawGranule, Miss> {
        let RetryLimits {
            one_attempt,
            silence,
            slowest_bytes_s,
            ..
        } = self.retry_limits;
        let (chunks, length) = match location {
            Location::File(path) => {
                let (own, path, expected) = (Arc::clone(self), path.clone(), expected.clone());
                let read = move || local::inside(&own.folders, &path, &expected, limits);
                let read = async {
                    let read = tokio::task::spawn_blocking(read).await;
                    read.map_err(Miss::task)?
                };
                return limited(one_attempt, read).await;
            }
            Location::Web(url) => {
                let response = answered(silence.min(one_attempt), self.web.get(url)).await?;
                let length = response.content_length();
                let chunks = response.bytes_stream();
                let chunks = chunks.map(|chunk| chunk.map_err(http::away));
                (chunks.boxed(), length)
            }
            Location::Object(url) => {
                let found = limited(one_attempt, object::get(&self.stores, url)).await?;
                let length = Some(found.meta.size);
                let chunks = found.into_stream();
                let chunks = chunks.map(|chunk| chunk.map_err(object::miss));
                (chunks.boxed(), length)
            }
        };
        let keep = Keep {
            file_name: location.file_name(),
            chunks,
            length,
            most: self.most(limits),
            slowest: Some(Slowest {
                bytes_s: slowest_bytes_s,
                within: silence,
            }),
        };
        keep.check_length(expected)?;
        let waiting = Instant::now();
        let spooled = self.spool.file(keep.room(expected)).await?;
        *for_room += waiting.elapsed();
        limited(one_attempt, keep.run(spooled, expected)).await
    }
}
