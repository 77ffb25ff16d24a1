//! What may be read: anything by its path on the command line; for the service what its settings name, and nothing else.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use contract::event::RejectReason;
use futures::{Stream, StreamExt as _};
use tokio::io::{AsyncWriteExt as _, BufWriter};

use super::checksum::{Check, Expected, wrong_size};
use super::http::{self, AllowedHost, Web};
use super::local;
use super::location::Location;
use super::object::{self, AllowedStore};
use super::patience::{Miss, Patience, Tries, limited};
use super::raw::{Held, RawGranule, Stamp};
use super::spool::{self, Spool};
use crate::error::{IngestError, Stop};
use crate::rejection::Rejection;
use crate::settings::Limits;

/// Bytes gathered before they are written.
const WRITE_BYTES: usize = 1 << 20;

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
    patience: Patience,
}

/// What a service may read, as its settings say it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Allowed {
    pub(crate) folders: Vec<PathBuf>,
    pub(crate) hosts: Vec<AllowedHost>,
    pub(crate) stores: Vec<String>,
    pub(crate) spool: PathBuf,
    pub(crate) spool_bytes: u64,
    pub(crate) patience: Patience,
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
            patience: allowed.patience,
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
    /// Has a file, however often its source must be asked, within the patience that the settings give.
    async fn fetch(
        self: &Arc<Self>,
        location: &Location,
        expected: &Expected,
        limits: Limits,
    ) -> Result<RawGranule, Stop> {
        let mut tries = Tries::new(self.patience);
        loop {
            match self.try_once(location, expected, limits).await {
                Ok(raw) => return Ok(raw),
                Err(miss) => tries.after(miss, location).await?,
            }
        }
    }

    async fn try_once(
        self: &Arc<Self>,
        location: &Location,
        expected: &Expected,
        limits: Limits,
    ) -> Result<RawGranule, Miss> {
        let name = location.file_name();
        match location {
            Location::File(path) => {
                let (own, path, expected) = (Arc::clone(self), path.clone(), expected.clone());
                let read = move || local::inside(&own.folders, &path, &expected, limits);
                tokio::task::spawn_blocking(read)
                    .await
                    .map_err(Miss::task)?
            }
            Location::Web(url) => {
                let fetched = async {
                    let response = self.web.get(url).await?;
                    let length = response.content_length();
                    let chunks = response
                        .bytes_stream()
                        .map(|chunk| chunk.map_err(http::away));
                    self.keep(name, chunks, length, expected, limits).await
                };
                limited(self.patience.one_try, fetched).await
            }
            Location::Object(url) => {
                let fetched = async {
                    let found = object::get(&self.stores, url).await?;
                    let length = Some(found.meta.size);
                    let chunks = found.into_stream().map(|chunk| chunk.map_err(object::miss));
                    self.keep(name, chunks, length, expected, limits).await
                };
                limited(self.patience.one_try, fetched).await
            }
        }
    }

    /// Writes what comes to the spool, no more than is allowed, and compares it with what was announced.
    async fn keep(
        &self,
        file_name: String,
        chunks: impl Stream<Item = Result<Bytes, Miss>> + Send,
        length: Option<u64>,
        expected: &Expected,
        limits: Limits,
    ) -> Result<RawGranule, Miss> {
        let most = limits.file_bytes.min(self.spool.bytes());
        if let Some(length) = length {
            if length > most {
                return Err(local::too_large(length, most).into());
            }
            if let Some(refused) = wrong_size(expected, length) {
                return Err(refused.into());
            }
        }
        let room = length.or(expected.size_bytes).unwrap_or(most).min(most);
        let mut spooled = self.spool.file(room).await?;
        let unwritten = |folder: &Path| {
            let folder = folder.to_owned();
            move |source| Miss::from(spool::failed(&folder, source))
        };
        let writer = spooled
            .file()
            .try_clone()
            .map_err(unwritten(spooled.path()))?;
        let writer = tokio::fs::File::from_std(writer);
        let mut writer = BufWriter::with_capacity(WRITE_BYTES, writer);
        let mut check = Check::of(expected)?;
        let mut chunks = std::pin::pin!(chunks);
        while let Some(chunk) = chunks.next().await {
            let chunk = chunk?;
            check.update(&chunk)?;
            if check.size_bytes() > room {
                return Err(beyond(check.size_bytes(), room, most, expected).into());
            }
            writer
                .write_all(&chunk)
                .await
                .map_err(unwritten(spooled.path()))?;
        }
        writer.flush().await.map_err(unwritten(spooled.path()))?;
        let size_bytes = check.size_bytes();
        if length.is_some_and(|length| length != size_bytes) {
            return Err(Miss::Away(format!("only {size_bytes} bytes of it came")));
        }
        let sha256 = check.finish(expected)??;
        spooled.shrink_to(size_bytes);
        let metadata = spooled
            .file()
            .metadata()
            .map_err(unwritten(spooled.path()))?;
        let (path, stamp) = (spooled.path().to_owned(), Stamp::of(&metadata));
        let held = Held::Spooled(Arc::new(spooled));
        Ok(RawGranule::new(path, file_name, sha256, stamp, held))
    }
}

/// The refusal of a file that is longer than there was room for: longer than announced, or than allowed.
fn beyond(bytes: u64, room: u64, most: u64, expected: &Expected) -> Rejection {
    match wrong_size(expected, bytes) {
        Some(refused) if room < most => refused,
        _ => local::too_large(bytes, most),
    }
}
